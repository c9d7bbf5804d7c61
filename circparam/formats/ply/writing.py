"""Rows of a PLY file written again, with uv at vertices or faces, and a new file without uv."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.types import FloatArray, IntArray
from circparam.errors import OptionError
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


def rebuild(
    layout: Layout, e: Element, drop: set[str], add: Piece | None = None,
    *, rows: IntArray | None = None, replace: dict[str, Piece] | None = None,
) -> bytes:  # fmt: skip
    """The rows of an element again: some properties left out or replaced, others put at the end.

    rows: the rows to write, in order (they may repeat); pieces have one share for each of them.
    """
    rows = np.arange(e.count) if rows is None else rows
    parts: list[Piece] = []
    place = [*(layout.place(e, p.name) for p in e.properties), e.row[1:]]
    k = 0
    while k < len(e.properties):
        name = e.properties[k].name
        if replace and name in replace:
            parts.append(replace[name])
        elif name not in drop:
            first = k
            while k + 1 < len(e.properties) and e.properties[k + 1].name not in drop | set(
                replace or ()
            ):
                k += 1
            # in ascii, every part but the first brings the blank before it along
            start = layout.byte(place[first]) if not parts else layout.byte_end(place[first])
            length = (layout.byte_end(place[k + 1]) - start)[rows]
            parts.append((take_ranges(layout.raw, start[rows], length), length))
        k += 1
    if add is not None:
        parts.append(add)
    if layout.ascii:
        newline = as_bytes(layout.newline)
        parts.append((np.tile(newline, len(rows)), np.full(len(rows), len(newline))))
    return interleave(parts)[0].tobytes()


def header(
    layout: Layout, drop: dict[str, set[str]], add: dict[str, list[str]], counts: dict[str, int],
    retype: dict[tuple[str, str], str],
) -> bytes:  # fmt: skip
    """The header with property lines taken out, put behind the last of their element, and new counts."""
    out: list[str] = []
    element, last = "", {}
    for line in layout.lines:
        words = line.split()
        if words[:1] == ["element"]:
            element = words[1]
            if element in counts:
                line = line.replace(words[2], str(counts[element]), 1)
            last[element] = len(out)
        elif words[:1] == ["property"]:
            if words[-1] in drop.get(element, set()):
                continue
            line = retype.get((element, words[-1]), line)
            last[element] = len(out)
        out.append(line)
    for name, lines in sorted(add.items(), key=lambda item: -last[item[0]]):
        out[last[name] + 1 : last[name] + 1] = lines
    newline = layout.newline.decode()
    return (newline.join(out) + newline).encode("latin-1")


def assemble(layout: Layout, head: bytes, blocks: dict[str, bytes]) -> bytes:
    """Header and elements, changed or as they were, and whatever lies behind them."""
    parts = [head]
    done = layout.body
    for e in layout.elements:
        end = int(layout.byte(e.row[-1:])[0])
        parts.append(blocks[e.name] if e.name in blocks else layout.data[done:end])
        done = end
    parts.append(layout.data[done:])
    return b"".join(parts)


def uv_at_faces(place: str | None) -> bool:
    """Whether uv go to faces: only where the user says so. Raises OptionError for another word than the two."""
    if place not in (None, "vertex", "face"):
        raise OptionError(f"unknown place for uv {place!r}: choose vertex or face")
    return place == "face"


def uv_properties(layout: Layout) -> dict[str, set[str]]:
    """The properties of vertices and faces that hold uv now."""
    face = {"texcoord"} if layout.element("face").find("texcoord") else set()
    return {"vertex": set(vertex_uv(layout.element("vertex")) or ()), "face": face}


def with_face_uv(
    layout: Layout, lists: FaceLists, uv: FloatArray, corner_uv: IntArray, code: str
) -> bytes:
    """The file with a texcoord list for every face. corner_uv: (L,) of all face corners, −1 for 0, 0."""
    face, vertex = layout.element("face"), layout.element("vertex")
    drop = uv_properties(layout)
    size = np.diff(lists.polys.start)[: lists.n_faces]
    count_code = "u1" if int(size.max(initial=0)) * 2 < 256 else "i4"
    text, length = scalars(layout, np.concatenate([uv, np.zeros((1, 2))]), code)
    at = np.cumsum(length) - length
    length = length[corner_uv]
    pairs = take_ranges(text, at[corner_uv], length)
    piece = list_piece(scalars(layout, 2 * size[:, None], count_code), size, (pairs, length))
    blocks = {}
    if face.count:
        blocks["face"] = rebuild(layout, face, drop["face"], piece)
    if drop["vertex"]:
        blocks["vertex"] = rebuild(layout, vertex, drop["vertex"])
    line = f"property list {_NAMES[count_code]} {_NAMES[code]} texcoord"
    return assemble(layout, header(layout, drop, {"face": [line]}, {}, {}), blocks)


def with_vertex_uv(layout: Layout, lists: FaceLists, split: Split, code: str) -> bytes:
    """The file with uv at every vertex, vertices duplicated where a seam runs."""
    vertex = layout.element("vertex")
    drop = uv_properties(layout)
    names = vertex_uv(vertex) or ("s", "t")
    uv = scalars(layout, split.uv, code)
    blocks = {"vertex": rebuild(layout, vertex, drop["vertex"], uv, rows=split.source)}
    counts = {"vertex": len(split.source)}
    retype: dict[tuple[str, str], str] = {}
    for name in ("face", "tristrips"):
        e = layout.element(name)
        if e.count == 0:
            continue
        replace = {}
        indices = e.find(*INDICES)
        if split.added and indices is not None:
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
            retype[name, indices.name] = (
                f"property list {_NAMES[count_code]} {_NAMES[kind]} {indices.name}"
            )
            heads = scalars(layout, sizes[:, None], count_code)
            replace[indices.name] = list_piece(heads, sizes, scalars(layout, values[:, None], kind))
        if replace or drop.get(name):
            blocks[name] = rebuild(layout, e, drop.get(name, set()), replace=replace)
    add = {"vertex": [f"property {_NAMES[code]} {name}" for name in names]}
    return assemble(layout, header(layout, drop, add, counts, retype), blocks)


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
