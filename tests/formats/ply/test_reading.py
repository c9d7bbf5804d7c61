"""Where every value of a PLY file is: rows of any length, headers that lie, files cut short."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read, read_data
from circparam.formats.ply.reading import Layout
from circparam.formats.source import Source
from tests.support.formats_tools import (
    corpus_files,
    layout_with_seams,
)
from tests.support.ply_files import (
    ORDERS,
    build,
    naive,
    plain,
    sample,
)


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
def test_real_files_read_as_trimesh_reads_them(path) -> None:
    import trimesh

    document = read(path)
    if "tristrips" in document.features:
        pytest.skip("trimesh reads no strips")
    theirs = trimesh.load(path, process=False)
    # trimesh splits vertices at wedge uv, and rounds the digits of an ascii file to the declared float
    ours = document.mesh.points[document.mesh.faces].astype(np.float32)
    np.testing.assert_array_equal(ours, theirs.vertices[theirs.faces].astype(np.float32))


@pytest.mark.parametrize("encoding", ORDERS)
def test_every_value_where_it_stands(encoding: str) -> None:
    """Scalars and lists of every element, before and behind lists of any length."""
    data = sample(encoding, uv="face")
    layout, expected = Layout(data, Source("x")), naive(data)
    assert [e.name for e in layout.elements] == list(expected)
    for e in layout.elements:
        for p in e.properties:
            cells = [row[p.name] for row in expected[e.name]]
            if p.count_type:
                values, counts = layout.list(e, p.name)
                assert counts.tolist() == [len(c) for c in cells]  # type: ignore[arg-type]
                flat = [x for c in cells for x in c]  # type: ignore[attr-defined]
                np.testing.assert_allclose(values, flat, rtol=1e-7)
            else:
                np.testing.assert_allclose(layout.scalar(e, p.name), cells, rtol=1e-7)
    with pytest.raises(InputError, match="no scalar property 'vertex_indices'"):
        layout.scalar(layout.element("face"), "vertex_indices")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no list property 'x'"):
        layout.list(layout.element("vertex"), "x")  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["char", "short", "int"])
def test_a_negative_length_is_refused(kind: str) -> None:
    points: list[list[object]] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    for encoding in ORDERS:
        data = build(encoding, {
            "vertex": (["float x", "float y", "float z"], points),
            "face": ([f"list {kind} int vertex_indices"], [[[0, 1, 2]]]),
        })  # fmt: skip
        read_data(data)
        size = {"char": 1, "short": 2, "int": 4}[kind]
        head, mark, body = data.partition(b"end_header\n")
        if encoding == "ascii":
            bad = body.replace(b"3 0 1 2", b"-3 0 1 2")
        else:
            bad = body[:36] + b"\xff" * size + body[36 + size :]
        with pytest.raises(InputError):
            read_data(head + mark + bad)


def test_the_last_vertex_may_be_named_and_strips_restart_at_minus_one() -> None:
    points: list[list[object]] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]

    def file(face: list[int], strip: list[int]) -> bytes:
        return build("ascii", {
            "vertex": (["float x", "float y", "float z"], points),
            "face": (["list uchar int vertex_index"], [[face]]),
            "tristrips": (["list int int vertex_indices"], [[strip]]),
        })  # fmt: skip

    assert read_data(file([0, 1, 2], [2, 1, 0, -1])).mesh.faces.tolist() == [[0, 1, 2], [2, 1, 0]]
    for face, strip in (([0, 1, 3], [0]), ([0, 1, -1], [0]), ([0, 1, 2], [3]), ([0, 1, 2], [-2])):
        with pytest.raises(InputError, match="a face names vertex"):
            read_data(file(face, strip))
