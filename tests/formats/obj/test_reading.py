"""Where lines, words and corners of an OBJ file are: against a naive reader, and bad files by their line."""

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.io import read_data
from circparam.formats.obj.reading import Scan
from circparam.formats.source import Source
from tests.support.formats_tools import refused


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v 0 0 0\n".encode("utf-16"), "text in UTF-16: save it as UTF-8"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4.*index 0"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4.*index 4"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "line 4.*index -4"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/2\n", "line 5.*index 2"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/0\n", "line 5.*index 0"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/-2\n", "index -2 .* the 1 vt"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", "index"),
        (b"v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2.*3 numbers"),
        (b"v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "line 2: 'x' is not a number$"),
        (b"v 0 0 0\nv 1,5 0 0\nv 0 1 0\nf 1 2 3\n", "line 2: '1,5' .*write decimal points"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1_0 0\nf 1 2 3\n", "line 3: '1_0' is not a number"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 a\n", "line 4.*'a'"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3/1/1/1\n", "line 4"),
        (
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 3\nf 3 1/1/1/1 2\n",
            "line 6.*more than v/vt/vn",
        ),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 nan\nf 1 2 3\n", "NaN"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 inf\nf 1 2 3\n", "infinite"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
        (b"v 0 0 0\nv 1 0 0\nf 1 2\n", "no faces"),
        (b"hello world\n", "not an OBJ mesh"),
        (b"v 0 0 0\n\0\0\0f 1 1 1", "binary"),
    ],
)
def test_bad_files_are_named_with_their_line(text: bytes, says: str) -> None:
    refused(text, says, "obj")


def test_libraries_are_named_once() -> None:
    s = Scan(b"mtllib a b.mtl\nmtllib c.mtl\nmtllib a b.mtl\nmtllib\nf 1\n", Source("x"))
    assert s.libraries() == ["a b.mtl", "c.mtl"]


def test_normals_are_unit_vectors_of_corners_and_of_faces_where_they_have_no_direction() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 2\nvn 0 3 4\nvn 0 0 0\nf 1//1 2//2 3//3\nf 1//2 3//2 2//2\n"
    normals = read_data(data).normals()
    up, lean = [0, 0, 1], [0, 0.6, 0.8]
    np.testing.assert_allclose(normals, [[up, lean, up], [lean] * 3], atol=1e-15)
    assert read_data(data.replace(b"f 1//1 2//2", b"f 1 2//2")).normals() is None


def test_a_vt_has_one_number_or_more() -> None:
    """The second is 0 where it is missing."""
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5\nvt 0.25 0.75 9\nf 1/1 2/2 3/1\n"
    uvmap = read_data(data).uv()
    assert uvmap.uv[uvmap.uv_faces].tolist() == [[[0.5, 0], [0.25, 0.75], [0.5, 0]]]
    with pytest.raises(InputError, match="line 4"):
        read_data(data.replace(b"vt 0.5", b"vt")).uv()
