"""PLY: every element and property kept in all three encodings, compared by an independent reader."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import InputError, OptionError
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read, read_data, stored
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    corners,
    corpus_files,
    layout_with_seams,
    smooth_layout,
)

CODES = {
    "char": "b",
    "uchar": "B",
    "short": "h",
    "ushort": "H",
    "int": "i",
    "uint": "I",
    "float": "f",
    "double": "d",
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def naive(data: bytes) -> dict[str, list[dict[str, object]]]:
    """Every element as a list of rows {property: value}, read value by value."""
    head, _, body = data.partition(b"end_header\n")
    elements: list[tuple[str, int, list[list[str]]]] = []
    order = ""
    for line in head.decode().split("\n"):
        words = line.split()
        if words[:1] == ["format"]:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    tokens = iter(body.split()) if not order else None
    at = 0

    def value(kind: str) -> object:
        nonlocal at
        if tokens is not None:
            word = next(tokens)
            return float(word) if kind in ("float", "double") else int(word)
        (out,) = struct.unpack_from(order + CODES[kind], body, at)
        at += struct.calcsize(order + CODES[kind])
        return out

    result: dict[str, list[dict[str, object]]] = {}
    for name, count, properties in elements:
        rows = result[name] = []
        for _ in range(count):
            row: dict[str, object] = {}
            for p in properties:
                if p[0] == "list":
                    row[p[3]] = [value(p[2]) for _ in range(int(value(p[1])))]  # type: ignore[call-overload]
                else:
                    row[p[1]] = value(p[0])
            rows.append(row)
    if tokens is None:
        assert at == len(body)
    return result


def build(encoding: str, elements: dict[str, tuple[list[str], list[list[object]]]]) -> bytes:
    """A PLY file of elements {name: (property lines, rows)}; lists are lists."""
    order = ORDERS[encoding]
    lines = ["ply", f"format {encoding} 1.0", "comment made by a test", "obj_info kept"]
    body: list[bytes] = []
    for name, (properties, rows) in elements.items():
        lines += [f"element {name} {len(rows)}", *(f"property {p}" for p in properties)]
        for row in rows:
            words: list[tuple[str, object]] = []
            for p, cell in zip(properties, row, strict=True):
                kinds = p.split()
                if kinds[0] == "list":
                    words += [(kinds[1], len(cell))]  # type: ignore[arg-type]
                    words += [(kinds[2], x) for x in cell]  # type: ignore[attr-defined]
                else:
                    words.append((kinds[0], cell))
            if order:
                body += [struct.pack(order + CODES[kind], x) for kind, x in words]
            else:
                body.append(" ".join(str(x) for _, x in words).encode() + b"\n")
    return "\n".join([*lines, "end_header", ""]).encode() + b"".join(body)


def sample(encoding: str, kind: str = "float", uv: str = "") -> bytes:
    """A quad, a pentagon and triangles with colours, a custom list, materials and edges."""
    rng = np.random.default_rng(5)
    xy = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2.5, 0.5), (2, 1)]
    faces = [[0, 1, 2, 3], [1, 4, 5, 6, 2], [3, 2, 6], [0, 3, 1]]
    vertex = [f"{kind} x", f"{kind} y", f"{kind} z", "uchar red", "short weight"]
    rows: list[list[object]] = [[x, y, 0.25 * k, 10 + k, -k] for k, (x, y) in enumerate(xy)]
    face = [
        "uchar material",
        "list uchar int vertex_indices",
        "list uchar float extra",
        "double area",
    ]
    cells: list[list[object]] = [[k, f, [0.5] * k, 1 / (k + 3)] for k, f in enumerate(faces)]
    if uv == "vertex":
        vertex.insert(3, "float s")
        vertex.append("float t")
        rows = [[*r[:3], k / 8, *r[3:], k / 16] for k, r in enumerate(rows)]
    if uv == "face":
        face.insert(2, "list uchar float texcoord")
        cells = [
            [*r[:2], rng.random(2 * len(f)).astype("f4").tolist(), *r[2:]]
            for r, f in zip(cells, faces, strict=True)
        ]
    return build(
        encoding,
        {
            "vertex": (vertex, rows),
            "face": (face, cells),
            "edge": (["int vertex1", "int vertex2"], [[0, 1], [2, 3]]),
            "material": (["double shine", "list int uchar name"], [[0.1, [65, 66]], [0.2, []]]),
        },
    )


def plain(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    """Rows without their uv."""
    return [{k: v for k, v in row.items() if k not in ("s", "t", "texcoord")} for row in rows]


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize("uv", ["", "vertex", "face"])
@pytest.mark.parametrize("mode", ["vertex", "face", None])
@pytest.mark.parametrize("seams", [False, True])
def test_everything_but_uv_is_kept(encoding: str, uv: str, mode: str | None, seams: bool) -> None:
    data = sample(encoding, uv=uv)
    document = read_data(data)
    assert document.uv_sets == ((0,) if uv else ())
    uvmap = layout_with_seams(document) if seams else smooth_layout(document)
    out = encode(document, uvmap, "ply", options=WriteOptions(ply_uv=mode))
    old, new = naive(data), naive(out.data)
    at_faces = mode == "face" or (mode is None and seams)
    assert ("texcoord" in new["face"][0]) == at_faces
    assert ("s" in new["vertex"][0]) != at_faces
    n = len(old["vertex"])
    assert plain(new["vertex"])[:n] == plain(old["vertex"])
    duplicates = plain(new["vertex"])[n:]
    assert duplicates == [plain(old["vertex"])[k] for k in out.vertex_map[n:]]
    assert bool(duplicates) == (seams and not at_faces)
    for a, b in zip(plain(old["face"]), plain(new["face"]), strict=True):
        assert [out.vertex_map[k] for k in b.pop("vertex_indices")] == a.pop("vertex_indices")  # type: ignore[attr-defined]
        assert a == b
    assert {k: v for k, v in new.items() if k not in ("vertex", "face")} == {
        k: v for k, v in old.items() if k not in ("vertex", "face")
    }
    assert b"comment made by a test\nobj_info kept\n" in out.data
    assert_round_trip(document, uvmap, "ply", WriteOptions(ply_uv=mode))


@pytest.mark.parametrize("encoding", ORDERS)
def test_the_uv_of_the_file_is_read(encoding: str) -> None:
    at_vertices = read_data(sample(encoding, uv="vertex")).uv()
    assert at_vertices is not None
    np.testing.assert_array_equal(
        at_vertices.uv, np.stack([np.arange(7) / 8, np.arange(7) / 16], 1)
    )
    document = read_data(sample(encoding, uv="face"))
    at_faces = document.uv()
    assert at_faces is not None
    wanted = np.concatenate([r["texcoord"] for r in naive(sample(encoding, uv="face"))["face"]])  # type: ignore[misc]
    got = corners(at_faces).reshape(-1, 2)
    np.testing.assert_array_equal(got, wanted.reshape(-1, 2)[document.polygons().triangles.ravel()])


@pytest.mark.parametrize("encoding", ORDERS)
def test_doubles_stay_doubles(encoding: str) -> None:
    data = sample(encoding, kind="double")
    document = read_data(data)
    out = encode(document, smooth_layout(document), "ply").data
    assert out.count(b"property double") == data.count(b"property double") == 5
    assert document.mesh.points.dtype == np.float64


def test_uv_kept_in_doubles_where_the_file_has_doubles() -> None:
    data = sample("binary_little_endian", uv="vertex").replace(
        b"property float s", b"property float q"
    )
    header, _, body = sample("ascii", uv="vertex").partition(b"end_header\n")
    text = (
        header.replace(b"float s", b"double s").replace(b"float t", b"double t")
        + b"end_header\n"
        + body
    )
    document = read_data(text)
    uvmap = smooth_layout(document)
    np.testing.assert_array_equal(stored(uvmap, "ply", document).uv, uvmap.uv)
    assert_round_trip(document, uvmap, "ply")
    assert read_data(data).uv_sets == ()  # q and t are no pair


def test_names_of_the_uv_are_kept() -> None:
    data = (
        sample("ascii", uv="vertex")
        .replace(b"float s\n", b"float texture_u\n")
        .replace(b"float t\n", b"float texture_v\n")
    )
    document = read_data(data)
    assert document.uv_sets == (0,)
    out = encode(document, smooth_layout(document), "ply").data
    assert b"property float texture_u\nproperty float texture_v\n" in out
    assert b"property float s\n" not in out


def test_rows_of_mixed_length_on_odd_lines() -> None:
    """ascii values may stand on lines as they like."""
    data = sample("ascii")
    head, mark, body = data.partition(b"end_header\n")
    flat = head + mark + b" ".join(body.split())
    a, b = read_data(data), read_data(flat)
    np.testing.assert_array_equal(a.mesh.points, b.mesh.points)
    np.testing.assert_array_equal(a.mesh.faces, b.mesh.faces)
    out = encode(b, layout_with_seams(b), "ply", options=WriteOptions(ply_uv="vertex"))
    assert plain(naive(out.data)["material"]) == naive(data)["material"]


def strip_file(encoding: str, strips: list[list[int]]) -> bytes:
    points: list[list[object]] = [[i % 3, i // 3, (i * i) % 5] for i in range(12)]
    return build(
        encoding,
        {
            "vertex": (["float x", "float y", "float z"], points),
            "tristrips": (["list int int vertex_indices"], [[s] for s in strips]),
        },
    )


def triangles_of(strip: list[int]) -> list[list[int]]:
    """Triangles of a strip, one after the other."""
    out, run = [], []
    for v in strip:
        run = [] if v < 0 else [*run, v]
        if len(run) >= 3:
            a, b, c = run[-3:]
            if len({a, b, c}) == 3:
                out.append([a, b, c] if len(run) % 2 else [b, a, c])
    return out


@pytest.mark.parametrize("encoding", ORDERS)
def test_strips(encoding: str) -> None:
    rows = [[0, 3, 1, 4, 2, 5, -1, 3, 6, 4, 7, 7, 5, 5, 8], [6, 9, 7, 10]]
    document = read_data(strip_file(encoding, rows))
    assert document.mesh.faces.tolist() == [t for row in rows for t in triangles_of(row)]
    for uvmap in (smooth_layout(document), layout_with_seams(document)):
        assert_round_trip(document, uvmap, "ply")
    out = encode(document, smooth_layout(document), "ply").data
    assert [r["vertex_indices"] for r in naive(out)["tristrips"]] == rows
    with pytest.raises(OptionError, match="tristrips"):
        encode(document, smooth_layout(document), "ply", options=WriteOptions(ply_uv="face"))


@settings(max_examples=80)
@given(
    st.lists(st.lists(st.integers(-1, 11), min_size=1, max_size=14), min_size=1, max_size=3),
    st.integers(0, 5),
)
def test_any_strips_come_back(rows: list[list[int]], seed: int) -> None:
    wanted = [t for row in rows for t in triangles_of(row)]
    data = strip_file("binary_little_endian", rows)
    if not wanted:
        with pytest.raises(InputError, match="no faces"):
            read_data(data)
        return
    document = read_data(data)
    assert document.mesh.faces.tolist() == wanted
    assert_round_trip(document, layout_with_seams(document, seed), "ply")


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
    elements: dict = {"vertex": (vertex, rows), "face": (face, cells)}
    if draw(st.booleans()):
        elements["other"] = (["list uchar double w", "char c"], [[[0.5] * k, k] for k in range(3)])
    if draw(st.booleans()):
        elements = dict(reversed(list(elements.items())))  # faces before vertices
    return build(draw(st.sampled_from(list(ORDERS))), elements)


@settings(max_examples=80)
@given(ply_files(), st.integers(0, 9), st.sampled_from(["vertex", "face", None]))
def test_generated_files_come_back(data: bytes, seed: int, mode: str | None) -> None:
    document = read_data(data)
    for uvmap in (smooth_layout(document, seed), layout_with_seams(document, seed)):
        out = encode(document, uvmap, "ply", options=WriteOptions(ply_uv=mode))
        old, new = naive(data), naive(out.data)
        assert plain(new["vertex"])[: len(old["vertex"])] == plain(old["vertex"])
        assert new.get("other") == old.get("other")
        for a, b in zip(plain(old["face"]), plain(new["face"]), strict=True):
            assert [out.vertex_map[k] for k in b.pop("vertex_indices")] == a.pop("vertex_indices")  # type: ignore[attr-defined]
            assert a == b
        assert_round_trip(document, uvmap, "ply", WriteOptions(ply_uv=mode))


def test_indices_outgrow_their_type() -> None:
    """300 separate corners do not fit a uchar: the list gets a wider type."""
    n = 200
    points: list[list[object]] = [[float(k), float(k * k % 17), 0.0] for k in range(n)]
    faces: list[list[object]] = [[[k, k + 1, k + 2]] for k in range(n - 2)]
    data = build("binary_big_endian", {
        "vertex": (["float x", "float y", "float z"], points),
        "face": (["list uchar uchar vertex_indices"], faces),
    })  # fmt: skip
    document = read_data(data)
    m = len(document.mesh.faces)
    uvmap = UVMap(np.random.default_rng(0).random((3 * m, 2)), np.arange(3 * m).reshape(-1, 3))
    again = assert_round_trip(document, uvmap, "ply", WriteOptions(ply_uv="vertex"))
    assert len(again.mesh.points) == 3 * m


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"element vertex 7", b"element vertex 4000000000", "promises 4000000000"),
        (b"element face 4", b"element face 5", "promises|malformed"),
        (b"element face 4", b"element face 4000000000", "promises 4000000000"),
        (b"element vertex 7", b"element vertex -7", "line 5"),
        (b"end_header", b"end_heade", "end_header"),
        (b"property float x", b"property quad x", "line"),
        (b"property float x", b"property float q", "x, y and z"),
        (b"format", b"formal", "line 2"),
        (b"1.0\n", b"1.0\nformat runes 1.0\n", "runes"),
        (b"ply\n", b"plx\n", "PLY"),
        (b"list uchar int vertex_indices", b"list float int vertex_indices", "line"),
        (b"list uchar int vertex_indices", b"list uchar int corners", "vertex_indices"),
    ],
)
@pytest.mark.parametrize("encoding", ORDERS)
def test_headers_that_lie(old: bytes, new: bytes, says: str, encoding: str) -> None:
    data = sample(encoding)
    assert old in data
    with pytest.raises(InputError, match=says) as caught:
        read_data(data.replace(old, new, 1), format="ply")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("encoding", ORDERS)
def test_cut_files(encoding: str) -> None:
    """Every prefix is an error in one line, never a wrong mesh or a crash."""
    data = build(encoding, {
        "vertex": (["float x", "float y", "float z"], [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]]),
        "face": (["list uchar int vertex_indices"], [[[0, 1, 2]], [[0, 1, 2, 3]]]),
    })  # fmt: skip
    read_data(data)
    for end in range(len(data) - (1 if encoding != "ascii" else 2)):
        with pytest.raises(InputError):
            read_data(data[:end], format="ply")


def test_faces_that_name_no_vertex() -> None:
    for bad in (7, -1):
        data = sample("ascii").replace(b"3 3 2 6", f"3 3 2 {bad}".encode())
        with pytest.raises(InputError, match="a face names vertex"):
            read_data(data)


@pytest.mark.parametrize("path", corpus_files(".ply"))
@pytest.mark.parametrize("seams", [False, True])
def test_real_files_keep_every_property(path, seams: bool) -> None:
    document = read(path)
    if seams and len(document.mesh.faces) > 300_000:
        pytest.skip("one layout is enough for a file of this size")
    uvmap = layout_with_seams(document, parts=8) if seams else smooth_layout(document)
    again = assert_round_trip(document, uvmap, "ply")
    old, new = document.layout, again.layout  # type: ignore[attr-defined]
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


@pytest.mark.parametrize("path", corpus_files(".ply"))
def test_real_files_read_as_trimesh_reads_them(path) -> None:
    import trimesh

    document = read(path)
    if "tristrips" in document.features:
        pytest.skip("trimesh reads no strips")
    theirs = trimesh.load(path, process=False)
    # trimesh splits vertices at wedge uv, and rounds the digits of an ascii file to the declared float
    ours = document.mesh.points[document.mesh.faces].astype(np.float32)
    np.testing.assert_array_equal(ours, theirs.vertices[theirs.faces].astype(np.float32))
