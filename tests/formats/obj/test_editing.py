"""Uv put into the text of an OBJ file: every other byte is kept."""

import pytest

from circparam.formats.io import encode, read, read_data
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    corpus_files,
    layout_with_seams,
    smooth_layout,
)
from tests.support.obj_files import CUBE, without_uv


def test_new_vt_lines_stand_where_the_old_ones_stood() -> None:
    document = read_data(CUBE, format="obj")
    out = encode(document, smooth_layout(document), "obj").data
    before = out[: out.index(b"vt ")]
    assert before.endswith(b"v 0 1 1\n")
    plain = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n"
    document = read_data(plain, format="obj")
    out = encode(document, smooth_layout(document), "obj").data
    assert out.startswith(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nvt ")


def test_corners_without_uv_get_none() -> None:
    document = read_data(CUBE, format="obj")
    uvmap = smooth_layout(document)
    faces = uvmap.uv_faces.copy()
    faces[document.mesh.polygons == 1] = -1  # f v//vn
    faces[document.mesh.polygons == 3] = -1  # f v
    uvmap = UVMap(uvmap.uv, faces)
    out = encode(document, uvmap, "obj").data
    assert b"f 5//1 6//1 7//1 8//1\n" in out
    assert b"f 2 3 7 6\n" in out
    assert_round_trip(document, uvmap, "obj")


@pytest.mark.parametrize("path", corpus_files(".obj", most=1e6))
def test_real_files_keep_every_other_byte(path) -> None:
    document = read(path)
    for uvmap in (layout_with_seams(document), document.uv() or smooth_layout(document)):
        out = encode(document, uvmap, "obj")
        assert without_uv(out.data) == without_uv(path.read_bytes())
        assert_round_trip(document, uvmap, "obj")


@pytest.mark.parametrize(
    ("face", "expected"),
    [
        (b"f 1 2 3", b"f 1/1 2/2 3/3"),
        (b"f 1/ 2/ 3/", b"f 1/1 2/2 3/3"),
        (b"f 1// 2// 3//", b"f 1/1/ 2/2/ 3/3/"),
        (b"f 1/9/1 2/9/1 3/9/1", b"f 1/1/1 2/2/1 3/3/1"),
        (b"f 1//1 2//1 3//1", b"f 1/1/1 2/2/1 3/3/1"),
        (b"f\t-3/-1/-1  -2/9/1 3/9 # 1/2", b"f\t-3/1/-1  -2/2/1 3/3 # 1/2"),
    ],
)
def test_the_field_of_vt_in_every_form(face: bytes, expected: bytes) -> None:
    head = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n" + b"vt 0 0\n" * 9
    document = read_data(head + face + b"\n")
    out = encode(document, smooth_layout(document), "obj").data
    assert out.split(b"\n")[-2] == expected
    assert out.count(b"vt ") == 3


@pytest.mark.parametrize("newline", [b"\n", b"\r\n", b"\r"])
def test_new_lines_end_as_the_others_do(newline: bytes) -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".replace(b"\n", newline)
    out = encode(read_data(data), smooth_layout(read_data(data)), "obj").data
    assert out.count(newline) == 7
    assert out.replace(newline, b"").count(b"\n") == out.replace(newline, b"").count(b"\r") == 0


def test_line_elements_lose_their_vt() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1 2 3\nl 1/1 2/1 3\nl 1 2\n"
    out = encode(read_data(data), smooth_layout(read_data(data)), "obj")
    assert out.data.endswith(b"\nl 1 2 3\nl 1 2\n")
    assert any("l elements lost their vt" in note for note in out.notes)
    plain = read_data(data.replace(b"/1", b""))
    assert encode(plain, smooth_layout(plain), "obj").notes == []
