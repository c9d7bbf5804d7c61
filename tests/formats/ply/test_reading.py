"""Where every value of a PLY file is: rows of any length, headers that lie, files cut short."""

import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read, read_data
from tests.support import writers
from tests.support.formats_tools import layout_with_seams, refused
from tests.support.ply_files import (
    INDEX,
    ORDERS,
    THREE,
    XYZ,
    build,
    head_of_promises,
    naive,
    plain,
    sample,
    triangles_file,
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


@pytest.mark.parametrize("encoding", ORDERS)
def test_a_comment_over_several_lines_is_one(encoding: str) -> None:
    """Blender 2.47 writes the name of its file with the line breaks that it holds."""
    data = sample(encoding)
    broken = data.replace(b"comment made", b"comment source file: a\n b.blend\nc\ncomment made")
    assert broken != data
    document = read_data(broken)
    np.testing.assert_array_equal(document.mesh.points, read_data(data).mesh.points)
    out = encode(document, layout_with_seams(document), "ply").data
    assert b"comment source file: a\ncomment b.blend\ncomment c\ncomment made" in out
    refused(
        data.replace(b"comment made", b"b.blend\ncomment made", 1),
        r"line 3: 'b\.blend' is not a PLY header line",
    )


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
    refused(data.replace(old, new, 1), says, "ply")


@pytest.mark.parametrize("encoding", ORDERS)
def test_cut_files(encoding: str) -> None:
    """Every prefix is an error in one line, never a wrong mesh or a crash."""
    data = triangles_file(encoding, [*THREE, [1, 1, 1]], [[0, 1, 2], [0, 1, 2, 3]])
    read_data(data)
    for end in range(len(data) - (1 if encoding != "ascii" else 2)):
        refused(data[:end], "", "ply")


@pytest.mark.parametrize("kept", [0, 1, 6_000])
def test_a_download_that_stopped_ends_in_zeros(kept: int) -> None:
    data = writers.ply_binary(np.eye(3, dtype="<f4"), np.tile([0, 1, 2], (10_000, 1)))
    end = len(data) - 13 * (10_000 - kept)
    refused(data[:end] + bytes(len(data) - end), "not filled to its end", "ply")


def test_an_end_of_zeros_is_a_stopped_download_in_rows_with_lists_alone(tmp_path: Path) -> None:
    """Whatever stands between; vertices at the origin end a large file as well."""

    def file(*order: str) -> bytes:
        elements: dict[str, tuple[list[str], list[list[object]]]] = {
            "vertex": (XYZ, THREE[::-1]),
            "face": ([INDEX], [[[0, 1, 2]]] * 400),
            "other": (["char c"], [[7]]),
        }
        return build("binary_little_endian", {name: elements[name] for name in order})

    stopped = file("vertex", "other", "face")[:-5000] + bytes(5000)
    refused(stopped, "not filled to its end", "ply")
    path = tmp_path / "origin.ply"
    large = file("face", "other", "vertex").replace(b"vertex 3\n", b"vertex 1400003\n")
    path.write_bytes(large + bytes(12 * 1_400_000))
    assert len(read(path).mesh.faces) == 400


@pytest.mark.parametrize("sides", [(4, 4, 3), (4, 3), (4, 4, 4, 3, 3, 3), (5, 3, 3, 3)])
def test_rows_shorter_than_the_first_are_all_read(sides: tuple[int, ...]) -> None:
    """The file ends before so many rows like the first would: it is whole for all that."""
    points = [[np.cos(k), np.sin(k), 0] for k in range(5)]
    data = triangles_file("binary_little_endian", points, [list(range(k)) for k in sides])
    assert len(read_data(data).mesh.faces) == sum(sides) - 2 * len(sides)


@pytest.mark.parametrize("kind", ["char", "short", "int"])
def test_a_negative_length_is_refused(kind: str) -> None:
    for encoding in ORDERS:
        data = triangles_file(encoding, THREE, [[0, 1, 2]], f"list {kind} int vertex_indices")
        read_data(data)
        size = {"char": 1, "short": 2, "int": 4}[kind]
        head, mark, body = data.partition(b"end_header\n")
        if encoding == "ascii":
            bad = body.replace(b"3 0 1 2", b"-3 0 1 2")
        else:
            bad = body[:36] + b"\xff" * size + body[36 + size :]
        refused(head + mark + bad, "")


def test_the_last_vertex_may_be_named_and_strips_restart_at_minus_one() -> None:
    def file(face: list[int], strip: list[int]) -> bytes:
        strips = ["list int int vertex_indices"], [[strip]]
        return triangles_file(
            "ascii", THREE, [face], "list uchar int vertex_index", tristrips=strips
        )

    assert read_data(file([0, 1, 2], [2, 1, 0, -1])).mesh.faces.tolist() == [[0, 1, 2], [2, 1, 0]]
    for face, strip in (([0, 1, 3], [0]), ([0, 1, -1], [0]), ([0, 1, 2], [3]), ([0, 1, 2], [-2])):
        refused(file(face, strip), "a face names vertex")


@pytest.mark.parametrize(
    ("vertices", "faces", "says"),
    [
        (10_000_000, 10_000_000, "the rows of 'face' end in zeros"),
        (10_000_000, 2**32, "promises 4294967296 rows of 'face', the file has at most"),
        (2**40, 1, "promises 1099511627776 rows of 'vertex', the file has at most"),
    ],
)
def test_a_large_file_that_cannot_be_whole_is_refused_before_it_is_read(
    tmp_path: Path, vertices: int, faces: int, says: str
) -> None:
    path = tmp_path / "cut.ply"
    path.write_bytes(head_of_promises(vertices, faces))
    os.truncate(path, 1 << 29)  # sparse
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=says):
            read(path)
        assert tracemalloc.get_traced_memory()[1] < 1e7
    finally:
        tracemalloc.stop()
