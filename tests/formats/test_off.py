"""OFF: points and polygons kept, files that lie refused."""

import pytest

from circparam.formats.io import encode, read_data
from tests.support.formats_tools import (
    OFF,
    assert_round_trip,
    layout_with_seams,
    refused,
    smooth_layout,
)


def test_off_keeps_points_and_polygons() -> None:
    """Into text and into PLY, which has doubles for points that need them."""
    off = read_data(OFF)
    assert off.format == "off"
    assert off.mesh.points[4].tolist() == [0.1, 0.30000000000000004, 1.0]
    assert off.mesh.polygons.tolist() == [0, 0, 1, 2]
    for format in ("obj", "ply"):
        assert_round_trip(off, layout_with_seams(off), format)
    quads = encode(off, smooth_layout(off), "obj").data.split(b"\nf ")[1]
    assert len(quads.split()) == 4


@pytest.mark.parametrize("header", [b"COFF", b"NOFF", b"OFF\n", b"\n OFF "])
def test_off_headers(header: bytes) -> None:
    data = header + b"\n3 1 0\n0 0 0 1 0 0 1\n1 0 0 1 0 0 1\n0 1 0 1 0 0 1\n3 0 1 2\n"
    assert read_data(data, format="off").mesh.faces.tolist() == [[0, 1, 2]]


OTHER = "not a text OFF file of three-dimensional points"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"6 3 0", b"6 4000000000 0", "and 4000000000 faces"),
        (b"6 3 0", b"4000000000 3 0", "promises 4000000000 vertices"),
        (b"6 3 0", b"x 3 0", "counts of vertices"),
        (b"6 3 0", b"-6 3 0", "promises -6"),
        (b"6 3 0", b"6 4 0", "and 4 faces, the file has 9 rows"),
        (b"3 0 1 4\n3 1 5 2\n", b"", "has 7 rows"),
        (b"3 0 1 4", b"3 0 1", "fewer corners"),
        (b"3 0 1 4", b"-3 0 1 4", "fewer corners"),
        (b"3 0 1 4", b"3 0 1 6", "names vertex 6: there are 6"),
        (b"3 0 1 4", b"3 0 -1 4", "names vertex -1"),
        (OFF[OFF.index(b"\n4 ") :], b"2 0 1\n" * 3, "no faces"),
        (b"1 0 0\n", b"1 0\n", "fewer than three"),
        (b"1 0 0\n", b"1 q 0\n", "malformed"),
        (b"1 0 0\n", b"1 nan 0\n", "NaN"),
        *((b"OFF #", b"%s #" % word, OTHER) for word in (b"nOFF", b"4OFF", b"4nOFF", b"ST4OFF")),
        *((b"OFF #", b"%s #" % word, OTHER) for word in (b"OFF\0", b"OOF", b"")),
    ],
)
def test_a_file_that_lies_is_refused_with_its_fault(old: bytes, new: bytes, says: str) -> None:
    assert old in OFF
    refused(OFF.replace(old, new), says, "off")
