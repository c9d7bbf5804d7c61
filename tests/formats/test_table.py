"""What content tells of its format, and what it does not."""

from circparam.formats.table import output_suffix


def test_the_suffix_of_an_output_is_that_of_the_input_where_it_has_uv() -> None:
    named = {".STL": ".glb", ".off": ".glb", ".obj": ".obj", ".PLY": ".PLY", ".none": ".none"}
    assert {suffix: output_suffix(suffix) for suffix in named} == named
