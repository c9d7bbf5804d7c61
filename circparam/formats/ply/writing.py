"""Rows of a PLY file written again, with uv at vertices or faces, and a new file without uv."""

from collections.abc import Sequence
from dataclasses import field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import OptionError
from circparam.formats.document import NOTE_START, page_lines
from circparam.formats.ply.reading import INDICES, Element, FaceLists, Layout, vertex_uv
from circparam.formats.polygons import Polygons, list_start
from circparam.formats.tokens import ByteArray, as_bytes, interleave, take_ranges
from circparam.formats.vertex_split import Split

# bytes of all rows, and the length of each row's share
Piece: TypeAlias = tuple[ByteArray, IntArray]
_NAMES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint",
    "f4": "float", "f8": "double", "i8": "int64", "u8": "uint64",
}  # fmt: skip


def scalars(layout: Layout, values: npt.NDArray[Any], code: str) -> Piece:
    """(n, k) values of one type, k to a row: ascii words each behind a blank, or binary."""
    flat = np.ascontiguousarray(values).astype(code).reshape(len(values), -1)
    if not layout.ascii:
        raw = flat.astype(layout.order + code).reshape(-1).view(np.uint8)
        return raw, np.full(len(flat), flat.shape[1] * int(code[1]), np.int64)
    # as float64, so that a float32 reads back the same whether or not a reader rounds to the type
    exact = flat.astype(np.float64) if code[0] == "f" else flat
    words = [f" {w!r}" for w in exact.ravel().tolist()]
    size = np.array([len(w) for w in words], np.int64).reshape(flat.shape).sum(1)
    return as_bytes("".join(words).encode()), size


def list_piece(head: Piece, counts: IntArray, items: Piece) -> Piece:
    """Rows of a list: the count's bytes, then ``counts`` of the items, each of which is one piece."""
    end = list_start(items[1])
    first = list_start(counts)
    return interleave([head, (items[0], end[first[1:]] - end[first[:-1]])])


@dataclass(frozen=True, eq=False)
class Change:
    """What changes in an element: its properties, with the lines of the header that declare them.

    drop: properties that go. replace: line and values of properties that stand in their places. lines, add: of
    properties behind the last one. rows: the rows to write, in order (they may repeat), None for all; values
    have one share for each of them.
    """

    drop: set[str]
    replace: dict[str, tuple[str, Piece]] = field(default_factory=dict)
    lines: tuple[str, ...] = ()
    add: Piece | None = None
    rows: IntArray | None = None


def written(layout: Layout, lines: list[str], changes: dict[str, Change]) -> bytes:
    """The file with changed elements; lines: of its header, perhaps with other comments."""
    parts = [_header(layout, lines, changes)]
    done = layout.body
    for e in layout.elements:
        end = int(layout.byte(e.row[-1:])[0])
        changed = e.name in changes and e.count
        parts.append(_rows(layout, e, changes[e.name]) if changed else layout.data[done:end])
        done = end
    parts.append(layout.data[done:])
    return b"".join(parts)


def with_pages(header: Sequence[str], names: Sequence[str]) -> list[str]:
    """The lines of a PLY header (latin-1) that name these pages, and no pages of an earlier layout."""
    lines = [line for line in header if not line.startswith(f"comment {NOTE_START}")]
    at = 1 + next(k for k, line in enumerate(lines) if line.split()[:1] == ["format"])
    lines[at:at] = [f"comment {line}".encode().decode("latin-1") for line in page_lines(names)]
    return lines


def _header(layout: Layout, lines: list[str], changes: dict[str, Change]) -> bytes:
    """The header with the properties and numbers of rows of changed elements."""
    out: list[str] = []
    last: dict[str, int] = {}
    change, element = None, ""
    for line in lines:
        words = line.split()
        if words[:1] == ["element"]:
            element = words[1]
            change = changes.get(element)
            if change is not None and change.rows is not None:
                line = line.replace(words[2], str(len(change.rows)), 1)
            last[element] = len(out)
        elif words[:1] == ["property"]:
            if change is not None:
                if words[-1] in change.drop:
                    continue
                line = change.replace.get(words[-1], (line,))[0]
            last[element] = len(out)
        out.append(line)
    for name in sorted(changes.keys() & last.keys(), key=lambda name: -last[name]):
        out[last[name] + 1 : last[name] + 1] = changes[name].lines
    newline = layout.newline.decode()
    return (newline.join(out) + newline).encode("latin-1")


def _rows(layout: Layout, e: Element, change: Change) -> bytes:
    """The rows of a changed element."""
    rows = np.arange(e.count) if change.rows is None else change.rows
    parts: list[Piece] = []
    place = [*(layout.place(e, p.name) for p in e.properties), e.row[1:]]
    touched = change.drop | change.replace.keys()
    k = 0
    while k < len(e.properties):
        name = e.properties[k].name
        if name in change.replace:
            parts.append(change.replace[name][1])
        elif name not in change.drop:
            first = k
            while k + 1 < len(e.properties) and e.properties[k + 1].name not in touched:
                k += 1
            # in ascii, every part but the first brings the blank before it along
            start = layout.byte(place[first]) if not parts else layout.byte_end(place[first])
            length = (layout.byte_end(place[k + 1]) - start)[rows]
            parts.append((take_ranges(layout.raw, start[rows], length), length))
        k += 1
    if change.add is not None:
        parts.append(change.add)
    if layout.ascii:
        newline = as_bytes(layout.newline)
        parts.append((np.tile(newline, len(rows)), np.full(len(rows), len(newline))))
    return interleave(parts)[0].tobytes()


def uv_at_faces(place: str | None) -> bool:
    """Whether uv go to faces: only where the user says so. Raises OptionError for another word than the two."""
    if place not in (None, "vertex", "face"):
        raise OptionError(f"unknown place for uv {place!r}: choose vertex or face")
    return place == "face"


def face_changes(
    layout: Layout, lists: FaceLists, uv: FloatArray, corner_uv: IntArray, code: str
) -> dict[str, Change]:
    """The changes that give every face a texcoord list. corner_uv: (L,) of all face corners, −1 for 0, 0."""
    size = np.diff(lists.polys.start)[: lists.n_faces]
    count_code = "u1" if int(size.max(initial=0)) * 2 < 256 else "i4"
    text, length = scalars(layout, np.concatenate([uv, np.zeros((1, 2))]), code)
    at = np.cumsum(length) - length
    length = length[corner_uv]
    pairs = take_ranges(text, at[corner_uv], length)
    piece = list_piece(scalars(layout, 2 * size[:, None], count_code), size, (pairs, length))
    line = f"property list {_NAMES[count_code]} {_NAMES[code]} texcoord"
    changes = {"face": Change({"texcoord"}, lines=(line,), add=piece)}
    if old := vertex_uv(layout.element("vertex")):
        changes["vertex"] = Change(set(old))
    return changes


def vertex_changes(layout: Layout, lists: FaceLists, split: Split, code: str) -> dict[str, Change]:
    """The changes that give every vertex uv, vertices duplicated where a seam runs."""
    old = vertex_uv(layout.element("vertex"))
    lines = tuple(f"property {_NAMES[code]} {name}" for name in old or ("s", "t"))
    uv = scalars(layout, split.uv, code)
    changes = {"vertex": Change(set(old or ()), lines=lines, add=uv, rows=split.source)}
    for name in ("face", "tristrips"):
        e = layout.element(name)
        change = Change({"texcoord"} if name == "face" and e.find("texcoord") else set())
        indices = e.find(*INDICES)
        if e.count and split.added and indices is not None:
            corner, sizes = split.corner, np.diff(lists.polys.start)[: lists.n_faces]
            values = corner[: lists.n_corners]
            if name == "tristrips":
                triangles = corner[lists.n_corners :].reshape(-1, 3)
                sizes, values = break_strips(
                    triangles, lists.strips, list_start(lists.strip_lengths)
                )
            count_code, kind = indices.count_type, indices.type  # wider ones where these are narrow
            if int(sizes.max(initial=0)) > np.iinfo(count_code).max:
                count_code = "i4"
            if kind[0] != "f" and len(split.source) - 1 > np.iinfo(kind).max:
                kind = "i4"
            line = f"property list {_NAMES[count_code]} {_NAMES[kind]} {indices.name}"
            heads = scalars(layout, sizes[:, None], count_code)
            items = scalars(layout, values[:, None], kind)
            change.replace[indices.name] = line, list_piece(heads, sizes, items)
        if change.drop or change.replace:
            changes[name] = change
    return changes


def break_strips(corner: IntArray, place: IntArray, start: IntArray) -> tuple[IntArray, IntArray]:
    """Strips that give the same triangles with new vertices, restarted (−1) where neighbours differ.

    corner: (k, 3) new vertices of the triangles. place: (k, 3) the strip values they were made of (two
    swapped where the triangle is odd). start: (rows + 1,) offsets of the strips.
    Returns ((rows,) lengths, values).
    """
    odd = place[:, 0] > place[:, 1]
    first = np.minimum(place[:, 0], place[:, 1])
    w = np.where(odd[:, None], corner[:, [1, 0, 2]], corner)  # in the order of the strip
    row = np.searchsorted(start, first, side="right") - 1
    joined = np.zeros(len(first), bool)
    joined[1:] = (first[1:] == first[:-1] + 1) & (odd[1:] != odd[:-1]) & (row[1:] == row[:-1])
    joined[1:] &= (w[1:, :2] == w[:-1, 1:]).all(1)
    new_row = np.ones(len(first), bool)
    new_row[1:] = row[1:] != row[:-1]
    restart = ~joined & ~new_row
    turn = ~joined & odd  # an odd triangle can only begin a run behind an empty one
    length = 1 + 2 * ~joined + restart + turn
    out = np.empty(int(length.sum()), np.int64)
    end = np.cumsum(length)
    out[end - 1] = w[:, 2]
    out[end[~joined] - 2] = w[~joined, 1]
    out[end[~joined] - 3] = w[~joined, 0]
    out[end[turn] - 4] = w[turn, 0]
    out[(end - length)[restart]] = -1
    return np.bincount(row, length, len(start) - 1).astype(np.int64), out


def plain(points: FloatArray, polys: Polygons, longest: int) -> bytes:
    """A new binary PLY without uv. longest: corners of a polygon up to which bytes count them."""
    with np.errstate(over="ignore", invalid="ignore"):
        exact = bool((points.astype(np.float32) == points)[np.isfinite(points)].all())
    size = np.diff(polys.start)
    number, code = ("float", "<f4") if exact else ("double", "<f8")
    count, counts = ("uchar", size.astype("u1"))
    if int(size.max(initial=0)) > longest:
        count, counts = "int", size.astype("<i4")
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment written by circparam",
        f"element vertex {len(points)}",
        *(f"property {number} {c}" for c in "xyz"),
        f"element face {len(size)}",
        f"property list {count} int vertex_indices",
        "end_header\n",
    ]
    heads = counts.view(np.uint8), np.full(len(size), counts.itemsize, np.int64)
    rows, _ = interleave([heads, (polys.corners.astype("<i4").view(np.uint8), 4 * size)])
    return "\n".join(lines).encode() + points.astype(code).tobytes() + rows.tobytes()
