"""Lines without an end: refused while they are read, with the memory of a few blocks; long legal lines pass."""

import itertools
import os
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from circparam.errors import InputError
from circparam.formats.io import (
    BLOCK_BYTES,
    LINE_BYTES_PER_BYTE,
    LONGEST_LINE_BYTES,
    check_lines,
    read,
)
from circparam.formats.source import Source

ROWS = b"0 0 0\n1 0 0\n0 1 0\n"
PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    b"element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
)
HEADS = {
    "obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf ",
    "off": b"OFF\n3 1 0\n" + ROWS + b"3 ",
    "ply": PLY + ROWS + b"999999999 ",
    "stl": b"solid x\nfacet normal 0 0 1\nouter loop\nvertex ",
}
REST = b"1 2 3 " * (BLOCK_BYTES // 5)


@pytest.mark.parametrize("format", HEADS)
def test_a_line_of_gigabytes_is_refused_before_it_is_in_memory(tmp_path: Path, format: str) -> None:
    path = tmp_path / f"endless.{format}"
    path.write_bytes(HEADS[format] + REST)
    os.truncate(path, 1 << 31)  # the rest is a hole: one word of two gigabytes
    line = 1 + HEADS[format].count(b"\n")
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=rf"line {line} is longer than 16 MB") as caught:
            read(path)
        assert tracemalloc.get_traced_memory()[1] < 10 * BLOCK_BYTES
    finally:
        tracemalloc.stop()
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("format", HEADS)
def test_an_endless_line_of_a_pipe_is_refused_while_it_comes(monkeypatch, format):
    asked = itertools.count()

    def more(size: int = -1) -> bytes:
        assert size > 0, "all of an endless pipe was asked for"
        assert next(asked) < 2 * LONGEST_LINE_BYTES // BLOCK_BYTES, "it was read on and on"
        return (REST * (size // len(REST) + 1))[:size]

    head = iter([HEADS[format] + REST])
    pipe = SimpleNamespace(read=lambda size=-1: next(head, b"") or more(size))
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=pipe))
    with pytest.raises(InputError, match=r"^standard input: line \d+ is longer than 16 MB"):
        read("-")


def vertices_and_a_line(share: float) -> Iterator[bytes]:
    """Ten blocks of rows, and then a line so many times as long."""
    yield from itertools.repeat(b"0 0 0 \n" * (BLOCK_BYTES // 7), 10)
    yield from itertools.repeat(b"12345 \t" * (BLOCK_BYTES // 7), round(share * 10))


def test_a_strip_may_name_every_vertex_of_a_mesh_six_times() -> None:
    check_lines(vertices_and_a_line(LINE_BYTES_PER_BYTE), Source("strip.ply"))
    with pytest.raises(
        InputError, match=rf"^strip.ply: line {10 * (BLOCK_BYTES // 7) + 1} is longer"
    ):
        check_lines(vertices_and_a_line(LINE_BYTES_PER_BYTE + 0.1), Source("strip.ply"))


def test_binary_files_have_no_lines(tmp_path: Path) -> None:
    """Zeros for twice the length of a line: of a binary PLY and STL they are values."""
    count = LONGEST_LINE_BYTES // 6
    head = PLY.replace(b"ascii", b"binary_little_endian").replace(b"vertex 3", b"vertex %d" % count)
    head = head.replace(b"tristrips 1", b"face 1").replace(b"list int int", b"list uchar uchar")
    ply = head + bytes(12 * count) + bytes([3, 0, 1, 2])
    facets = 2 * LONGEST_LINE_BYTES // 50
    for name, data in (
        ("zeros.ply", ply),
        ("solid.stl", b"solid x".ljust(80) + facets.to_bytes(4, "little") + bytes(50 * facets)),
    ):
        path = tmp_path / name
        path.write_bytes(data)
        assert len(read(path).mesh.faces) == (1 if name == "zeros.ply" else facets)
