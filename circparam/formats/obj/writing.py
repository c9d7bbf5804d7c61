"""Uv in the text of an OBJ file, every other byte kept, and any document as a new OBJ."""

import re
from collections.abc import Sequence

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, ranges
from circparam.formats.document import (
    Document,
    Encoded,
    WriteOptions,
    check_new_set,
    exported_grouping,
    not_carried,
)
from circparam.formats.obj.reading import Scan
from circparam.formats.page_names import START, page_lines
from circparam.formats.polygons import polygon_of_corner
from circparam.formats.tokens import NEWLINE, SLASH, ByteArray, as_bytes, digits, interleave, splice
from circparam.mesh.mesh import UVMap

_GROUPING = b"# circparam group_by "  # a comment on its own line; behind it: primitive or mesh
_PAGE = f"# {START}".encode()


def groupings(scan: Scan) -> list[re.Match[bytes]]:
    """The lines that name the owner of an atlas."""
    if _GROUPING not in scan.data:
        return []
    line = rb"^" + _GROUPING + rb"(primitive|mesh)[ \t]*(?:\r\n|\r|\n|\Z)"
    return list(re.finditer(line, scan.data, re.MULTILINE))


def grouping_line(group_by: str | None, newline: str) -> bytes:
    """The line that names the owner of an atlas; none for the whole file."""
    return b"" if group_by is None else _GROUPING + f"{group_by}{newline}".encode()


def _page_comments(scan: Scan) -> list[re.Match[bytes]]:
    """The lines that name pages of an earlier layout."""
    if _PAGE not in scan.data:
        return []
    line = rb"^" + _PAGE + rb"\d+[^\r\n]*(?:\r\n|\r|\n|\Z)"
    return list(re.finditer(line, scan.data, re.MULTILINE))


def page_comments(pages: Sequence[str], newline: str) -> bytes:
    """The lines that name the pages of a layout, as ``# circparam page 1001 steel``."""
    return "".join(f"# {line}{newline}" for line in page_lines(pages)).encode()


def with_uv(
    scan: Scan,
    uv: FloatArray,
    corner: IntArray,
    group_by: str | None = None,
    pages: Sequence[str] = (),
) -> bytes:
    """The file with the given uv (k, 2) and, for every face corner, (L,) its number (from 0; −1: none).

    group_by: owner of an atlas, 'primitive' or 'mesh'; None is the whole file. pages: names of the pages.
    """
    start, end, text, length = corner_edits(scan, corner)
    block, drop_start, drop_end, where = vt_edits(scan, uv, group_by, pages)
    e_start, e_end = element_edits(scan)
    empty = np.zeros(len(drop_start) + len(e_start), np.int64)
    starts = np.concatenate([[where], drop_start, e_start, start])
    ends = np.concatenate([[where], drop_end, e_end, end])
    lengths = np.concatenate([[len(block)], empty, length])
    order = np.argsort(starts, kind="stable")  # the block comes before lines that are removed there
    # the block stands before every face, so its text comes first
    inserted = np.concatenate([as_bytes(block), text])
    return splice(scan.raw, starts[order], ends[order], inserted, lengths[order])


def vt_lines(uv: FloatArray, newline: str) -> bytes:
    """One vt line for each uv, with the shortest digits that read back to the same numbers."""
    u, v = uv[:, 0].tolist(), uv[:, 1].tolist()
    return "".join([f"vt {a!r} {b!r}{newline}" for a, b in zip(u, v, strict=True)]).encode()


def compact(corner: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Keep only the uv that corners use, in order: ((k,) uv kept, (L,) renumbered corners, −1 kept)."""
    used = np.zeros(count + 1, bool)
    used[corner] = True
    used[count] = False
    number = np.cumsum(used) - 1
    number[count] = -1
    return np.flatnonzero(used), number[corner]


def corner_edits(scan: Scan, uv: IntArray) -> tuple[IntArray, IntArray, ByteArray, IntArray]:
    """Edits after which every corner names the given vt (from 0; −1: none)."""
    _, start, end = scan.cuts
    text, length = digits(np.maximum(uv, 0) + 1, b"/")
    none = uv < 0
    if none.any():  # a corner without uv keeps "//" only where a normal follows
        keep = np.repeat(~none, length)
        normal = none & (scan.tokens.clean[end] == SLASH)
        text, length = text[keep], np.where(none, 0, length)
        first = np.cumsum(length) - length
        text = np.insert(text, first[normal], SLASH)
        length = length + normal
    return start, end, text, length


def vt_edits(
    scan: Scan, uv: FloatArray, group_by: str | None, pages: Sequence[str]
) -> tuple[bytes, IntArray, IntArray, int]:
    """The new vt lines and their comment, the byte ranges of the old ones, and where the new ones go."""
    t = scan.tokens
    old = scan.of(b"vt")
    start = t.line_start[old]
    end = np.append(t.line_start, len(scan.raw))[old + 1]
    where = int(t.line_start[scan.face_lines[0]])
    if len(start) and start[0] < where:
        where = int(start[0])
    head = scan.raw[: int(t.line_start[1])] if len(t.line_start) > 1 else scan.raw[:0]
    newline = "\r\n" if head[-2:].tobytes() == b"\r\n" else "\n"
    if NEWLINE not in head and len(head):
        newline = "\r"
    lines = (*groupings(scan), *_page_comments(scan))
    said = np.array([found.span() for found in lines], np.int64).reshape(-1, 2)
    start, end = np.concatenate([start, said[:, 0]]), np.concatenate([end, said[:, 1]])
    named = page_comments(pages, newline)
    return grouping_line(group_by, newline) + named + vt_lines(uv, newline), start, end, where


def element_edits(scan: Scan) -> tuple[IntArray, IntArray]:
    """Byte ranges of the vt fields of ``l`` elements: they name points that are gone."""
    lines = scan.of(b"l")
    count = scan.last[lines] - scan.first[lines] - 1
    tokens = np.repeat(scan.first[lines] + 1, count) + ranges(count)
    if len(tokens) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    _, start, end = scan.fields(tokens, 2)
    some = end > start
    return start[some], end[some]


def to_obj(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """OBJ: points in order, polygons kept, a ``usemtl`` line where the group changes."""
    check_new_set(options, "obj")
    polys = document.polygons()
    corner = polys.corner_uv(uvmap, document.source.name)
    used, corner = compact(corner, len(uvmap.uv))
    points = "".join([f"v {x!r} {y!r} {z!r}\n" for x, y, z in document.mesh.points.tolist()])
    size = np.diff(polys.start)
    v, v_size = digits(polys.corners + 1, b" ")
    t, t_size = digits(np.maximum(corner, 0) + 1, b"/")
    if (corner < 0).any():
        t, t_size = t[np.repeat(corner >= 0, t_size)], np.where(corner < 0, 0, t_size)
    text, length = interleave([(v, v_size), (t, t_size)])
    per_face = np.bincount(polygon_of_corner(polys.start), length, len(size)).astype(np.int64)
    head = np.full(len(size), 1)
    head_text = [b"f"] * len(size)
    some = size > 2  # fewer corners are no face
    names, label = _polygon_groups(document, polys.owner, len(size))
    if names:
        change = np.flatnonzero(np.diff(label[some], prepend=-1))
        for f in np.flatnonzero(some)[change].tolist():
            head_text[f] = b"usemtl " + names[label[f]] + b"\nf"
        head = np.array([len(h) for h in head_text])
    newline = np.full(len(size), 1)
    body, lengths = interleave(
        [
            (as_bytes(b"".join(head_text)), head),
            (text, per_face),
            (as_bytes(b"\n" * len(size)), newline),
        ]
    )
    lines = body[np.repeat(some, lengths)].tobytes() if not some.all() else body.tobytes()
    said = grouping_line(exported_grouping(document, options.group_by), "\n")
    said += page_comments(options.pages, "\n")
    data = points.encode() + said + vt_lines(uvmap.uv[used], "\n") + lines
    n, m = len(document.mesh.points), len(document.mesh.faces)
    notes, warnings = not_carried(document, "obj", "polygons", "groups")
    return Encoded(data, "obj", np.arange(n), np.arange(m), notes=notes, warnings=warnings)


def _polygon_groups(
    document: Document, owner: IntArray, count: int
) -> tuple[list[bytes], IntArray]:
    """Names as OBJ takes them, and the label of each polygon."""
    groups = document.mesh.groups
    if groups is None:
        return [], np.zeros(0, np.int64)
    label = np.zeros(count, np.int64)
    label[owner] = groups
    names = map(document.group_name, range(int(groups.max()) + 1))
    return ["_".join(name.split()).encode() for name in names], label
