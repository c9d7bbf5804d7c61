"""Several files as one document, for one layout that all of them share.

The meshes stand side by side in a lattice, so no vertices of two files coincide and are welded. The files keep
their own positions. A layout of the whole is cut into one for each file again, and so are carried images.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from circparam.core.plural import listed
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.document import Document, Named
from circparam.formats.looks import Carried, Looks, Material, Slot
from circparam.formats.source import Source
from circparam.formats.table import takes_unshare
from circparam.geometry.shading import corner_normals
from circparam.mesh.mesh import Mesh, UVMap

# of a format: its pages of images with the meaning of a page of glTF, so one image serves both
SHARED_PAGES = {
    "obj": {"map_kd": "base_color", "map_ke": "emissive", "norm": "normal"},
    "ply": {"texture": "base_color"},
}


@dataclass(frozen=True, eq=False)
class JoinedDocument(Document):
    """Files in one document: the faces of the first, then those of the second, and so on.

    parts: the files. first_face, first_point: (parts + 1,) number of the first face or point of each, and of
    all.
    """

    parts: tuple[Document, ...] = field(kw_only=True)
    first_face: IntArray = field(kw_only=True)
    first_point: IntArray = field(kw_only=True)

    @property
    def instances(self) -> int:
        """How often a mesh of a file is shown again."""
        return sum(part.instances for part in self.parts)

    @property
    def draw_calls(self) -> int | None:
        """Draw calls of all files; None if those of one are unknown."""
        calls = [part.draw_calls for part in self.parts]
        return None if None in calls else sum(call for call in calls if call is not None)

    def faces_of(self, k: int) -> slice:
        """The faces of a file."""
        return slice(int(self.first_face[k]), int(self.first_face[k + 1]))

    def named(self, kind: str) -> Named | None:
        """The names of all files; the same name in two files is one."""
        label = np.zeros(len(self.mesh.faces), np.int64)
        names: list[tuple[str, int]] = []
        count = 1  # 0 is for files without names
        for k, part in enumerate(self.parts):
            if (found := part.named(kind)) is None:
                continue
            label[self.faces_of(k)] = np.maximum(found.label + count, 0)
            names += [(name, number + count) for name, number in found.names]
            count += int(found.label.max(initial=0)) + 1
        return Named(label, tuple(names)) if names else None

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """The layouts of a set of all files, which may lie on each other; −1 if a file has no such set."""
        found = [part.uv(uv_set) for part in self.parts]
        if all(layout is None for layout in found):
            return None
        none = [UVMap(np.zeros((0, 2)), np.full(part.mesh.faces.shape, -1)) for part in self.parts]
        return joined_layout([own or bare for own, bare in zip(found, none, strict=True)])

    def colours(self) -> FloatArray | None:
        """The colours of all corners, white in files without any."""
        return self._of_corners("colours", lambda mesh: np.ones((len(mesh.faces), 3, 3)))

    def normals(self) -> FloatArray | None:
        """The normals of all corners, smooth ones in files without any."""
        return self._of_corners("normals", lambda m: corner_normals(m.corners, m.rank[m.faces]))

    def tangents(self) -> FloatArray | None:
        """The tangents of all corners, NaN in files without any."""
        return self._of_corners("tangents", lambda mesh: np.full((len(mesh.faces), 3, 4), np.nan))

    def _of_corners(self, asked: str, instead: Callable[[Mesh], FloatArray]) -> FloatArray | None:
        """A property of the corners of all files; of a file that lacks it, that of its bare mesh."""
        found = [getattr(part, asked)() for part in self.parts]
        if all(one is None for one in found):
            return None
        pairs = zip(self.parts, found, strict=True)
        return np.concatenate([instead(part.mesh) if one is None else one for part, one in pairs])

    def looks(self) -> Looks:
        """The materials of all files."""
        return self._looks[0]

    @cached_property
    def _looks(self) -> tuple[Looks, list[int]]:
        """The same, of a file without materials one that shows no image; first material of each file, and of
        all."""
        images: list[bytes] = []
        names: list[str] = []
        materials: list[Material] = []
        face, first = [], [0]
        for k, part in enumerate(self.parts):
            m = len(part.mesh.faces)
            own = part.looks() or Looks((), (), (Material(""),), np.zeros(m, np.int64))
            face.append(own.face + len(materials))
            materials += [_moved(one, k, len(images), part.format) for one in own.materials]
            images += own.images
            names += own.names
            first.append(len(materials))
        looks = Looks(tuple(images), tuple(names), tuple(materials), np.concatenate(face))
        return looks, first

    def rounded(self, uv: FloatArray) -> FloatArray:
        """uv (k, 2) that every format stores to the bit: u, v and 1 − v are float32."""
        v = uv[:, 1]
        fraction, power = np.frexp(np.maximum(np.maximum(np.abs(v), np.abs(1 - v)), 1.0))
        step = np.ldexp(1.0, power - (fraction == 0.5) - 24)
        return np.stack([uv[:, 0].astype(np.float32), np.rint(v / step) * step], 1) + 0.0

    def layout_of(self, k: int, layout: UVMap) -> UVMap:
        """The part of a layout that lies over the faces of one file."""
        faces = layout.uv_faces[self.faces_of(k)]
        used, index = np.unique(faces, return_inverse=True)
        index = index.reshape(faces.shape)
        if len(used) and used[0] < 0:
            used, index = used[1:], index - 1
        return UVMap(layout.uv[used], index)

    def dressed_part(self, k: int, carried: Carried, stem: str) -> Document:
        """A file with its share of carried images, which lie beside it and have names of their own.

        stem: prefix of the names of the images.
        """
        part, (start, end) = self.parts[k], self._looks[1][k : k + 2]
        own = {new: old for old, new in SHARED_PAGES.get(part.format, {}).items()}
        groups = tuple(
            replace(
                group,
                members=tuple(member - start for member in group.members),
                factors={_on_page(slot, own): value for slot, value in group.factors.items()},
                shown=tuple(_on_page(slot, own) for slot in group.shown),
            )
            for group in carried.groups
            if start <= group.members[0] < end
        )
        kept = frozenset(member - start for member in carried.kept if start <= member < end)
        pages = {slot.page for group in groups for slot in group.shown}
        if not pages and not kept:
            return part
        there = [(page, own.get(page, page)) for page in carried.pages]
        images = {mine: carried.pages[page] for page, mine in there if mine in pages}
        files = {mine: image_name(stem, page) for page, mine in there if mine in pages}
        tangents = None if carried.tangents is None else carried.tangents[self.faces_of(k)]
        return part.dressed(Carried(images, groups, carried.uv_set, tangents, kept, files))


def joined_layout(layouts: Sequence[UVMap]) -> UVMap:
    """Layouts of meshes as one of all their faces, one mesh behind the other."""
    first = np.cumsum([0, *(len(layout.uv) for layout in layouts)])
    faces = [
        np.where(layout.uv_faces < 0, -1, layout.uv_faces + k)
        for layout, k in zip(layouts, first, strict=False)
    ]
    return UVMap(np.concatenate([layout.uv for layout in layouts]), np.concatenate(faces))


def _on_page(slot: Slot, names: dict[str, str]) -> Slot:
    """A slot whose page has the name that another format gives it."""
    return replace(slot, page=names.get(slot.page, slot.page))


def image_name(stem: str, page: str) -> str:
    """The file of an image that several outputs share."""
    return f"{stem}_{page}.png"


def _moved(material: Material, k: int, images: int, format: str) -> Material:
    """A material of file k among those of all files: its images get other numbers, and the page numbers of
    glTF.

    Materials of two files cannot become one.
    """
    names = SHARED_PAGES.get(format, {})
    uses = {slot: replace(use, image=use.image + images) for slot, use in material.uses.items()}
    return replace(
        material,
        uses={_on_page(slot, names): use for slot, use in uses.items()},
        factors={_on_page(slot, names): value for slot, value in material.factors.items()},
        alike=f"{k} {material.alike}",
    )


def join(parts: Sequence[Document]) -> JoinedDocument:
    """Several files as one document."""
    meshes = [part.mesh for part in parts]
    points = list(_apart(meshes))
    first_point = np.cumsum([0, *map(len, points)])
    faces = [mesh.faces + k for mesh, k in zip(meshes, first_point, strict=False)]
    names = [part.source.name for part in parts]
    mesh = Mesh(
        np.concatenate(points),
        np.concatenate(faces),
        polygons=_labels([mesh.polygons for mesh in meshes], meshes),
        groups=_labels([mesh.groups for mesh in meshes], meshes, one_each=True),
    )
    sets = sorted({number for part in parts for number in part.uv_sets})
    named = [(name, part) for name, part in zip(names, parts, strict=True)]
    return JoinedDocument(
        Source(listed(names)),
        "glb" if any(takes_unshare(part.format) for part in parts) else "arrays",
        mesh,
        tuple(sets),
        [f"{name}: {line}" for name, part in named for line in part.notes],
        warnings=tuple(f"{name}: {line}" for name, part in named for line in part.warnings),
        parts=tuple(parts),
        first_face=np.cumsum([0, *(len(mesh.faces) for mesh in meshes)]),
        first_point=first_point,
    )


def _apart(meshes: Sequence[Mesh]) -> Iterator[FloatArray]:
    """Points (n, 3) of each mesh, moved into a cell of its own in a lattice.

    The lattice has steps of a power of two, which keeps float32 coordinates exact. A single mesh stays in
    place.
    """
    if len(meshes) == 1:
        yield meshes[0].points
        return
    used = [mesh.corners.reshape(-1, 3) for mesh in meshes]
    low = np.min([p.min(0) for p in used], axis=0)
    high = np.max([p.max(0) for p in used], axis=0)
    step = 2.0 ** (math.frexp(float((high - low).max()))[1] + 1)
    side = math.ceil(len(meshes) ** (1 / 3))
    cells = np.stack(np.unravel_index(np.arange(len(meshes)), (side, side, side)), 1)
    for mesh, cell in zip(meshes, cells, strict=True):
        yield mesh.points + step * cell


def _labels(
    given: Sequence[IntArray | None], meshes: Sequence[Mesh], one_each: bool = False
) -> IntArray | None:
    """(m,) labels of all faces, those of two meshes apart; None if no mesh has any.

    one_each: a mesh without labels has one, in place of one for each face.
    """
    if all(labels is None for labels in given):
        return None
    out, count = [], 0
    for labels, mesh in zip(given, meshes, strict=True):
        m = len(mesh.faces)
        mine = (np.zeros(m, np.int64) if one_each else np.arange(m)) if labels is None else labels
        out.append(mine + count)
        count += int(mine.max()) + 1
    return np.concatenate(out)
