"""OBJ: read as an independent, naive reader reads it, and written back with every other byte kept."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read_data
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    corners,
    corpus_files,
    layout_with_seams,
    smooth_layout,
)

CUBE = b"""# a cube
mtllib cube.mtl
o cube
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1 0.5 0.5 0.5
v 1 0 1 0.5 0.25 1e-3
v 1 1 1
v 0 1 1
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
usemtl red
s off
f 1/1 4/2 3/3 2/1
f 5//1 6//1 7//1 8//1
usemtl blue
f -8/-3/-1 -7/-2/-1 -3/-1/-1 \\
  -4/-3/-1  # the front
f 2 3 7 6
l 1/1 2/2
p 1 2
"""


def naive(
    data: bytes,
) -> tuple[np.ndarray, list[list[int]], list[list[tuple[float, float] | None]]]:
    """Points, polygons, and the uv of their corners, one line after the other as a text."""
    v, vt, polygons, uv = [], [], [], []
    text = re.sub(rb"\\\r?\n", b" ", data).decode("latin-1")
    lines = [line.split("#")[0].split() for line in re.split(r"\r\n|\n|\r", text)]
    total = sum(1 for w in lines if w[:1] == ["vt"])
    for words in lines:
        if words[:1] == ["v"]:
            v.append([float(x) for x in words[1:4]])
        elif words[:1] == ["vt"]:
            vt.append((float(words[1]), float(words[2]) if len(words) > 2 else 0.0))
        elif words[:1] == ["f"]:
            parts = [w.split("/") for w in words[1:]]
            polygons.append([int(p[0]) - 1 if int(p[0]) > 0 else len(v) + int(p[0]) for p in parts])
            at = [int(p[1]) if len(p) > 1 and p[1] else 0 for p in parts]
            uv.append([None if k == 0 else k - 1 if k > 0 else len(vt) + k for k in at])
    assert len(vt) == total
    return np.array(v), polygons, [[None if k is None else vt[k] for k in row] for row in uv]


def without_uv(data: bytes) -> bytes:
    """A text without vt lines and the vt field of f and l, all other bytes kept."""
    lines = re.findall(rb"(?:\\\r\n|\\\n|\\\r(?!\n)|[^\r\n])*(?:\r\n|\n|\r|$)", data)
    out = []
    for line in lines:
        if re.match(rb"[ \t]*vt[ \t]", line):
            continue
        if re.match(rb"[ \t]*[fl][ \t]", line):
            body, mark, comment = line.partition(b"#")
            body = re.sub(rb"([-+]?\d+)/[-+]?\d*/([-+]?\d+)", rb"\1//\2", body)
            body = re.sub(rb"([-+]?\d+)/[-+]?\d*(?![\d/])", rb"\1", body)
            line = body + mark + comment
        out.append(line)
    return b"".join(out)


def test_a_cube_reads_as_the_naive_reader_reads_it() -> None:
    document = read_data(CUBE, format="obj")
    points, polygons, uv = naive(CUBE)
    np.testing.assert_array_equal(document.mesh.points, points)
    assert document.polygons().corners.tolist() == [k for p in polygons for k in p]
    read = document.uv()
    assert read is not None
    triangles = document.polygons().triangles
    flat = [k for p in uv for k in p]
    for face, corner in zip(corners(read).reshape(-1, 2), triangles.ravel(), strict=True):
        expected = flat[corner]
        assert np.isnan(face).all() if expected is None else tuple(face) == expected
    assert document.group_names == ("red", "blue")
    assert document.mesh.groups is not None
    assert document.mesh.groups.tolist() == [0] * 4 + [1] * 4
    assert document.scan.libraries() == ["cube.mtl"]  # type: ignore[attr-defined]


@pytest.mark.parametrize("newline", [b"\n", b"\r\n"])
@pytest.mark.parametrize("tail", [b"", b"# no line end"])
def test_every_other_byte_is_kept(newline: bytes, tail: bytes) -> None:
    data = CUBE.replace(b"\n", newline) + tail + b" caf\xe9 \xff\xfe"[: 8 * bool(tail)]
    document = read_data(data, format="obj")
    uvmap = smooth_layout(document)
    out = encode(document, uvmap, "obj")
    assert without_uv(out.data) == without_uv(data)
    assert out.data.count(newline + b"vt ") == 8
    assert any("l elements" in note for note in out.notes)
    assert_round_trip(document, uvmap, "obj")


def test_old_mac_line_ends() -> None:
    data = CUBE.replace(b"\\\n", b" ").replace(b"\n", b"\r")
    document = read_data(data, format="obj")
    out = encode(document, smooth_layout(document), "obj")
    assert without_uv(out.data) == without_uv(data)


def test_new_vt_lines_stand_where_the_old_ones_stood() -> None:
    document = read_data(CUBE, format="obj")
    out = encode(document, smooth_layout(document), "obj").data
    before = out[: out.index(b"vt ")]
    assert before.endswith(b"v 0 1 1\n")
    plain = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n"
    document = read_data(plain, format="obj")
    out = encode(document, smooth_layout(document), "obj").data
    assert out.startswith(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nvt ")


def test_the_shortest_digits_read_back_to_the_same_number() -> None:
    document = read_data(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", format="obj")
    uvmap = UVMap(np.array([[0.1, 1 / 3], [1e-9, 0.5], [-0.0, 2**-60]]), np.array([[0, 1, 2]]))
    out = encode(document, uvmap, "obj").data
    assert b"vt 0.1 0.3333333333333333\n" in out
    again = read_data(out).uv()
    assert again is not None
    np.testing.assert_array_equal(again.uv, uvmap.uv)


def test_a_seam_through_a_polygon_is_refused_and_named() -> None:
    document = read_data(CUBE, format="obj")
    m = len(document.mesh.faces)
    uvmap = UVMap(np.random.default_rng(0).random((3 * m, 2)), np.arange(3 * m).reshape(-1, 3))
    with pytest.raises(NoResultError, match="polygon 0 got two uv"):
        encode(document, uvmap, "obj")


def test_two_uv_with_the_same_numbers_are_no_seam() -> None:
    document = read_data(CUBE, format="obj")
    smooth = smooth_layout(document)
    m = len(document.mesh.faces)
    unrolled = UVMap(smooth.uv[smooth.uv_faces].reshape(-1, 2), np.arange(3 * m).reshape(-1, 3))
    assert_round_trip(document, unrolled, "obj")


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


def test_one_uv_set_only() -> None:
    document = read_data(CUBE, format="obj")
    uvmap = smooth_layout(document)
    with pytest.raises(OptionError, match="one uv set"):
        encode(document, uvmap, "obj", options=WriteOptions(uv_set=1))
    with pytest.raises(OptionError, match="overwrite-uv"):
        encode(document, uvmap, "obj", options=WriteOptions(uv_set=0))
    assert "replaced" in encode(document, uvmap, "obj").notes[0]


def test_groups_stand_in_where_no_material_is_named() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\ng one\nf 1 2 3\no two\nf 3 2 1\ng one\nf 2 3 1\n"
    document = read_data(data, format="obj")
    assert document.mesh.groups is not None
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


def test_negative_indices_count_back_from_where_they_stand() -> None:
    part = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nf -3/-2 -2/-1 -1/-2\n"
    document = read_data(part + part, format="obj")
    assert document.mesh.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    uvmap = document.uv()
    assert uvmap is not None
    assert uvmap.uv_faces.tolist() == [[0, 1, 0], [2, 3, 2]]
    assert_round_trip(document, layout_with_seams(document), "obj")


def test_short_faces_are_kept_and_give_no_triangle() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1/1 2/1 3/1\nf 3\nvt 0 0\n"
    document = read_data(data, format="obj")
    assert document.mesh.faces.tolist() == [[0, 1, 2]]
    out = encode(document, smooth_layout(document), "obj").data
    assert without_uv(out) == without_uv(data)


def test_a_concave_polygon_is_cut_inside() -> None:
    """An arrowhead whose first corner sees not all others: the fan starts elsewhere, areas add up."""
    arrow = b"v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nf 2 3 4 1\n"
    mesh = read_data(arrow, format="obj").mesh
    p = mesh.points[mesh.faces]
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] / 2
    assert (area < 0).all() or (area > 0).all()
    assert abs(area.sum()) == pytest.approx(0.5)


def test_a_comb_needs_ear_clipping() -> None:
    """A polygon that no fan fits: triangles still agree with it and tile it."""
    comb = [
        (0, 0),
        (5, 0),
        (5, 2),
        (4, 2),
        (4, 1),
        (3, 1),
        (3, 2),
        (2, 2),
        (2, 1),
        (1, 1),
        (1, 2),
        (0, 2),
    ]
    text = "".join(f"v {x} {y} 0\n" for x, y in comb) + "f " + " ".join(map(str, range(1, 13)))
    mesh = read_data(text.encode(), format="obj").mesh
    p = mesh.points[mesh.faces]
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] / 2
    assert len(mesh.faces) == 10
    assert (area > 0).all()
    assert area.sum() == pytest.approx(8.0)


@st.composite
def obj_files(draw: st.DrawFn) -> bytes:
    """OBJ files with everything that may stand in one."""
    newline = draw(st.sampled_from(["\n", "\r\n"]))
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
        form = draw(st.sampled_from(["v", "v/t", "v//n", "v/t/n"] if k else ["v", "v//n"]))
        words = []
        for v in order:
            t = draw(st.integers(1, k)) if k else 0
            word = form.replace("n", "1").replace("t", str(t - k - 1 if relative else t))
            words.append(word.replace("v", str(v - n if relative else v + 1)))
        gap = draw(st.sampled_from([" ", "  ", "\t", " \\" + newline + " "]))
        lines.append("f " + gap.join(words) + draw(st.sampled_from(["", " ", " # f 1 2 3"])))
    lines.append(draw(noise))
    return newline.join(line for line in lines).encode()


@settings(max_examples=80)
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
        assert_round_trip(document, uvmap, "obj")
        twice = encode(read_data(out.data, format="obj"), uvmap, "obj")
        assert twice.data == out.data  # writing the same uv again changes nothing
    for format in ("ply", "glb"):
        assert_round_trip(document, layout_with_seams(document, seed), format)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4.*index 0"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4.*index 4"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "line 4.*index -4"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/2\n", "line 5.*index 2"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/0\n", "line 5.*index 0"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", "index"),
        (b"v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2.*3 numbers"),
        (b"v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "line 2.*number"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 a\n", "line 4.*'a'"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3/1/1/1\n", "line 4"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 nan\nf 1 2 3\n", "NaN"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 inf\nf 1 2 3\n", "infinite"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
        (b"v 0 0 0\nv 1 0 0\nf 1 2\n", "no faces"),
        (b"hello world\n", "no OBJ mesh"),
        (b"v 0 0 0\n\0\0\0f 1 1 1", "binary"),
    ],
)
def test_bad_files_are_named_with_their_line(text: bytes, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        read_data(text, format="obj")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("path", corpus_files(".obj"))
def test_real_files_keep_every_other_byte(path) -> None:
    from circparam.formats.io import read

    data = path.read_bytes()
    document = read(path)
    uvmap = layout_with_seams(document)
    out = encode(document, uvmap, "obj")

    def others(text: bytes) -> list[bytes]:
        return [x for x in text.split(b"\n") if x[:2] not in (b"vt", b"f ")]

    def faces(text: bytes) -> bytes:
        found = b"\n".join(x for x in text.split(b"\n") if x[:2] == b"f ")
        return re.sub(rb"/\d*(/?)", rb"\1", found)  # v/vt/vn and v//vn become v/vn

    assert others(out.data) == others(data)
    assert faces(out.data) == faces(data)
    again = read_data(out.data, format="obj")
    np.testing.assert_array_equal(again.mesh.points, document.mesh.points)
    np.testing.assert_array_equal(again.mesh.faces, document.mesh.faces)
    np.testing.assert_array_equal(corners(again.uv()), corners(uvmap))
    own = document.uv()
    if own is not None:
        back = read_data(encode(document, own, "obj").data, format="obj").uv()
        np.testing.assert_array_equal(corners(back), corners(own))


@pytest.mark.parametrize("path", corpus_files(".obj"))
def test_real_files_read_as_trimesh_reads_them(path) -> None:
    """trimesh is the independent reader: the same triangles at the same places (n-gons may differ)."""
    import trimesh

    from circparam.formats.io import read

    document = read(path)
    if document.mesh.polygons is not None:
        pytest.skip("trimesh cuts polygons by another rule")
    theirs = trimesh.load(
        path, process=False, maintain_order=True, force="mesh", skip_materials=True
    )
    ours = document.mesh.points[document.mesh.faces].reshape(-1, 9)
    other = np.asarray(theirs.vertices)[theirs.faces].reshape(-1, 9)
    assert ours.shape == other.shape
    order, there = np.lexsort(ours.T), np.lexsort(other.T)  # trimesh groups faces by material
    np.testing.assert_array_equal(ours[order], other[there])
