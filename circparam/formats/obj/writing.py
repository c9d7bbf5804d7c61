"""Uv in the text of an OBJ file, every other byte kept, and any document as a new OBJ."""

import re
from collections.abc import Sequence

import numpy as np

from circparam.core.arrays import mask_of, ranges
from circparam.core.types import FloatArray, IntArray
from circparam.formats.document import (
    Document,
    Encoded,
    WriteOptions,
    exported_grouping,
    not_carried,
)
from circparam.formats.obj.reading import Scan
from circparam.formats.page_names import NOTE_START, page_lines
from circparam.formats.tokens import SLASH, as_bytes, digits, interleave, splice
from circparam.mesh.mesh import UVMap

# comments on lines of their own: the owner of an atlas, and a page of a layout
GROUPING = rb"# circparam group_by (primitive|mesh)[ \t]*"
PAGE_COMMENT = f"# {NOTE_START}".encode() + rb"\d+[^\r\n]*"


def comments(scan: Scan, kinds: bytes) -> list[re.Match[bytes]]:
    """The lines that match GROUPING, PAGE, or an alternative of both."""
    if b"# circparam " not in scan.data:
        return []
    line = rb"^(?:" + kinds + rb")(?:\r\n|\r|\n|\Z)"
    return list(re.finditer(line, scan.data, re.MULTILINE))


def new_comments(group_by: str | None, pages: Sequence[str], newline: str) -> bytes:
    """The lines that name the owner of an atlas, none for the whole file, and the pages of a layout."""
    lines = [f"circparam group_by {group_by}"] if group_by is not None else []
    return "".join(f"# {line}{newline}" for line in [*lines, *page_lines(pages)]).encode()


def with_uv(
    scan: Scan, uv: FloatArray, corner: IntArray, group_by: str | None = None, pages: Sequence[str] = ()
) -> bytes:  # fmt: skip
    """The file with the given uv (k, 2) and, for every face corner, (L,) its number (from 0; −1: none).

    group_by: owner of an atlas, 'primitive' or 'mesh'; None is the whole file. pages: names of the pages.
    """
    t = scan.tokens
    head = scan.raw[: int(t.line_start[1])].tobytes() if len(t.line_start) > 1 else b""
    newline = "\r\n" if head.endswith(b"\r\n") else "\r" if head and b"\n" not in head else "\n"
    block = as_bytes(new_comments(group_by, pages, newline) + vt_lines(uv, newline))
    # what goes: old vt lines, comments on the old layout, and vt of elements
    old = scan.of(b"vt")
    ends = np.append(t.line_start, len(scan.raw))
    spans = [found.span() for found in comments(scan, GROUPING + b"|" + PAGE_COMMENT)]
    gone = np.concatenate(
        [
            np.stack([ends[old], ends[old + 1]], 1),
            np.array(spans, np.int64).reshape(-1, 2),
            element_edits(scan),
        ]
    )
    # the new lines stand in place of the first vt, or before the first face
    where = min([int(t.line_start[scan.face_lines[0]]), *t.line_start[old[:1]].tolist()])
    # edits after which every corner names the given vt (from 0; −1: none)
    _, start, end = scan.cuts
    text, length = digits(np.maximum(corner, 0) + 1, b"/")
    none = corner < 0
    if none.any():  # a corner without uv keeps "//" only where a normal follows
        keep = np.repeat(~none, length)
        normal = none & (scan.tokens.clean[end] == SLASH)
        text, length = text[keep], np.where(none, 0, length)
        first = np.cumsum(length) - length
        text = np.insert(text, first[normal], SLASH)
        length = length + normal
    starts = np.concatenate([[where], gone[:, 0], start])
    ends = np.concatenate([[where], gone[:, 1], end])
    lengths = np.concatenate([[len(block)], np.zeros(len(gone), np.int64), length])
    order = np.argsort(starts, kind="stable")  # the block comes before lines that are removed there
    inserted = np.concatenate([block, text])
    return splice(scan.raw, starts[order], ends[order], inserted, lengths[order])


def vt_lines(uv: FloatArray, newline: str) -> bytes:
    """One vt line for each uv, with the shortest digits that read back to the same numbers."""
    u, v = uv[:, 0].tolist(), uv[:, 1].tolist()
    return "".join([f"vt {a!r} {b!r}{newline}" for a, b in zip(u, v, strict=True)]).encode()


def compact(corner: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Keep only the uv that corners use, in order: ((k,) uv kept, (L,) renumbered corners, −1 kept)."""
    used = mask_of(count + 1, corner)
    used[count] = False
    number = np.cumsum(used) - 1
    number[count] = -1
    return np.flatnonzero(used), number[corner]


def element_edits(scan: Scan) -> IntArray:
    """(k, 2) byte ranges of the vt fields of ``l`` elements: they name points that are gone."""
    lines = scan.of(b"l")
    count = scan.last[lines] - scan.first[lines] - 1
    tokens = np.repeat(scan.first[lines] + 1, count) + ranges(count)
    if len(tokens) == 0:
        return np.zeros((0, 2), np.int64)
    _, start, end = scan.fields(tokens, 2)
    return np.stack([start, end], 1)[end > start]


def to_obj(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """OBJ: points in order, polygons kept, a ``usemtl`` line where the group changes."""
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
    of_corner = np.repeat(np.arange(len(size)), size)
    per_face = np.bincount(of_corner, length, len(size)).astype(np.int64)
    head = np.full(len(size), 1)
    head_text = [b"f"] * len(size)
    some = size > 2  # fewer corners are no face
    names, label = _polygon_groups(document, polys.owner, len(size))
    if names:
        change = np.flatnonzero(np.diff(label[some], prepend=-1))
        for f in np.flatnonzero(some)[change].tolist():
            head_text[f] = b"usemtl " + names[label[f]] + b"\nf"
        head = np.array([len(h) for h in head_text])
    one = np.ones(len(size), np.int64)
    ends = as_bytes(b"\n" * len(size)), one
    heads = as_bytes(b"".join(head_text)), head
    body, lengths = interleave([heads, (text, per_face), ends])
    lines = body[np.repeat(some, lengths)].tobytes() if not some.all() else body.tobytes()
    said = new_comments(exported_grouping(document, options.group_by), options.pages, "\n")
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
