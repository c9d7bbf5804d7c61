"""A placed layout in numbers that a format can store: faces upright, charts without overlap, if that can be."""

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    group_count,
    next_half_edge,
    sorted_distinct,
)
from circparam.core.records import dataclass
from circparam.geometry.boundary import boundary_of, turned_loops
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.cut_mesh import CutMesh
from circparam.pipeline.fallback import FLIPPED, OVERLAPPING, SOUND
from circparam.pipeline.representable_uv import FAR_ON_BOUNDARY, Rounding, mend_faces, places
from circparam.pipeline.rounding_slivers import relieve

PUSHES = 2 * FAR_ON_BOUNDARY  # rounds in which boundaries that meet draw back


@dataclass(frozen=True, eq=False)
class Stored:
    """uv (nv, 2) storable; fault (n_charts,) as ``fallback.faults``; moved: vertices that are not where
    rounding alone puts them; spoilt: faces that no search mended."""

    uv: FloatArray
    fault: IntArray
    moved: int = 0
    spoilt: int = 0

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong with any chart."""
        return not (self.fault > 0).any()


def store(cut_mesh: CutMesh, exact: FloatArray, mirrored: BoolArray, rounding: Rounding) -> Stored:
    """Round a layout and mend spoilt faces.

    exact: (nv, 2) as placed, finite. mirrored: (n_charts,) charts that lie clockwise, as their file winds them.
    """
    upright = np.where(
        mirrored[cut_mesh.chart][:, None], cut_mesh.faces[:, [0, 2, 1]], cut_mesh.faces
    )
    flat = cut_mesh.faces.ravel()
    h = cut_mesh.boundary
    on_boundary = np.zeros(cut_mesh.n_vertices, bool)
    on_boundary[flat[h]] = on_boundary[flat[next_half_edge(h)]] = True
    mended = mend_faces(upright, exact, on_boundary, rounding)
    n = cut_mesh.n_charts
    fault = np.where(group_count(cut_mesh.chart[mended.spoilt], n) > 0, FLIPPED, SOUND)
    uv = relieve(upright, exact, mended.uv, on_boundary, cut_mesh.chart, rounding)
    sound = fault == SOUND
    if sound.any():
        part, vertices, faces = cut_mesh.subset(sound)
        local = np.full(len(uv), -1)
        local[vertices] = np.arange(len(vertices))
        boundary = _Boundary(part, local[upright[faces]], rounding(exact[vertices]), rounding)
        uv[vertices], crossed = boundary.drawn_back(uv[vertices])
        fault[np.flatnonzero(sound)[crossed]] = OVERLAPPING
    moved = int((uv != rounding(exact)).any(1).sum())
    return Stored(uv, fault, moved, int(mended.spoilt.sum()))


@dataclass(frozen=True, eq=False)
class _Boundary:
    """Charts without a flip whose boundaries may meet. upright: (m, 3) faces as they lie, counter-clockwise;
    start: (nv, 2) where rounding alone puts their vertices."""

    cut_mesh: CutMesh
    upright: IntArray
    start: FloatArray
    rounding: Rounding

    def drawn_back(self, uv: FloatArray) -> tuple[FloatArray, BoolArray]:
        """uv (nv, 2), vertices of boundaries that meet moved inwards; (n_charts,) which still overlap.

        Charts know nothing of each other here: each round looks at those alone that the last one moved.
        """
        uv, n = uv.copy(), self.cut_mesh.n_charts
        over, moved = np.zeros(n, bool), np.ones(n, bool)
        some, vertices = self, np.arange(len(uv))
        for push in range(1, PUSHES + 2):
            meeting, over[moved] = some._meeting(uv[vertices])
            if len(meeting) == 0 or push > PUSHES:
                break
            uv[vertices] = some._inwards(uv[vertices], meeting, min(push, FAR_ON_BOUNDARY))
            again = np.zeros(some.cut_mesh.n_charts, bool)
            again[some.cut_mesh.chart[meeting // 3]] = True
            some, of_some = some._part(again)
            vertices, moved[moved] = vertices[of_some], again
        return uv, over

    def _meeting(self, uv: FloatArray) -> tuple[IntArray, BoolArray]:
        """Boundary half-edges that meet others of their chart, none if it is wound round twice; (n_charts,)
        which charts overlap."""
        c = self.cut_mesh
        found = overlaps(c.faces, uv, c.chart, c.edges)
        meeting = sorted_distinct(found.crossings)
        if found.self_overlapping.any():  # holes narrower than a unit may have turned over
            boundary = boundary_of(c.faces, uv, c.chart, c.edges, c.n_charts)
            meeting = sorted_distinct(
                np.concatenate([meeting, boundary.half_edge[turned_loops(boundary)]])
            )
        return meeting, found.self_overlapping

    def _part(self, charts: BoolArray) -> "tuple[_Boundary, IntArray]":
        """Some charts ((n_charts,) bool) alone, and their vertices."""
        part, vertices, faces = self.cut_mesh.subset(charts)
        number = np.full(len(self.start), -1)
        number[vertices] = np.arange(len(vertices))
        upright = number[self.upright[faces]]
        return _Boundary(part, upright, self.start[vertices], self.rounding), vertices

    def _inwards(self, uv: FloatArray, h: IntArray, by: int) -> FloatArray:
        """uv with the ends of boundary half-edges drawn towards the inside of their charts, by so many numbers.

        A vertex takes the best place that leaves all its faces upright.
        """
        c = self.cut_mesh
        flat = c.faces.ravel()
        a, b = flat[h], flat[next_half_edge(h)]
        # the inside is where the third corner of the half-edge's face lies
        inside = np.zeros_like(uv)
        third = uv[flat[next_half_edge(next_half_edge(h))]]
        along = uv[b] - uv[a]
        normal = np.stack([-along[:, 1], along[:, 0]], 1)
        normal *= np.sign(((third - uv[a]) * normal).sum(1))[:, None]
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        np.add.at(inside, a, normal)
        np.add.at(inside, b, normal)
        uv = uv.copy()
        waiting = np.zeros(len(uv), bool)
        waiting[a] = waiting[b] = True
        while waiting.any():  # vertices that share a face move one after the other
            number = np.where(waiting, np.arange(len(uv)), -1)[c.faces]
            beaten = np.zeros(len(uv), bool)
            beaten[c.faces[number < number.max(1)[:, None]]] = True
            chosen = np.flatnonzero(waiting & ~beaten)
            waiting[chosen] = False
            uv[chosen] = self._best(uv, chosen, inside[chosen], by)
        return uv

    def _best(self, uv: FloatArray, chosen: IntArray, inside: FloatArray, by: int) -> FloatArray:
        """(k, 2) for each chosen vertex the place of its window nearest to ``by`` numbers further inside."""
        grid, step = places(uv[chosen], self.rounding)
        direction = inside / np.maximum(np.linalg.norm(inside, axis=1), 1e-300)[:, None]
        away = (grid - self.start[chosen][:, None]) / step[:, None]
        cost: FloatArray = ((away - by * direction[:, None]) ** 2).sum(2)
        cost[np.abs(away).max(2) > FAR_ON_BOUNDARY] = np.inf
        w = grid.shape[1]
        cost[:, w // 2] = np.minimum(cost[:, w // 2], 1e9)  # to stay is always possible
        slot = np.full(len(uv), -1)
        slot[chosen] = np.arange(len(chosen))
        corner = np.flatnonzero(slot[self.upright.ravel()] >= 0)
        own = slot[self.upright.ravel()[corner]]
        triangle = uv[self.upright[corner // 3]]  # (c, 3, 2)
        triangle = np.repeat(triangle[:, None], w, axis=1)
        triangle[np.arange(len(corner)), :, corner % 3] = grid[own]
        flat = triangle.reshape(-1, 2)
        low = signs(flat, np.arange(len(flat)).reshape(-1, 3)).reshape(-1, w) <= 0
        spoils = np.zeros(cost.shape, bool)
        np.logical_or.at(spoils, own, low)
        spoils[:, w // 2] = False
        cost[spoils] = np.inf
        result: FloatArray = grid[np.arange(len(chosen)), cost.argmin(1)]
        return result
