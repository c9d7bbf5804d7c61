"""Wavefront OBJ: an array scanner that remembers where every byte is, and a writer that edits them.

In the output every line of the input stays byte for byte, except ``vt`` lines and the vt field of ``f``. Old
``vt`` lines go. New ones stand in place of the first, or before the first face.
"""

import re
from collections.abc import Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from circparam.core.arrays import mask_of, ranges, relabel, unit
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.document import (
    NOTE_START,
    Document,
    Encoded,
    Named,
    WriteOptions,
    exported_grouping,
    not_carried,
    page_lines,
)
from circparam.formats.looks import Looks
from circparam.formats.materials import Textures
from circparam.formats.obj import materials
from circparam.formats.obj.reading import Scan
from circparam.formats.polygons import Polygons, triangulate
from circparam.formats.source import Source
from circparam.formats.tokens import SLASH, ByteArray, as_bytes, digits, interleave, splice
from circparam.mesh.mesh import UVMap

# comments on lines of their own: the owner of an atlas, and a page of a layout
GROUPING = rb"# circparam group_by (primitive|mesh)[ \t]*"
PAGE_COMMENT = f"# {NOTE_START}".encode() + rb"\d+[^\r\n]*"


@dataclass(frozen=True, eq=False)
class ObjDocument(Document):
    """An OBJ file: its bytes, where its lines are, and the corners of its faces."""

    own_formats, only_first, holds_images = ("obj",), True, True
    scan: Scan = field(kw_only=True)
    polys: Polygons = field(kw_only=True)
    corner_vt: IntArray = field(kw_only=True)

    @cached_property
    def texture_points(self) -> FloatArray:
        """(k, 2) the vt lines of the file."""
        scan = self.scan
        return scan.numbers(scan.of(b"vt"), 2, optional=1)

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """The vt of every corner; None for any set but 0, or where no corner has one."""
        if uv_set not in self.uv_sets:
            return None
        return UVMap(self.texture_points, self.corner_vt[self.polys.triangles])

    def group_by(self, uv_set: int = 0) -> str | None:
        """Owner of an atlas, from a comment before the vt lines."""
        said = comments(self.scan, GROUPING)
        return None if not said else said[-1].group(1).decode()

    def labels(self, kind: str) -> IntArray:
        """(m,) label of each face by material, by ``o`` name for 'mesh', or one for 'scene'."""
        if kind == "mesh":
            return relabel(self.scan.sections(b"o")[1][self.polys.owner])[1]
        return super().labels(kind)

    def named(self, kind: str) -> Named | None:
        """Names of ``usemtl`` for materials, of ``g`` for groups, of ``o`` for nodes."""
        words = {"material": b"usemtl", "group": b"g", "node": b"o"}
        names, at = self.scan.sections(words[kind])
        if len(names) == 1:
            return None
        number, of_face = _numbered(names, at)
        pairs = tuple((name.decode("utf-8", "replace"), k) for name, k in number.items() if name)
        return Named(of_face[self.polys.owner], pairs)

    def colours(self) -> FloatArray | None:
        """The colours behind the coordinates of ``v``, as many programs write them."""
        scan, lines = self.scan, self.scan.of(b"v")
        given = scan.last[lines] - scan.first[lines] - 1
        if not (given >= 6).any():
            return None
        values = scan.numbers(lines, 6, optional=3)[:, 3:]
        values[given < 6] = 1.0  # vertices without one are white
        # some programs write 0..255: then some value is above 1
        whole = 255.0 if values.max(initial=0) > 1.0 else 1.0
        return np.clip(values / whole, 0, 1)[self.mesh.faces]

    def normals(self) -> FloatArray | None:
        """The vn of every corner, that of its triangle where it has no direction; None if one lacks a vn."""
        rows = self.scan.corner_normals()
        if rows is None:
            return None
        normal = rows[self.polys.triangles]
        lost = (normal == 0).all(axis=2)
        if lost.all():
            return None
        if lost.any():
            a, b, c = np.moveaxis(self.mesh.corners, 1, 0)
            flat = unit(np.cross(b - a, c - a))
            normal = np.where(lost[:, :, None], flat[:, None], normal)
        return normal

    def textures(self) -> Textures | None:
        """The diffuse images and colours of the material files that ``mtllib`` names."""
        return materials.textures(self.scan, self.polys.owner, self.source)

    def looks(self) -> Looks | None:
        """The materials of the libraries that ``mtllib`` names."""
        return materials.read_looks(self.scan, self.polys.owner, self.source)

    def edited(
        self, uvmap: UVMap, number: int, options: WriteOptions, format: str, stem: str
    ) -> Encoded:
        """The same file with new vt lines and vt fields."""
        corner = self.polys.corner_uv(uvmap, self.source.name)
        used, corner = compact(corner, len(uvmap.uv))
        data = with_uv(self.scan, uvmap.uv[used], corner, options.group_by, options.pages)
        lost = "l and surf elements lost their vt: they named points of the old uv set"
        notes = [lost] if len(element_edits(self.scan)) else []
        assets, extra = self.scan.libraries(), dict[str, bytes]()
        if self.carried is not None and (found := self.looks()) is not None:
            assets = []
            data, extra = materials.redressed(
                data, self.scan, self.source, found, self.carried, stem
            )
        return self.encoded(data, "obj", extra=extra, assets=assets, notes=notes)


def read_obj(data: bytes, source: Source) -> ObjDocument:
    """Read an OBJ file. Raises InputError for bad numbers, indices, or a file without faces."""
    if b"\0" in data:
        wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
        what = (
            "text in UTF-16: save it as UTF-8" if wide else "binary data where OBJ text is expected"
        )
        raise source.error(what)
    scan = Scan(data, source)
    v = scan.of(b"v")
    if len(scan.face_lines) == 0:
        what = "it has no faces" if len(v) else "it has no v and f lines: this is not an OBJ mesh"
        raise source.error(what)
    points = scan.numbers(v, 3)
    corners = scan.resolve(0, b"v", len(points))
    vt = scan.resolve(1, b"vt", len(scan.of(b"vt")))
    polys = triangulate(points, corners, scan.corner_start)
    groups, names = _groups(scan)
    mesh = polys.mesh(points, None if groups is None else groups[polys.owner], counted_from=1)
    features = {
        "polygons": polys.labels is not None,
        "normals": len(scan.of(b"vn")) > 0,
        "vertex colours": bool((scan.last[v] - scan.first[v] > 6).any()),
        "materials": len(scan.of(b"usemtl")) > 0,
        "groups": len(scan.of(b"g")) + len(scan.of(b"o")) > 0,
        "smoothing groups": len(scan.of(b"s")) > 0,
        "line and point elements": len(scan.of(b"l")) + len(scan.of(b"p")) > 0,
    }
    return ObjDocument(
        source, "obj", mesh, (0,) if (vt >= 0).any() else (), [],
        tuple(k for k, has in features.items() if has), tuple(names),
        polys=polys, corner_vt=vt, scan=scan,
    )  # fmt: skip


def _numbered(names: list[bytes], at: IntArray) -> tuple[dict[bytes, int], IntArray]:
    """(a number for each distinct name of sections, (p,) that of each face)."""
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return number, np.array([number[name] for name in names], np.int64)[at]


def _groups(scan: Scan) -> tuple[IntArray | None, list[str]]:
    """(p,) label of each face by material, or by object and group where no material is named."""
    names, at = scan.sections(b"usemtl")
    if len(names) == 1:
        names, at = scan.sections(b"o", b"g")
    number, of_face = _numbered(names, at)
    count, groups = relabel(of_face)
    if count == 1:
        return None, []
    first = np.sort(np.unique(of_face, return_index=True)[1])
    ordered = list(number)
    return groups, [ordered[k].decode("utf-8", "replace") for k in of_face[first].tolist()]


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
    scan: Scan, uv: FloatArray, corner: IntArray, group_by: str | None, pages: Sequence[str]
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
    text, length = vt_fields(corner)
    none = corner < 0
    if none.any():  # a corner without uv keeps "//" only where a normal follows
        normal = none & (scan.tokens.clean[end] == SLASH)
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


def vt_fields(corner: IntArray) -> tuple[ByteArray, IntArray]:
    """The vt fields of corners (L,): (text, (L,) length of each, 0 for a corner without uv)."""
    text, length = digits(np.maximum(corner, 0) + 1, b"/")
    has = corner >= 0
    return (text, length) if has.all() else (text[np.repeat(has, length)], np.where(has, length, 0))


def compact(corner: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Keep only the uv that corners use, in order: ((k,) uv kept, (L,) renumbered corners, −1 kept)."""
    used = mask_of(count + 1, corner)
    used[count] = False
    number = np.cumsum(used) - 1
    number[count] = -1
    return np.flatnonzero(used), number[corner]


def element_edits(scan: Scan) -> IntArray:
    """(k, 2) byte ranges of the vt fields of ``l`` and ``surf`` elements: they name points that are gone."""
    tokens = []
    # four bounds of its parameters stand before the control points of a surface
    for lines, before in ((scan.of(b"l"), 0), (scan.lines(b"surf")[0], 4)):
        count = np.maximum(scan.last[lines] - scan.first[lines] - 1 - before, 0)
        tokens.append(np.repeat(scan.first[lines] + 1 + before, count) + ranges(count))
    corners = np.concatenate(tokens)
    if len(corners) == 0:
        return np.zeros((0, 2), np.int64)
    _, start, end = scan.fields(corners, 2)
    # the slash before a normal stays: v//vn
    start = start + (scan.tokens.clean[np.minimum(end, len(scan.tokens.clean) - 1)] == SLASH)
    return np.stack([start, end], 1)[end > start]


def to_obj(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """OBJ: points in order, polygons kept, a ``usemtl`` line where the group changes."""
    polys = document.polygons()
    corner = polys.corner_uv(uvmap, document.source.name)
    used, corner = compact(corner, len(uvmap.uv))
    points = "".join([f"v {x!r} {y!r} {z!r}\n" for x, y, z in document.mesh.points.tolist()])
    size = np.diff(polys.start)
    v, v_size = digits(polys.corners + 1, b" ")
    text, length = interleave([(v, v_size), vt_fields(corner)])
    of_corner = np.repeat(np.arange(len(size)), size)
    per_face = np.bincount(of_corner, length, len(size)).astype(np.int64)
    head = np.full(len(size), 1)
    head_text = [b"f"] * len(size)
    some = size > 2  # fewer corners are no face
    if (groups := document.mesh.groups) is not None:
        label = np.zeros(len(size), np.int64)
        label[polys.owner] = groups
        change = np.flatnonzero(np.diff(label[some], prepend=-1))
        for f in np.flatnonzero(some)[change].tolist():
            name = "_".join(document.group_name(int(label[f])).split())
            head_text[f] = b"usemtl " + name.encode() + b"\nf"
        head = np.array([len(h) for h in head_text])
    one = np.ones(len(size), np.int64)
    ends = as_bytes(b"\n" * len(size)), one
    heads = as_bytes(b"".join(head_text)), head
    body, lengths = interleave([heads, (text, per_face), ends])
    lines = body[np.repeat(some, lengths)].tobytes() if not some.all() else body.tobytes()
    said = new_comments(exported_grouping(document, options.group_by), options.pages, "\n")
    data = points.encode() + said + vt_lines(uvmap.uv[used], "\n") + lines
    notes, warnings = not_carried(document, "obj", "polygons", "groups")
    return document.encoded(data, "obj", notes=notes, warnings=warnings)
