"""OBJ: read as an independent, naive reader reads it, and written back with every other byte kept."""

import codecs

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import OptionError
from circparam.formats.io import encode, read, read_data
from circparam.formats.memory import PlainDocument
from circparam.formats.polygons import triangulate
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    corners,
    corpus_files,
    layout_with_seams,
    smooth_layout,
)
from tests.support.obj_files import CUBE, line_ends, naive, without_uv


def test_groups_stand_in_where_no_material_is_named() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\ng one\nf 1 2 3\no two\nf 3 2 1\ng one\nf 2 3 1\n"
    document = read_data(data, format="obj")
    assert document.mesh.groups.tolist() == [0, 1, 0]
    assert document.group_names == ("one", "two")


def test_labels_for_grouping() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\no p\nf 3 2 1\nusemtl b\nf 1 2 3\no q\nf 2 3 1\n"
    document = read_data(data, format="obj")
    assert document.labels("primitive").tolist() == [0, 0, 1, 1]
    assert document.labels("mesh").tolist() == [0, 1, 1, 2]
    assert document.labels("scene").tolist() == [0, 0, 0, 0]
    with pytest.raises(OptionError, match="grouping"):
        document.labels("page")


@st.composite
def obj_files(draw: st.DrawFn) -> bytes:
    """OBJ files with everything that may stand in one."""
    newline = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    n, k = draw(st.integers(3, 9)), draw(st.integers(0, 4))
    number = st.sampled_from(["0", "1", "-2.5", "1e-3", "0.1", "3.", ".5", "+4", "1E+2"])
    noise = st.sampled_from(
        ["", "# vt f v", "o part", "g a b", "s 1", "usemtl m1", "usemtl m2", "mtllib a.mtl",
         "p 1", "l 1 2", "xyz 1/2/3", "   ", "vp 0 1", "\tg tab", "usemtl"]
    )  # fmt: skip
    lines = []
    for _ in range(n):
        extra = draw(st.sampled_from(["", " 1.0", " 0.5 0.5 0.5", "  # colour"]))
        lines.append("v " + " ".join(draw(number) for _ in range(3)) + extra)
        lines.append(draw(noise))
    for _ in range(k):
        lines.append("vt " + " ".join(draw(number) for _ in range(draw(st.integers(1, 3)))))
    lines.append("vn 0 0 1")
    for _ in range(draw(st.integers(1, 5))):
        lines.append(draw(noise))
        size = draw(st.integers(3, min(n, 6)))
        order = draw(st.permutations(range(n)))[:size]
        relative = draw(st.booleans())
        form = draw(st.sampled_from(["v", "v/", "v//", "v//n", *(["v/t", "v/t/n"] * (k > 0))]))
        words = []
        for v in order:
            t = draw(st.integers(1, k)) if k else 0
            word = form.replace("n", "1").replace("t", str(t - k - 1 if relative else t))
            words.append(word.replace("v", str(v - n if relative else v + 1)))
        gap = draw(st.sampled_from([" ", "  ", "\t", " \\" + newline + " "]))
        lines.append("f " + gap.join(words) + draw(st.sampled_from(["", " ", " # f 1 2 3"])))
    lines.append(draw(noise))
    return draw(st.sampled_from([b"", codecs.BOM_UTF8])) + newline.join(lines).encode()


@settings(max_examples=40)
@given(obj_files(), st.integers(0, 9))
def test_generated_files_come_back(data: bytes, seed: int) -> None:
    document = read_data(data, format="obj")
    points, polygons, uv = naive(data)
    np.testing.assert_array_equal(document.mesh.points, points)
    polys = document.polygons()
    assert polys.corners.tolist() == [k for p in polygons for k in p]
    read = document.uv()
    flat = [k for p in uv for k in p]
    if read is not None:
        for got, corner in zip(corners(read).reshape(-1, 2), polys.triangles.ravel(), strict=True):
            want = flat[corner]
            assert np.isnan(got).all() if want is None else tuple(got) == want
    else:
        assert not any(flat)
    for uvmap in (smooth_layout(document, seed), layout_with_seams(document, seed)):
        out = encode(document, uvmap, "obj")
        assert without_uv(out.data) == without_uv(data)
        assert line_ends(out.data) == line_ends(data)
        assert_round_trip(document, uvmap, "obj")
        twice = encode(read_data(out.data, format="obj"), uvmap, "obj")
        assert twice.data == out.data  # writing the same uv again changes nothing
    for format in ("ply", "glb"):
        assert_round_trip(document, layout_with_seams(document, seed), format)


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
    ("given", "written"),
    [
        # bounds of the parameters stand before them, and a normal keeps its place behind two slashes
        (b"surf 0 1 0 1 1/1/1 2//1 \\\n 3/1 2\nend\n", b"surf 0 1 0 1 1//1 2//1 \\\n 3 2\nend\n"),
        (b"l 1/1 2/1 3\nl 1 2\n", b"l 1 2 3\nl 1 2\n"),
        (b"l 1 2 3\n", b"l 1 2 3\n"),
    ],
)
def test_lines_and_control_points_of_surfaces_lose_their_vt(given: bytes, written: bytes) -> None:
    head = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1 2 3\n"
    document = read_data(head + given)
    out = encode(document, smooth_layout(document), "obj")
    assert out.data.endswith(b"\n" + written)
    said = [note for note in out.notes if "l and surf elements lost their vt" in note]
    assert bool(said) == (given != written)


POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.1, 1e-7]], float)


def document(groups=None, names: tuple[str, ...] = (), features: tuple[str, ...] = ()):
    """A quad, an edge that no triangle has, and a triangle."""
    corners = np.array([0, 1, 2, 3, 0, 1, 1, 4, 2])
    polys = triangulate(POINTS, corners, np.array([0, 4, 6, 9]))
    mesh = Mesh(POINTS, corners[polys.triangles], polygons=polys.labels, groups=groups)
    return PlainDocument(
        Source("x"), "off", mesh, features=features, group_names=names, polys=polys
    )


UV = np.array([[0.1, 0], [1, 0], [1, 1], [0, 1], [9, 9], [0.5, 1e-20]])
FACES = np.array([[0, 1, 2], [0, 2, 3], [1, 5, 2]])


def test_every_line() -> None:
    """Uv that no corner uses go, a polygon of two corners is no face, digits are the shortest."""
    out = encode(document(), UVMap(UV, FACES), "obj")
    assert out.data.decode().split("\n") == [
        "v 0.0 0.0 0.0", "v 1.0 0.0 0.0", "v 1.0 1.0 0.0", "v 0.0 1.0 0.0", "v 2.0 0.1 1e-07",
        "vt 0.1 0.0", "vt 1.0 0.0", "vt 1.0 1.0", "vt 0.0 1.0", "vt 0.5 1e-20",
        "f 1/1 2/2 3/3 4/4", "f 2/2 5/5 3/3", "",
    ]  # fmt: skip
    assert out.vertex_map.tolist() == [0, 1, 2, 3, 4]
    assert out.face_map.tolist() == [0, 1, 2]
    assert out.notes == []


def test_corners_without_uv() -> None:
    faces = FACES.copy()
    faces[:2] = -1
    data = encode(document(), UVMap(UV, faces), "obj").data
    assert data.endswith(b"vt 1.0 0.0\nvt 1.0 1.0\nvt 0.5 1e-20\nf 1 2 3 4\nf 2/1 5/3 3/2\n")


def test_groups_are_materials() -> None:
    doc = document(np.array([1, 1, 0]), ("", "two  words"), ("groups", "normals"))
    out = encode(doc, UVMap(UV, FACES), "obj")
    assert b"usemtl two_words\nf 1/1 2/2 3/3 4/4\n" in out.data
    assert b"usemtl group_0\nf 2/2 5/5 3/3\n" in out.data
    assert out.notes == ["not carried into OBJ: normals"]
    one = document(np.array([2, 2, 2]), ("a",))
    assert encode(one, UVMap(UV, FACES), "obj").data.count(b"usemtl group_2\n") == 1
