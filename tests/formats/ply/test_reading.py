"""Where every value of a PLY file is: rows of any length, headers that lie, files cut short."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read, read_data
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
