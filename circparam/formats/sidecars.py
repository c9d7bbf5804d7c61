"""Small text files beside a mesh: pinned points, landmarks, corners of a polygon, seams by vertex pairs.

All are plain text, one item a line, numbers separated by blanks or commas, ``#`` begins a comment.
Vertices count from 0, as in the arrays of the library; in the ``l`` elements of an OBJ from 1, as there.
"""

import itertools
import os
from pathlib import Path

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.files import write_files
from circparam.errors import InputError

# Bytes; ten million lines of numbers, more than any mesh that is read has vertices to pin.
LIMIT = 1 << 28
HIGHEST = 2**53  # of a vertex; beyond it numbers with a point skip some


def read_pins(path: str | os.PathLike[str]) -> FloatArray:
    """(p, 3): vertex, u, v of every line. Raises InputError if a line holds something else."""
    return _numbers(path, 3, "a vertex number, u and v", vertices=1)


def read_landmarks(path: str | os.PathLike[str]) -> IntArray:
    """(k, 2): a vertex of one mesh and a vertex of another on every line. Raises InputError if a line holds
    something else. Lines ``path ...`` are left out, see ``read_paths``."""
    return _numbers(path, 2, "two vertex numbers", vertices=2, besides="path").astype(np.int64)


def read_paths(path: str | os.PathLike[str]) -> list[list[int]]:
    """The vertices of the first mesh on every line ``path 12 77 503`` of a file of landmarks. Raises
    InputError if such a line holds something else."""
    out = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words or words[0] != "path":
            continue
        try:
            out.append([int(word) for word in words[1:]])
        except ValueError:
            raise InputError(
                f"{path}, line {number}: {line.strip()!r} is not a path of vertex numbers"
            ) from None
    return out


def read_faces(path: str | os.PathLike[str]) -> IntArray:
    """(k,) face numbers, any number of them a line. Raises InputError if a line holds something else."""
    out: list[int] = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        if not all(word.isdecimal() and int(word) <= HIGHEST for word in words):
            raise InputError(f"{path}, line {number}: {line.strip()!r} is no list of face numbers")
        out += map(int, words)
    if not out:
        raise InputError(f"{path}: it holds no face number")
    return np.array(out, np.int64)


def read_polygon(path: str | os.PathLike[str]) -> FloatArray:
    """(k, 2): the corners of a polygon. Raises InputError if a line holds something else."""
    return _numbers(path, 2, "x and y of a corner")


def read_column(path: str | os.PathLike[str], what: str) -> FloatArray:
    """(k,): one number a line; ``what`` says which. Raises InputError if a line holds something else."""
    return _numbers(path, 1, what)[:, 0]


def read_seams(path: str | os.PathLike[str]) -> IntArray:
    """(s, 2) vertex pairs: two numbers a line, or the ``l`` elements of an OBJ.

    Raises InputError if a line holds something else.
    """
    text = _text(path)
    lines = [line.split("#")[0].split() for line in text.splitlines()]
    obj = [words for words in lines if words and words[0] == "l"]
    if not obj and Path(path).suffix.lower() != ".obj":
        return _numbers(path, 2, "two vertex numbers", vertices=2).astype(np.int64)
    n = sum(1 for words in lines if words and words[0] == "v")
    pairs: list[tuple[int, int]] = []
    for words in obj:
        try:
            chain = [int(word.split("/")[0]) for word in words[1:]]
        except ValueError:
            raise InputError(f"{path}: 'l {' '.join(words[1:])}' is not a line element") from None
        chain = [k - 1 if k > 0 else n + k for k in chain]
        if any(abs(k) > HIGHEST for k in chain):
            raise InputError(f"{path}: 'l {' '.join(words[1:])}' is not a line element")
        pairs += list(itertools.pairwise(chain))
    return np.array(pairs, np.int64).reshape(-1, 2)


def read_weights(path: str | os.PathLike[str]) -> FloatArray:
    """(k, 3): the weights of seams, two vertices and a weight a line, or one vertex (−1 for the other) and a
    weight.

    A weight is a number from 0 on, or ``inf`` (also ``never``). Raises InputError if a line holds something
    else.
    """
    rows = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").replace("never", "inf").split()
        if not words:
            continue
        try:
            *vertices, weight = (float(word) for word in words)
        except ValueError:
            vertices, weight = [], np.nan
        fine = len(vertices) in (1, 2) and all(
            v.is_integer() and abs(v) <= HIGHEST for v in vertices
        )
        if not fine:
            raise InputError(
                f"{path}, line {number}: {line.strip()!r} is not one or two vertex numbers and a weight"
            )
        if not weight >= 0:
            raise InputError(
                f"{path}, line {number}: the weight {words[-1]} is not a number from 0 (free) to inf (never)"
            )
        rows.append([*vertices, -1.0, weight] if len(vertices) == 1 else [*vertices, weight])
    if not rows:
        raise InputError(f"{path}: it holds no line with vertex numbers and a weight")
    return np.array(rows, np.float64)


def write_seams(path: str | os.PathLike[str], pairs: IntArray, overwrite: bool = False) -> None:
    """Write vertex pairs, one a line, as ``read_seams`` reads them. Raises OutputError."""
    lines = [f"{a} {b}\n" for a, b in np.asarray(pairs, np.int64).reshape(-1, 2).tolist()]
    head = "# seams: two vertices a line, counted from 0\n"
    write_bytes(path, (head + "".join(lines)).encode(), overwrite)


def write_bytes(path: str | os.PathLike[str], data: bytes, overwrite: bool = False) -> None:
    """Write a small file as a whole or not at all. Raises OutputError."""
    write_files({Path(path): data}, overwrite)


def _text(path: str | os.PathLike[str]) -> str:
    try:
        if os.path.getsize(path) > LIMIT:
            raise InputError(
                f"{path}: {os.path.getsize(path)} bytes are too many for a list of numbers"
            )
        return Path(path).read_text("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: it is not a text file") from error


def _numbers(
    path: str | os.PathLike[str], columns: int, what: str, *, vertices: int = 0, besides: str = ""
) -> FloatArray:
    """The numbers of a text file as rows of so many.

    vertices: number of vertex numbers at the beginning of each row. besides: the first word of skipped lines.
    """
    rows = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words or words[0] == besides:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != columns or not np.isfinite(row).all():
            raise InputError(f"{path}, line {number}: {line.strip()!r} is not {what}")
        for value in row[:vertices]:
            if not value.is_integer() or abs(value) > HIGHEST:
                raise InputError(f"{path}, line {number}: {value:g} is not a vertex number")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: it holds no line with {what}")
    return np.array(rows, np.float64).reshape(-1, columns)
