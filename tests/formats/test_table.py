"""What content tells of its format, and what it does not."""

import numpy as np
import pytest

from circparam.formats.table import output_suffix, sniff

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def stl(n: int, extra: int = 0, head: bytes = b"") -> bytes:
    return head.ljust(80) + np.uint32(n).tobytes() + bytes(50 * n + extra)


@pytest.mark.parametrize(
    ("data", "format"),
    [
        (b"glTF\2\0\0\0", "glb"),
        (b"ply\nformat", "ply"),
        (b"ply \t\r\nformat", "ply"),
        (b"plyx\n", None),
        (b" ply\n", None),
        (b"OFF\n1 1 0", "off"),
        (b"\xef\xbb\xbf\n STCNOFF 1", "off"),
        (b"OFFS", None),
        (b' {"asset": 1}', "gltf"),
        (b"{}", None),
        (stl(0), "stl"),
        (stl(1), "stl"),
        (stl(1, 1), None),
        (stl(2, -1), None),
        (stl(1, head=b"solid x"), "stl"),
        (b"solid x\nfacet  normal 0 0 1", "stl"),
        (b"solid x\nfacets", None),
        (b"solid \0 facet normal", None),
        (TRIANGLE, "obj"),
        (b"\tv .5 0 0", "obj"),
        (b"# text\n v -1 0 0", "obj"),
        (b"#" * 5000 + b"\n" + TRIANGLE, "obj"),
        (b"#" * (1 << 20) + b"\n" + TRIANGLE, None),
        (b"vn 1 0 0\nv x", None),
        (b"\0" + TRIANGLE, None),
        (b"#" * 2048 + b"\0\n" + TRIANGLE, "obj"),
        (b"", None),
    ],
)
def test_content(data: bytes, format: str | None) -> None:
    assert sniff(data) == format


def test_the_suffix_of_an_output_is_that_of_the_input_where_it_has_uv() -> None:
    named = {".STL": ".glb", ".off": ".glb", ".obj": ".obj", ".PLY": ".PLY", ".none": ".none"}
    assert {suffix: output_suffix(suffix) for suffix in named} == named
