"""Wavefront OBJ: an array scanner that remembers where every byte is, and a writer that edits them.

In the output every line of the input stays byte for byte, except ``vt`` lines and the vt field of ``f``. Old
``vt`` lines go. New ones stand in place of the first, or before the first face.
"""

from dataclasses import field
from functools import cached_property

import numpy as np

from circparam.core.arrays import relabel, unit
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.document import Document, Encoded, Named, WriteOptions
from circparam.formats.looks import Looks
from circparam.formats.materials import Textures
from circparam.formats.obj import materials
from circparam.formats.obj.reading import Scan
from circparam.formats.obj.writing import GROUPING, comments, compact, element_edits, with_uv
from circparam.formats.polygons import Polygons, triangulate
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap


@dataclass(frozen=True, eq=False)
class ObjDocument(Document):
    """An OBJ file: its bytes, where its lines are, and the corners of its faces."""

    own_formats, only_first, holds_images = ("obj",), True, True
    scan: Scan = field(kw_only=True)
    polys: Polygons = field(kw_only=True)
    corner_vt: IntArray = field(kw_only=True)

    def polygons(self) -> Polygons:
        """The faces of the file."""
        return self.polys

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
            lines, _ = self.scan.lines(b"o")
            return relabel(np.searchsorted(lines, self.scan.face_lines)[self.polys.owner])[1]
        return super().labels(kind)

    def named(self, kind: str) -> Named | None:
        """Names of ``usemtl`` for materials, of ``g`` for groups, of ``o`` for nodes."""
        words = {"material": b"usemtl", "group": b"g", "node": b"o"}
        lines, names = self.scan.lines(words[kind])
        if len(lines) == 0:
            return None
        number, of_face = _numbered(self.scan, lines, names)
        pairs = tuple((name.decode("utf-8", "replace"), k) for name, k in number.items() if name)
        return Named(of_face[self.polys.owner], pairs)

    def colours(self) -> FloatArray | None:
        """The colours behind the coordinates of ``v``, as many programs write them."""
        return materials.colours(self.scan, self.mesh.faces)

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
            a, b, c = np.moveaxis(self.mesh.points[self.mesh.faces], 1, 0)
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
        lost = "l elements lost their vt: they named points of the old uv set"
        notes = [lost] if len(element_edits(self.scan)) else []
        assets, extra = self.scan.libraries(), dict[str, bytes]()
        found = None if self.carried is None else self.looks()
        if self.carried is not None and found is not None:
            assets = []
            data, extra = materials.redressed(
                data, self.scan, self.source, found, self.carried, stem
            )
        n, m = len(self.mesh.points), len(self.mesh.faces)
        return Encoded(data, "obj", np.arange(n), np.arange(m), extra, assets, notes)


def read_obj(data: bytes, source: Source) -> ObjDocument:
    """Read an OBJ file. Raises InputError for bad numbers, indices, or a file without faces."""
    if b"\0" in data:
        raise source.error("binary data where OBJ text is expected")
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
    mesh = Mesh(
        points,
        corners[polys.triangles],
        polygons=polys.labels,
        groups=None if groups is None else groups[polys.owner],
        counted_from=1,
    )
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


def _numbered(scan: Scan, lines: IntArray, names: list[bytes]) -> tuple[dict[bytes, int], IntArray]:
    """(a number for each distinct name, (p,) that of each face); faces before the first line have 0."""
    number = {name: k for k, name in enumerate(dict.fromkeys([b"", *names]))}
    label = np.array([0, *(number[name] for name in names)], np.int64)
    return number, label[np.searchsorted(lines, scan.face_lines)]


def _groups(scan: Scan) -> tuple[IntArray | None, list[str]]:
    """(p,) label of each face by material, or by object and group where no material is named."""
    lines, names = scan.lines(b"usemtl")
    if len(lines) == 0:
        tagged = sorted(
            (int(line), name)
            for word in (b"o", b"g")
            for line, name in zip(*scan.lines(word), strict=True)
        )
        lines = np.array([line for line, _ in tagged], np.int64)
        names = [name for _, name in tagged]
    if len(lines) == 0:
        return None, []
    number, of_face = _numbered(scan, lines, names)
    count, groups = relabel(of_face)
    if count == 1:
        return None, []
    first = np.sort(np.unique(of_face, return_index=True)[1])
    ordered = list(number)
    return groups, [ordered[k].decode("utf-8", "replace") for k in of_face[first].tolist()]
