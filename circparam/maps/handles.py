"""Two surfaces with handles over one geometry: the common domain of their map, place by place in frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.maps.base import Base, base_of
from circparam.maps.convex import refuse_crushed
from circparam.maps.cover import Cover, Development, own_development, references, whole_development
from circparam.maps.domain import begun
from circparam.maps.landmarks import Landmarks
from circparam.maps.loops import HandleLayout
from circparam.maps.patches import laid_in_patches
from circparam.maps.places import along_boundaries
from circparam.maps.sides import Side
from circparam.maps.straighten import straighten
from circparam.maps.tracing import Tracer

APART = 10.0  # how far patches lie from each other where faces near a place are looked for


@dataclass(frozen=True, eq=False)
class Lifted:
    """Places of the vertices of one sheet over the other: face (n,), weights (n, 3), and turn (n, 3, 3)
    from the frame of the face to that of the vertex."""

    face: IntArray
    weights: FloatArray
    turn: FloatArray


@dataclass(frozen=True, eq=False)
class Laid:
    """Two sheets over one domain: covers of both, the development of A's faces, its vertices in their frames
    (n, 3), and the places of these on the sheet of B."""

    a: Cover
    b: Cover
    whole: Development
    vertices: FloatArray
    lifted: Lifted


@dataclass(frozen=True, eq=False)
class Patched:
    """One sheet of the domain. patch (m,), places (m, 3, 3): see ``laid_in_patches``; cover; first (n,):
    the half-edge in whose face's frame each vertex lies; whole: the development of the faces before edges
    were split."""

    patch: IntArray
    places: FloatArray
    cover: Cover
    first: IntArray
    whole: Development

    def own(self) -> Development:
        """The development of the faces of the sheet itself."""
        c = self.cover
        return own_development(c.sheet, c.index, c.matrices, self.first)

    def vertices(self) -> FloatArray:
        """(n, 3) the vertices in their frames."""
        result: FloatArray = self.cover.cones.reshape(-1, 3)[self.first]
        return result


@dataclass(frozen=True, eq=False)
class HandleDomain:
    """Both sheets, patch on patch."""

    base: Base
    sheets: tuple[Patched, Patched]

    @property
    def inversions(self) -> tuple[int, int]:
        """Faces turned over."""
        return self.sheets[0].cover.inversions, self.sheets[1].cover.inversions


def handle_domain(
    a: Side, b: Side, marks: Landmarks, method: str, monitor: Monitor
) -> HandleDomain:
    """Both sheets over one geometry by convex maps of the patches between arcs. Helpers are added to ``marks``.

    Raises TopologyError where the landmarks have no common layout, NoResultError where double precision
    cannot hold it.
    """
    with monitor.stage("layout"):
        layout = begun(a, b, marks, HandleLayout)
        layout.genus = a.genus
        layout.triangulate()
        for u, v in zip(*(t.marks[len(marks.a) :] for t in layout.tracers), strict=True):
            marks.add(int(u), int(v), False)
    with monitor.stage("straighten"):
        straighten(layout, method, 2 * marks.arcs)
    with monitor.stage("embed"):
        regions, ends = np.array(layout.regions()), np.array(layout.ends)
        base = base_of(regions, ends)
        first, second = (
            _patched(t, side, base, regions, method)
            for t, side in zip(layout.tracers, (a, b), strict=True)
        )
    return HandleDomain(base, (first, second))


def _patched(tracer: Tracer, side: Side, base: Base, regions: IntArray, method: str) -> Patched:
    """One sheet over the base; regions (r, 3): the arcs round each patch."""
    sheet = tracer.sheet
    patch, places = laid_in_patches(tracer, regions, method)
    index = np.zeros(3 * len(sheet.faces), np.int64)
    for arc, path in tracer.arcs.items():
        index[sheet.half_edges(path[:-1], path[1:])] = arc + 1
    matrices = np.concatenate([np.eye(3)[None], base.across])
    cones = np.einsum("fcp,fpd->fcd", places, base.corners[patch])
    cover = Cover(base.geometry, sheet, base.geometry.normal(cones), index, matrices)
    refuse_crushed(cover.inversions)
    first = references(sheet)
    whole = whole_development(sheet, index, matrices, first, side.sheet.faces)
    return Patched(patch, places, cover, first, whole)


def located(one: Patched, two: Patched) -> Lifted:
    """All vertices of one sheet on the other, each looked for in its patch."""
    patch, place = one.patch[one.first // 3], one.places.reshape(-1, 3)[one.first]
    tree = cKDTree(np.column_stack([APART * two.patch, two.places.mean(1)]))
    near = np.asarray(tree.query(np.column_stack([APART * patch, place]))[1], np.int64)
    face, w, turn = two.cover.find(one.vertices(), near)
    return Lifted(face, w, turn)


def composed_in_patches(a: Side, b: Side, marks: Landmarks, one: Patched, two: Patched) -> Lifted:
    """The vertices of the sheet of A on the sheet of B, patch by patch."""
    n = a.sheet.n
    patch = one.patch[one.first[:n] // 3]
    found = located(one, two)
    face, w, turn = found.face[:n], found.weights[:n], found.turn[:n]
    vertex, edge_face, edge_w = along_boundaries(a, b, marks, two.cover.sheet)
    face[vertex], w[vertex], turn[vertex] = edge_face, edge_w, np.eye(3)
    for u, v in zip(marks.a, marks.b, strict=True):
        corner = np.flatnonzero(
            (two.cover.sheet.faces == v).ravel() & (np.repeat(two.patch, 3) == patch[u])
        )
        best = corner[0]
        face[u], w[u], turn[u] = best // 3, np.eye(3)[best % 3], np.eye(3)
    return Lifted(face, w, turn)
