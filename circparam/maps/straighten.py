"""Straighter arcs: two patches at a time are mapped onto a square, and its diagonal becomes the arc between
them.

A shortest path along edges zigzags, and a patch whose boundary zigzags is sheared where it is laid straight.
The diagonal of a convex map runs over the surface as smoothly as the map is; edges are split where it crosses
them.
"""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.maps.convex import border_places, combined, row_weights
from circparam.maps.layout import Layout
from circparam.maps.tracing import Tracer

SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
LEAST_SHARE = 0.05  # of an edge: how near to its ends it is split
# how far beside the diagonal an arc runs: on regular meshes vertices lie on it exactly
BESIDE = 1e-6


def straighten(layout: Layout, weights: str, first: int) -> None:
    """Replace the arcs from number ``first`` on by diagonals, on both meshs, in place."""
    for arcs in _rounds(layout, first):
        for tracer in layout.tracers:
            _Straightener(tracer, layout, arcs).run(weights)
            tracer.split_chords()


def _rounds(layout: Layout, first: int) -> list[list[int]]:
    """Arcs to replace together: of each region one at most, and only between regions that make a
    quadrilateral.
    """
    region_of = {arc: n for n, r in enumerate(layout.regions()) for arc in r}
    left = [a for a in range(first, len(layout.ends), 2) if len(set(_quad(layout, a))) == 4]
    out = []
    while left:
        taken: set[int] = set()
        now = []
        for arc in left:
            pair = {region_of[arc], region_of[arc ^ 1]}
            if not pair & taken:
                taken |= pair
                now.append(arc)
        out.append(now)
        left = [arc for arc in left if arc not in now]
    return out


def _quad(layout: Layout, arc: int) -> list[int]:
    """The landmarks round the two regions of an arc, counter-clockwise from its start."""
    i, j = layout.ends[arc]
    return [i, layout.ends[layout.after(arc ^ 1)][1], j, layout.ends[layout.after(arc)][1]]


class _Straightener:
    """Some arcs of one mesh, whose pairs of patches do not touch each other. pair (m,): of each face, −1
    elsewhere.
    """

    def __init__(self, tracer: Tracer, layout: Layout, arcs: list[int]) -> None:
        self.tracer, self.layout, self.arcs, self.mesh = tracer, layout, arcs, tracer.mesh
        regions = layout.regions()
        region_of = {arc: k for k, r in enumerate(regions) for arc in r}
        name = np.full(len(regions), -1)
        for pair, arc in enumerate(arcs):
            name[[region_of[arc], region_of[arc ^ 1]]] = pair
        self.pair = name[tracer.regions(regions)]
        self.key, self.place = border_places(tracer, [self._sides(arc) for arc in arcs], SQUARE)

    def _sides(self, arc: int) -> list[int]:
        """The arcs round the pair, counter-clockwise from its start: two of the right patch, two of the
        left.
        """
        right, left = self.layout.after(arc ^ 1), self.layout.after(arc)
        return [right, self.layout.after(right), left, self.layout.after(left)]

    def run(self, weights: str) -> None:
        """Lay the new arcs."""
        mesh, n = self.mesh, self.mesh.n
        uv, of = self._flat(weights)
        h = np.flatnonzero((self.pair >= 0).repeat(3))
        h = h[h < mesh.twin[h]]
        pair = self.pair[h // 3]
        same = self.pair[mesh.twin[h] // 3] == pair
        h, pair = h[same], pair[same]
        a, b = mesh.faces.ravel()[h], mesh.faces[:, [1, 2, 0]].ravel()[h]
        pa, pb = self._at(uv, of, pair, a), self._at(uv, of, pair, b)
        sa, sb = pa[:, 0] - pa[:, 1] - BESIDE, pb[:, 0] - pb[:, 1] - BESIDE
        ends = np.array([self.layout.ends[arc] for arc in self.arcs])
        ends = self.tracer.marks[ends][pair]
        cross = ((sa > 0) != (sb > 0)) & (a[:, None] != ends).all(1) & (b[:, None] != ends).all(1)
        h, pair, a, b = h[cross], pair[cross], a[cross], b[cross]
        t = sa[cross] / (sa[cross] - sb[cross])
        along = ((1 - t)[:, None] * pa[cross] + t[:, None] * pb[cross]).sum(1)
        ratio = np.clip(t, LEAST_SHARE, 1 - LEAST_SHARE)
        marked: BoolArray = np.zeros(3 * len(mesh.faces), bool)
        share = np.full(3 * len(mesh.faces), 0.5)
        marked[h] = marked[mesh.twin[h]] = True
        share[h], share[mesh.twin[h]] = ratio, 1 - ratio
        new, middle = mesh.split(marked, share)
        self.tracer.renew(new)
        vertex = middle[np.searchsorted(middle[:, 0], np.minimum(a, b) * n + np.maximum(a, b)), 1]
        order = np.lexsort((along, pair))
        for number, arc in enumerate(self.arcs):
            own = order[pair[order] == number]
            i, j = self.tracer.marks[list(self.layout.ends[arc])]
            path = np.concatenate([[i], vertex[own], [j]])
            if (new.half_edges(path[:-1], path[1:]) < 0).any():
                path = _with_middles(self.tracer.arcs[arc], middle, n)
            self.tracer.replace(arc, path, *self.layout.ends[arc])
        self.tracer.mark_arcs()

    def _flat(self, weights: str) -> tuple[FloatArray, IntArray]:
        """((n, 2) places of the free vertices in the square of their pair, (n,) that pair, −1 for those not
        free).
        """
        mesh = self.mesh
        i, j = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
        low, high = np.full(mesh.n, len(self.arcs)), np.full(mesh.n, -1)
        np.minimum.at(low, i, np.repeat(self.pair, 3))
        np.maximum.at(high, i, np.repeat(self.pair, 3))
        free = (low == high) & (high >= 0)
        free[self.tracer.marks] = False
        of = np.where(free, high, -1)
        uv = np.zeros((mesh.n, 2))
        uv[free] = combined(
            mesh, free, row_weights(mesh, weights), lambda h: self._known(of[i[h]], j[h])
        )
        return uv, of

    def _known(self, pair: IntArray, vertices: IntArray) -> FloatArray:
        """(k, 2) places of vertices on the boundary of a pair."""
        found: FloatArray = self.place[np.searchsorted(self.key, pair * self.mesh.n + vertices)]
        return found

    def _at(self, uv: FloatArray, of: IntArray, pair: IntArray, vertices: IntArray) -> FloatArray:
        out = uv[vertices]
        fixed = of[vertices] < 0
        out[fixed] = self._known(pair[fixed], vertices[fixed])
        return out


def _with_middles(path: IntArray, middle: IntArray, n: int) -> IntArray:
    """A path after some of its edges were split; middle: as ``ClosedMesh.split`` returns it."""
    low, high = np.minimum(path[:-1], path[1:]), np.maximum(path[:-1], path[1:])
    out = np.full(2 * len(path) - 1, -1)
    out[::2] = path
    if len(middle):
        at = np.minimum(np.searchsorted(middle[:, 0], low * n + high), len(middle) - 1)
        found = middle[at, 0] == low * n + high
        out[1::2][found] = middle[at[found], 1]
    result: IntArray = out[out >= 0]
    return result
