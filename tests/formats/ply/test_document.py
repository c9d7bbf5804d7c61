"""PLY: every element and property kept in all three encodings, compared by an independent reader."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read, read_data, stored
from circparam.formats.memory import PlainDocument, from_arrays
from circparam.formats.polygons import triangulate
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    corpus_files,
    grid,
    layout_with_seams,
    refused,
    smooth_layout,
)
from tests.support.ply_files import (
    CODES,
    INDEX,
    ORDERS,
    THREE,
    UV_NAMES,
    UV_PROPERTIES,
    XYZ,
    build,
    naive,
    plain,
    sample,
    strip_file,
    triangles_file,
    triangles_of,
)


def test_uv_kept_in_doubles_where_the_file_has_doubles() -> None:
    data = sample("binary_little_endian", uv="vertex").replace(
        b"property float s", b"property float q"
    )
    text = sample("ascii", uv="vertex").replace(b"float s\n", b"double s\n")
    document = read_data(text.replace(b"float t\n", b"double t\n"))
    uvmap = smooth_layout(document)
    np.testing.assert_array_equal(stored(uvmap, "ply", document).uv, uvmap.uv)
    assert_round_trip(document, uvmap, "ply")
    assert read_data(data).uv_sets == ()  # q and t are no pair


@st.composite
def ply_files(draw: st.DrawFn) -> bytes:
    """PLY files with random properties, encodings and polygons."""
    n = draw(st.integers(3, 9))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    kinds = st.sampled_from(list(CODES))
    scalars = [f"{draw(kinds)} p{k}" for k in range(draw(st.integers(0, 3)))]
    at = draw(st.integers(0, len(scalars)))
    real = draw(st.sampled_from(["float", "double"]))
    vertex = [*scalars[:at], f"{real} x", f"{real} y", f"{real} z", *scalars[at:]]
    rows = [
        [
            rng.integers(0, 9) + 0.5 if p.split()[1] in "xyz" else int(rng.integers(0, 99))
            for p in vertex
        ]
        for _ in range(n)
    ]
    counter = draw(st.sampled_from(["uchar", "int", "ushort"]))
    index = f"list {counter} {draw(st.sampled_from(['int', 'uchar', 'uint']))} vertex_indices"
    face = [index]
    if draw(st.booleans()):
        face.insert(draw(st.integers(0, 1)), f"{draw(kinds)} label")
    if draw(st.booleans()):
        face.insert(draw(st.integers(0, len(face))), "list uchar short more")
    count = draw(st.integers(1, 6))
    sizes = (
        [3] * count
        if draw(st.booleans())
        else [draw(st.integers(1, min(n, 5))) for _ in range(count)]
    )
    sizes[0] = 3
    cells = [
        [
            rng.permutation(n)[:size].tolist() if p.endswith("indices")
            else rng.integers(0, 9, size % 3).tolist() if p.startswith("list")
            else size
            for p in face
        ]
        for size in sizes
    ]  # fmt: skip
    uv = draw(st.sampled_from(["", "vertex", "face"]))
    if uv == "vertex":
        vertex += [f"float {name}" for name in draw(st.sampled_from(UV_NAMES))]
        rows = [[*row, 0.5, 0.25] for row in rows]
    if uv == "face":
        face.append("list uchar float texcoord")
        cells = [[*row, [0.5] * 2 * size] for row, size in zip(cells, sizes, strict=True)]
    elements: dict = {"vertex": (vertex, rows), "face": (face, cells)}
    if draw(st.booleans()):
        elements["other"] = (["list uchar double w", "char c"], [[[0.5] * k, k] for k in range(3)])
    if draw(st.booleans()):
        elements = dict(reversed(list(elements.items())))  # faces before vertices
    return build(draw(st.sampled_from(list(ORDERS))), elements)


@settings(max_examples=60)
@given(
    ply_files(),
    st.integers(0, 9),
    st.sampled_from(["vertex", "face", None]),
    st.sampled_from([b"\n", b"\r\n", b"\r"]),
)
def test_generated_files_come_back(data: bytes, seed: int, mode: str | None, end: bytes) -> None:
    """With the line ends of a text, with what lies behind the elements of a binary file."""
    behind = b"" if b"format ascii" in data else b"\0behind"
    document = read_data(data + behind if behind else data.replace(b"\n", end))
    old = naive(data)
    names = next((pair for pair in UV_NAMES if {*pair} <= {*old["vertex"][0]}), UV_NAMES[0])
    for uvmap in (smooth_layout(document, seed), layout_with_seams(document, seed)):
        out = encode(document, uvmap, "ply", options=WriteOptions(ply_uv=mode))
        assert out.data.endswith(behind)
        text = out.data.removesuffix(behind)
        if not behind:
            assert b"\n" not in text.replace(end, b"")
            text = text.replace(end, b"\n")
        new = naive(text)
        n, rows = len(old["vertex"]), plain(old["vertex"])
        assert plain(new["vertex"]) == [rows[k] for k in out.vertex_map]
        assert ("texcoord" in new["face"][0]) == (mode == "face")
        assert ({*UV_PROPERTIES} & {*new["vertex"][0]}) == (set() if mode == "face" else {*names})
        assert (len(out.vertex_map) > n) <= (mode != "face")
        assert b"comment made by a test\nobj_info kept\n" in text
        assert new.get("other") == old.get("other")
        for a, b in zip(plain(old["face"]), plain(new["face"]), strict=True):
            assert [out.vertex_map[k] for k in b.pop("vertex_indices")] == a.pop("vertex_indices")
            assert a == b
        assert_round_trip(document, uvmap, "ply", WriteOptions(ply_uv=mode))


@pytest.mark.parametrize("path", corpus_files(".ply", most=1e6))
@pytest.mark.parametrize("seams", [False, True])
def test_real_files_keep_every_property(path, seams: bool) -> None:
    document = read(path)
    uvmap = layout_with_seams(document, parts=8) if seams else smooth_layout(document)
    again = assert_round_trip(document, uvmap, "ply")
    old, new = document.layout, again.layout
    assert [e.name for e in new.elements] == [e.name for e in old.elements]
    out = encode(document, uvmap, "ply")
    for e in old.elements:
        other = new.element(e.name)
        rows = out.vertex_map if e.name == "vertex" else slice(None)
        for p in e.properties:
            if p.name in ("texcoord", "vertex_indices"):
                continue
            assert other.find(p.name).type == p.type
            np.testing.assert_array_equal(new.scalar(other, p.name), old.scalar(e, p.name)[rows])


def test_a_face_whose_list_does_not_fit_has_no_uv() -> None:
    """Lists too short, too long, empty and of odd length; those behind them still stand where they do."""
    lists = [[0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.5, 0.5], [], [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3]]
    lists += [[1.0, 0.0, 0.0, 1.0, 0.25, 0.75]]
    face = [INDEX, "list uchar double texcoord"], [[[0, 1, 2], uv] for uv in lists]
    uvmap = read_data(build("ascii", {"vertex": (XYZ, THREE), "face": face})).uv()
    assert (uvmap.uv_faces >= 0).all(1).tolist() == [True, False, False, False, True]
    assert (uvmap.uv_faces[1:4] == -1).all()
    assert uvmap.uv[uvmap.uv_faces[0]].tolist() == [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]
    assert uvmap.uv[uvmap.uv_faces[4]].tolist() == [[1, 0], [0, 1], [0.25, 0.75]]


@settings(max_examples=80)
@given(
    st.lists(st.lists(st.integers(-1, 11), min_size=1, max_size=14), min_size=1, max_size=3),
    st.integers(0, 5),
)
def test_any_strips_come_back(rows: list[list[int]], seed: int) -> None:
    expected = [t for row in rows for t in triangles_of(row)]
    data = strip_file("binary_little_endian", rows)
    if not expected:
        refused(data, "no faces")
        return
    document = read_data(data)
    assert document.mesh.faces.tolist() == expected
    assert_round_trip(document, layout_with_seams(document, seed), "ply")


@pytest.mark.parametrize("n", [254, 255, 256])
def test_the_last_index_of_a_type_is_used(n: int) -> None:
    """n + 1 vertices after the split: index 255 fits a uchar, 256 does not."""
    points = [[k, k * k % 17, 0] for k in range(n)]
    faces, index = [[0, 1, 2], [0, 2, n - 1]], "list uchar uchar vertex_indices"
    document = read_data(triangles_file("binary_little_endian", points, faces, index))
    uvmap = UVMap(np.random.default_rng(0).random((5, 2)), np.array([[0, 1, 2], [4, 2, 3]]))
    out = encode(document, uvmap, "ply", options=WriteOptions(ply_uv="vertex")).data
    assert (b"list uchar int" in out) == (n + 1 > 256)
    assert naive(out)["face"][1]["vertex_indices"] == [n, 2, n - 1]


def fan(n: int) -> PlainDocument:
    """One polygon of n corners."""
    a = 2 * np.pi * np.arange(n) / n
    points = np.stack([np.cos(a), np.sin(a), 0 * a], 1).astype("f4").astype(float)
    polys = triangulate(points, np.arange(n), np.array([0, n]))
    mesh = Mesh(points, polys.triangles, polygons=polys.labels)
    return PlainDocument(Source("x"), "off", mesh, polys=polys)


@pytest.mark.parametrize("again", [False, True])
def test_other_programs_read_the_default(tmp_path: Path, again: bool) -> None:
    """meshio and trimesh find the uv of every corner, in a new file and in one that is written back; points
    that single precision holds are stored in it."""
    doc = from_arrays(*grid(4))
    if again:
        doc = read_data(encode(doc, smooth_layout(doc), "ply").data)
    expected = layout_with_seams(doc)
    path = tmp_path / "o.ply"
    path.write_bytes(encode(doc, expected, "ply").data)
    assert b"property float x" in path.read_bytes()
    corners = expected.uv.astype("f4")[expected.uv_faces]
    loaded = trimesh.load(path, process=False)
    np.testing.assert_array_equal(loaded.visual.uv[loaded.faces].astype("f4"), corners)
    meshio = pytest.importorskip("meshio")
    found = meshio.read(path)
    uv = np.stack([found.point_data["s"], found.point_data["t"]], 1)
    np.testing.assert_array_equal(uv[found.cells_dict["triangle"]], corners)


@pytest.mark.parametrize(("place", "last"), [("vertex", 255), ("face", 127)])
def test_list_lengths_outgrow_a_byte(place: str, last: int) -> None:
    """A byte counts 255 corners; of uv it counts pairs, so 127."""
    for n, kind in ((last, b"list uchar"), (last + 1, b"list int")):
        doc = fan(n)
        uvmap = UVMap(np.random.default_rng(0).random((n, 2)), doc.mesh.faces)
        data = encode(doc, uvmap, "ply", options=WriteOptions(ply_uv=place)).data
        assert kind in data
        rows = naive(data)
        assert rows["face"][0]["vertex_indices"] == list(range(n))
        if place == "face":
            got = np.array(rows["face"][0]["texcoord"]).reshape(-1, 2)
            np.testing.assert_array_equal(got, uvmap.uv.astype("f4"))
        again = read_data(data).uv()
        assert len(again.uv) == n
