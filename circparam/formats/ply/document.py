"""PLY: every element and property kept, uv as vertex ``s, t`` or as face ``texcoord`` lists."""

import re
from dataclasses import field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import OptionError
from circparam.formats.document import Document, Encoded, WriteOptions, not_carried
from circparam.formats.looks import Carried, Looks, Material, Slot, Use
from circparam.formats.materials import ImageFiles, Textures
from circparam.formats.ply import writing
from circparam.formats.ply.reading import INDICES, UV_NAMES, FaceLists, Layout, vertex_uv
from circparam.formats.polygons import Polygons, check_corners, list_start, strips, triangulate
from circparam.formats.source import Source
from circparam.formats.vertex_split import duplicated, split_vertices
from circparam.mesh.mesh import UVMap

CHANNELS = ("red", "green", "blue")
IMAGE = Slot("texture", (0, 1, 2, 3), "texture", True)
_TEXTURE_LINE = re.compile(r"(\s*comment\s+TextureFile\s+)(\S.*)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class PlyDocument(Document):
    """A PLY file: its bytes, the place of every value, and its polygons and strips."""

    own_formats, only_first, holds_images = ("ply",), True, True
    layout: Layout = field(kw_only=True)
    lists: FaceLists = field(kw_only=True)

    def polygons(self) -> Polygons:
        """The faces of the file, and the triangles of its strips."""
        return self.lists.polys

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """Face texcoord where there is one, else vertex s, t (or u, v; texture_u, texture_v)."""
        if uv_set not in self.uv_sets:
            return None
        layout = self.layout
        face = layout.element("face")
        if face.find("texcoord"):
            return self._face_uv(*layout.list(face, "texcoord"))
        vertex = layout.element("vertex")
        names = vertex_uv(vertex)
        if names is None:
            return None
        return UVMap(layout.columns(vertex, names), self.mesh.faces.copy())

    def _face_uv(self, values: npt.NDArray[Any], counts: IntArray) -> UVMap:
        """The layout of texcoord lists: all values one after the other, and (n,) the number of each face."""
        polys, n = self.lists.polys, self.lists.n_corners
        size = np.diff(polys.start)[: self.lists.n_faces]
        fits = counts == 2 * size
        of = np.repeat(np.arange(len(size)), size)
        # pairs of one list lie side by side; a list of odd length can shift those behind it
        at = list_start(counts)[:-1][of] + 2 * (np.arange(n) - polys.start[of])
        at = np.where(fits[of], at, 0)
        uv = np.stack([values[at], values[at + 1]], 1) if len(values) > 1 else np.zeros((n, 2))
        corner = np.full(len(polys.corners), -1, np.int64)
        corner[:n] = np.where(fits[of], np.arange(n), -1)
        return UVMap(uv.astype(np.float64), corner[polys.triangles])

    @property
    def uv_type(self) -> str:
        """The type of uv in the file: 'f8' where it stores doubles, else 'f4', which all readers know."""
        layout = self.layout
        face, vertex = layout.element("face"), layout.element("vertex")
        held = face.find("texcoord") or vertex.find(*(vertex_uv(vertex) or ())[:1])
        return "f8" if held is not None and held.type == "f8" else "f4"

    def colours(self) -> FloatArray | None:
        """red, green, blue of the vertices, or else of the faces; triangles of strips are white then."""
        vertex, face = self.layout.element("vertex"), self.layout.element("face")
        for element in (vertex, face):
            found = [element.find(name) for name in CHANNELS]
            if not all(found):
                continue
            values = self.layout.columns(element, CHANNELS)
            codes = {p.type for p in found if p is not None}
            values = values / (255.0 if "u1" in codes else 65535.0 if "u2" in codes else 1.0)
            values = np.clip(values, 0, 1)
            if element is vertex:
                return values[self.mesh.faces]
            owner = self.lists.polys.owner
            white = np.ones((max(int(owner.max(initial=-1)) + 1 - len(values), 0), 3))
            return np.repeat(np.concatenate([values, white])[owner][:, None], 3, axis=1)
        return None

    def looks(self) -> Looks | None:
        """The image that a TextureFile comment names, as one material.

        Raises InputError if it is missing, or where faces take theirs from several.
        """
        names = texture_files(self.layout.lines)
        if not names:
            return None
        if len(names) > 1:
            raise self.source.error(
                f"it has {len(names)} TextureFile lines: only one image can be carried, save it as OBJ"
            )
        files = ImageFiles(self.source, strict=True)
        files.read(names[0])
        material = Material("", {IMAGE: Use(0)}, {IMAGE: np.ones(4)})
        face = np.zeros(len(self.mesh.faces), np.int64)
        return Looks(tuple(files.images), (names[0],), (material,), face)

    def textures(self) -> Textures | None:
        """The first image that a TextureFile comment names, as MeshLab writes it."""
        files, m = ImageFiles(self.source), len(self.mesh.faces)
        for name in texture_files(self.layout.lines)[:1]:
            return files.textures(np.full(m, files.read(name), np.int64), np.ones((m, 3)))
        return None

    def check_edit(self, options: WriteOptions, format: str) -> None:
        """Raise OptionError for uv of faces in a file with tristrips."""
        if writing.uv_at_faces(options.ply_uv) and len(self.lists.strips):
            raise OptionError(
                f"{self.source.name}: tristrips have no place for uv of faces; use --ply-uv vertex"
            )

    def edited(
        self, uvmap: UVMap, number: int, options: WriteOptions, format: str, stem: str
    ) -> Encoded:
        """The same file with uv in its vertices or faces, and its image."""
        kind = "f8" if options.uv_double else self.uv_type
        polys, layout = self.lists.polys, self.layout
        uv = uvmap.uv.astype(kind).astype(np.float64)
        corner_uv = polys.corner_uv(UVMap(uv, uvmap.uv_faces), self.source.name)
        lines = writing.with_pages(layout.lines, options.pages)
        assets, extra = list(dict.fromkeys(texture_files(lines))), dict[str, bytes]()
        if self.carried is not None:
            assets = []
            lines, extra = redressed(lines, self.carried, stem)
        vertices, notes = None, list[str]()
        if writing.uv_at_faces(options.ply_uv):
            own = corner_uv[: self.lists.n_corners]
            changes = writing.face_changes(layout, self.lists, uv, own, kind)
        else:
            split = split_vertices(len(self.mesh.points), polys.corners, uv, corner_uv)
            changes = writing.vertex_changes(layout, self.lists, split, kind)
            vertices = split.source
            notes = [duplicated(split.added)] if split.added else []
        data = writing.written(layout, lines, changes)
        return self.encoded(data, "ply", vertices, extra=extra, assets=assets, notes=notes)


def read_ply(data: bytes, source: Source) -> PlyDocument:
    """Read a PLY file. Raises InputError if header and body disagree, or it has no faces."""
    if not data.startswith(b"ply"):
        raise source.error("the file does not begin with 'ply': this is not a PLY file")
    layout = Layout(data, source)
    vertex = layout.element("vertex")
    if not all(map(vertex.find, "xyz")):
        raise source.error("it has no vertices with x, y and z")
    points = layout.columns(vertex, ("x", "y", "z"))
    corners, size = _lists(layout, "face", len(points), 0)
    strip_values, strip_counts = _lists(layout, "tristrips", len(points), -1)
    polys = triangulate(points, corners, list_start(size))
    tri = strips(strip_values, list_start(strip_counts))
    if len(polys.triangles) + len(tri) == 0:
        raise source.error("it has no faces (a point cloud?): there is nothing to unwrap")
    if k := len(tri):  # behind the faces
        polys = Polygons(
            np.concatenate([corners, strip_values[tri].ravel()]),
            np.concatenate([polys.start, len(corners) + 3 * np.arange(1, k + 1)]),
            np.concatenate([polys.triangles, len(corners) + np.arange(3 * k).reshape(-1, 3)]),
            np.concatenate([polys.owner, len(size) + np.arange(k)]),
        )
    has_uv = vertex_uv(vertex) is not None or layout.element("face").find("texcoord")
    names = {p.name for e in layout.elements for p in e.properties}
    known = {"x", "y", "z", *INDICES, "texcoord", *(n for pair in UV_NAMES for n in pair)}
    normals, colours = {"nx", "ny", "nz"}, {"red", "green", "blue", "alpha"}
    features = {
        "polygons": polys.labels is not None,
        "normals": bool(names & normals),
        "colours": bool(names & colours),
        "custom properties": bool(names - known - normals - colours),
        "tristrips": "tristrips" in {e.name for e in layout.elements},
    }
    return PlyDocument(
        source, "ply", polys.mesh(points), (0,) if has_uv else (), [],
        tuple(feature for feature, there in features.items() if there),
        layout=layout, lists=FaceLists(polys, len(size), len(corners), tri, strip_counts),
    )  # fmt: skip


def texture_files(header: list[str]) -> list[str]:
    """The images that the lines of a header name, as MeshLab writes them."""
    return [found[2].strip() for found in map(_TEXTURE_LINE.match, header) if found]


def redressed(header: list[str], carried: Carried, stem: str) -> tuple[list[str], dict[str, bytes]]:
    """The lines of a header that name a carried image: (the lines, the image by its name)."""
    name = carried.file_of(IMAGE.page, stem or "mesh")
    known = name.encode("latin-1", "replace").decode("latin-1")
    first = next(k for k, line in enumerate(header) if texture_files([line]))
    line = _TEXTURE_LINE.sub(lambda found: found[1] + known, header[first])
    return [*header[:first], line, *header[first + 1 :]], {name: carried.pages[IMAGE.page]}


def round_ply(uv: FloatArray, document: Document | None) -> FloatArray:
    """uv as PLY stores them: float32, or doubles where the document is a PLY file with uv in doubles."""
    kind = document.uv_type if isinstance(document, PlyDocument) else "f4"
    return uv.astype(kind).astype(np.float64) + 0.0


def to_ply(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """Binary PLY: polygons kept, uv at the vertices, duplicated along seams, or at the faces."""
    polys = document.polygons()
    # a list of uv has two numbers a corner
    longest = 127 if writing.uv_at_faces(options.ply_uv) else 255
    data = writing.plain(document.mesh.points, polys, longest)
    none = np.zeros((0, 3), np.int64)
    plain = PlyDocument(
        document.source, "ply", document.mesh, layout=Layout(data, document.source),
        lists=FaceLists(polys, len(polys.start) - 1, len(polys.corners), none, none[:, 0]),
    )  # fmt: skip
    out = plain.edited(uvmap, 0, options, "ply", stem)
    notes, warnings = not_carried(document, "ply", "polygons")
    return replace(out, notes=[*notes, *out.notes], warnings=warnings)


def _lists(layout: Layout, name: str, points: int, least: int) -> tuple[IntArray, IntArray]:
    """The vertices that the lists of an element name, and (n,) the length of each list.

    Raises InputError for a number below ``least``, or from ``points`` on.
    """
    element = layout.element(name)
    if element.count == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    p = element.find(*INDICES)
    if p is None or not p.count_type:
        raise layout.source.error(f"element {name!r} has no list vertex_indices")
    values, counts = layout.list(element, p.name)
    index = values.astype(np.int64)
    check_corners(index, points, layout.source, least)
    return index, counts
