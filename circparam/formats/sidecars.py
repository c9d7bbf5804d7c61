"""Small text files beside a mesh: pinned points, landmarks, corners of a polygon, seams by vertex pairs.

All are plain text, one item a line, numbers separated by blanks or commas, ``#`` begins a comment.
Vertices count from 0, as in the arrays of the library; in the ``l`` elements of an OBJ from 1, as there.
"""

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np

from circparam.core.files import write_files
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError

# Bytes; ten million lines of numbers, more than any mesh that is read has vertices to pin.
LARGEST_FILE_BYTES = 1 << 28
AnyPath: TypeAlias = str | os.PathLike[str]
HIGHEST_VERTEX = 2**53  # of a vertex; beyond it numbers with a point skip some


def read_pins(path: AnyPath) -> FloatArray:
    """(p, 3): vertex, u, v of every line. Raises InputError if a line holds something else."""
    return _numbers(path, 3, "a vertex number, u and v", vertices=1)


def read_landmarks(path: AnyPath) -> IntArray:
    """(k, 2): a vertex of one mesh and a vertex of another on every line. Raises InputError if a line holds
    something else. Lines ``path ...`` are left out, see ``read_paths``."""
    return _numbers(path, 2, "two vertex numbers", vertices=2, besides="path").astype(np.int64)


def read_paths(path: AnyPath) -> list[list[int]]:
    """The vertices of the first mesh on every line ``path 12 77 503`` of a file of landmarks. Raises
    InputError if such a line holds something else."""
    out = []
    for line, words in _lines(path):
        if words[0] == "path":
            try:
                out.append([int(word) for word in words[1:]])
            except ValueError:
                raise InputError(f"{line} is not a path of vertex numbers") from None
    return out


def read_faces(path: AnyPath) -> IntArray:
    """(k,) face numbers, any number of them a line. Raises InputError if a line holds something else."""
    out: list[int] = []
    for line, words in _lines(path):
        if not all(word.isdecimal() and int(word) <= HIGHEST_VERTEX for word in words):
            raise InputError(f"{line} is no list of face numbers")
        out += map(int, words)
    if not out:
        raise InputError(f"{path}: it holds no face number")
    return np.array(out, np.int64)


def read_polygon(path: AnyPath) -> FloatArray:
    """(k, 2): the corners of a polygon. Raises InputError if a line holds something else."""
    return _numbers(path, 2, "x and y of a corner")


def read_column(path: AnyPath, what: str) -> FloatArray:
    """(k,): one number a line; ``what`` says which. Raises InputError if a line holds something else."""
    return _numbers(path, 1, what)[:, 0]


def read_seams(path: AnyPath) -> IntArray:
    """(s, 2) vertex pairs: two numbers a line, or the ``l`` elements of an OBJ.

    Raises InputError if a line holds something else.
    """
    lines = [line.split("#")[0].split() for line in _text(path).splitlines()]
    obj = [words for words in lines if words and words[0] == "l"]
    if not obj and Path(path).suffix.lower() != ".obj":
        return _numbers(path, 2, "two vertex numbers", vertices=2).astype(np.int64)
    n = sum(words[:1] == ["v"] for words in lines)
    pairs: list[tuple[int, int]] = []
    for words in obj:
        try:
            chain = [int(word.split("/")[0]) for word in words[1:]]
            chain = [k - 1 if k > 0 else n + k for k in chain]
            if any(abs(k) > HIGHEST_VERTEX for k in chain):
                raise ValueError
        except ValueError:
            raise InputError(f"{path}: 'l {' '.join(words[1:])}' is not a line element") from None
        pairs += itertools.pairwise(chain)
    return np.array(pairs, np.int64).reshape(-1, 2)


def read_weights(path: AnyPath) -> FloatArray:
    """(k, 3): the weights of seams, two vertices and a weight a line, or one vertex (−1 for the other) and a
    weight.

    A weight is a number from 0 on, or ``inf`` (also ``never``). Raises InputError if a line holds something
    else.
    """
    rows = []
    for line, words in _lines(path):
        *vertices, weight = _floats([word.replace("never", "inf") for word in words]) or [np.nan]
        if len(vertices) not in (1, 2) or not all(map(_is_vertex, vertices)):
            raise InputError(f"{line} is not one or two vertex numbers and a weight")
        if not weight >= 0:
            where, said = line.partition(": ")[0], words[-1].replace("never", "inf")
            raise InputError(
                f"{where}: the weight {said} is not a number from 0 (free) to inf (never)"
            )
        rows.append([*vertices, *[-1.0] * (2 - len(vertices)), weight])
    if not rows:
        raise InputError(f"{path}: it holds no line with vertex numbers and a weight")
    return np.array(rows, np.float64)


def write_seams(path: AnyPath, pairs: IntArray, overwrite: bool = False) -> None:
    """Write vertex pairs, one a line, as ``read_seams`` reads them. Raises OutputError."""
    lines = [f"{a} {b}\n" for a, b in np.asarray(pairs, np.int64).reshape(-1, 2).tolist()]
    head = "# seams: two vertices a line, counted from 0\n"
    write_files({Path(path): (head + "".join(lines)).encode()}, overwrite)


def _text(path: AnyPath) -> str:
    try:
        if os.path.getsize(path) > LARGEST_FILE_BYTES:
            raise InputError(
                f"{path}: {os.path.getsize(path)} bytes are too many for a list of numbers"
            )
        return Path(path).read_text("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: it is not a text file") from error


def _lines(path: AnyPath) -> Iterator[tuple[str, list[str]]]:
    """(place and text for messages, words) of every line that is not empty, comments left out."""
    for number, line in enumerate(_text(path).splitlines(), 1):
        if words := line.split("#")[0].replace(",", " ").split():
            yield f"{path}, line {number}: {line.strip()!r}", words


def _floats(words: list[str]) -> list[float]:
    """The words as numbers; none of them if one is something else."""
    try:
        return [float(word) for word in words]
    except ValueError:
        return []


def _is_vertex(value: float) -> bool:
    return value.is_integer() and abs(value) <= HIGHEST_VERTEX


def _numbers(
    path: AnyPath, columns: int, what: str, *, vertices: int = 0, besides: str = ""
) -> FloatArray:
    """The numbers of a text file as rows of so many.

    vertices: number of vertex numbers at the beginning of each row. besides: the first word of skipped lines.
    """
    rows = []
    for line, words in _lines(path):
        if words[0] == besides:
            continue
        row = _floats(words)
        if len(row) != columns or not np.isfinite(row).all():
            raise InputError(f"{line} is not {what}")
        wrong = [value for value in row[:vertices] if not _is_vertex(value)]
        if wrong:
            raise InputError(f"{line.partition(': ')[0]}: {wrong[0]:g} is not a vertex number")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: it holds no line with {what}")
    return np.array(rows, np.float64).reshape(-1, columns)
