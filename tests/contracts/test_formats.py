"""What every row of FORMATS promises."""

from pathlib import Path

import pytest

from circparam.errors import OptionError
from circparam.formats import FORMATS, default_output
from circparam.formats.io import encode, read_data, stored
from circparam.formats.table import takes_unshare, writable
from tests.support import format_contract as contract
from tests.support.formats_tools import smooth_layout

WRITABLE = writable()
NAMES = FORMATS.names()


def test_writable_rows_are_the_ones_with_a_place_for_uv() -> None:
    assert WRITABLE == ["obj", "ply", "gltf", "glb", "usda", "usdc", "usdz"]
    for row in FORMATS:
        assert (row.function.export is None) == (row.function.round_uv is None), row.name
        assert default_output(row.name) in WRITABLE
    assert default_output("arrays") == "glb"


def test_no_suffix_stands_for_two_formats() -> None:
    suffixes = [s for row in FORMATS for s in row.function.suffixes]
    assert len(set(suffixes)) == len(suffixes)
    assert all(s == s.lower() and s[0] == "." for s in suffixes)


@pytest.mark.parametrize("promise", contract.PROMISES)
@pytest.mark.parametrize("name", WRITABLE)
def test_a_row_keeps_its_promise(name: str, promise: str, tmp_path: Path) -> None:
    contract.PROMISES[promise](name, tmp_path)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in WRITABLE])
def test_no_place_for_uv(name: str) -> None:
    doc = contract.document()
    says = f"{name.upper()} has no place for uv: write obj, ply, gltf, glb, usda, usdc or usdz"
    with pytest.raises(OptionError, match=says):
        encode(doc, smooth_layout(doc), name)
    with pytest.raises(OptionError, match=says):
        stored(smooth_layout(doc), name)


@pytest.mark.parametrize("name", NAMES)
def test_unshare_changes_nothing_where_nothing_is_shared(name: str) -> None:
    assert takes_unshare(name) == (name in ("gltf", "glb"))
    if name in WRITABLE:
        doc = contract.document()
        data = encode(doc, smooth_layout(doc), name).data
        a, b = (read_data(data, unshare=unshare) for unshare in (False, True))
        assert a.mesh.faces.tolist() == b.mesh.faces.tolist()
