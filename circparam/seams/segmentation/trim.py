"""Cut off the few faces with which charts lie on themselves, and leave all other faces where they lie."""

from collections.abc import Iterator

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    blocks,
    edge_keys,
    group_count,
    group_sum,
    mask_of,
    ranges,
    sorted_distinct,
)
from circparam.core.graph import components
from circparam.geometry.overlap import crossings, wound_twice
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.layout import ChartLayouts


def trim_overlaps(
    atlas: Atlas,
    graph: DualGraph,
    layouts: ChartLayouts,
    which: BoolArray,
    apart: BoolArray | None = None,
) -> BoolArray:
    """Cut off the faces that lie on others of their chart, of both sheets the smaller one.

    which: (n,) bool, charts. apart: (m,) bool, gets the faces of these charts that lie on no other. Returns
    (n,) bool: charts without overlaps now. A chart that would fall into more than two pieces stays as it is,
    because a cut in two does not leave more charts.
    """
    p, surface = layouts.cut_mesh, atlas.surface
    sides = np.ascontiguousarray(p.edges.T) // 3
    pairs = _lying_pairs(layouts, sides, _seeds(layouts, which), np.flatnonzero(which[p.chart]))
    if apart is not None:
        apart |= which[p.chart]
        apart[pairs] = False
    clear = which & (group_count(p.chart[pairs[:, 0]], len(which)) > 0)
    if len(pairs) == 0:
        return clear
    left, right = surface.sides
    inner = ~atlas.cut
    off = mask_of(graph.n, graph.cell[_losers(p.areas, pairs, left[inner], right[inner])])
    off = off[graph.cell]
    inner &= off[left] == off[right]
    n, piece = components(len(off), left[inner], right[inner])
    owner = np.empty(n, np.int64)
    owner[piece] = p.chart
    clear &= group_count(owner, len(which)) <= 2
    off &= clear[p.chart]
    atlas.cut |= off[left] != off[right]
    return clear


def _seeds(layouts: ChartLayouts, which: BoolArray) -> IntArray:
    """Faces at which overlaps begin: where boundaries meet, and round vertices that are wound twice."""
    p = layouts.cut_mesh
    met = crossings(layouts.uv, p).ravel() // 3
    around = wound_twice(p, layouts.uv)[p.faces.T]
    seeds = sorted_distinct(np.r_[met, np.flatnonzero(around[0] | around[1] | around[2])])
    return seeds[which[p.chart[seeds]]]


def _lying_pairs(
    layouts: ChartLayouts, sides: IntArray, seeds: IntArray, faces: IntArray
) -> IntArray:
    """(k, 2) pairs of faces of one chart that overlap.

    sides: (2, e) faces beside edges. faces: of the charts of the seeds. The search spreads from the seeds to
    the neighbours of faces that overlap.
    """
    p = layouts.cut_mesh
    m, chart = len(p.faces), p.chart
    boxes = Boxes.of(layouts, faces)
    tested, found = np.zeros(m, bool), [np.zeros((0, 2), np.int64)]
    front = seeds
    while len(front):
        tested[front] = True
        f, g = boxes.near(front)
        both = (chart[f] == chart[g]) & (f != g)
        f, g = f[both], g[both]
        lying = _overlap(layouts.uv[p.faces[f]], layouts.uv[p.faces[g]])
        f, g = f[lying], g[lying]
        found.append(np.stack([f, g], 1))
        on = mask_of(m, np.r_[f, g])
        near = on.copy()
        near[sides[0][on[sides[1]]]] = near[sides[1][on[sides[0]]]] = True
        front = np.flatnonzero(near & ~tested)
    pairs = np.concatenate(found)
    key = sorted_distinct(edge_keys(pairs[:, 0], pairs[:, 1], m))
    return np.stack([key // m, key % m], 1)


class Boxes:
    """The bounding boxes of some faces of a layout, in orders of their left ends.

    Each order has boxes of about the same width, so that a wide box does not make all of them candidates.
    """

    def __init__(self, low: FloatArray, high: FloatArray, faces: IntArray) -> None:
        self.low, self.high = low, high
        faces = faces[np.argsort(low[0, faces], kind="stable")]
        octave = np.frexp(high[0, faces] - low[0, faces])[1]
        self.orders = [faces[octave == k] for k in sorted_distinct(octave).tolist()]

    @staticmethod
    def of(layouts: ChartLayouts, faces: IntArray) -> "Boxes":
        """Of the triangles of a layout."""
        corner = layouts.uv.T[:, layouts.cut_mesh.faces.T]
        a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        return Boxes(low, high, faces)

    def near(self, faces: IntArray) -> tuple[IntArray, IntArray]:
        """All pairs (some face, any face) whose boxes meet."""
        found = [pairs for order in self.orders for pairs in self._near(faces, order)]
        f, g = np.concatenate(found, axis=1)
        return f, g

    def _near(self, faces: IntArray, order: IntArray) -> Iterator[IntArray]:
        """(2, k) pairs with boxes of one width, from a bounded number of candidates at a time."""
        start = self.low[0, order]
        widest = float((self.high[0, order] - start).max())
        first = np.searchsorted(start, self.low[0, faces] - widest)
        count = np.searchsorted(start, self.high[0, faces], side="right") - first
        for k in blocks(count):
            f = np.repeat(faces[k], count[k])
            g = order[np.repeat(first[k], count[k]) + ranges(count[k])]
            for d in (0, 1):
                meet = (self.low[d, f] < self.high[d, g]) & (self.low[d, g] < self.high[d, f])
                f, g = f[meet], g[meet]
            yield np.stack([f, g])


def _overlap(one: FloatArray, other: FloatArray) -> BoolArray:
    """(k,) bool: the insides of two triangles (k, 3, 2), both counter-clockwise, meet.

    They do not if the line along a side of one has the other on its outer side.
    """
    meet = np.ones(len(one), bool)
    for a, b in ((one, other), (other, one)):
        for side in range(3):
            x, y = (a[:, (side + 1) % 3] - a[:, side]).T
            inside = np.zeros(len(a), bool)
            for corner in range(3):
                dx, dy = (b[:, corner] - a[:, side]).T
                inside |= x * dy - y * dx > 0
            meet &= inside
    return meet


def _losers(areas: FloatArray, pairs: IntArray, left: IntArray, right: IntArray) -> IntArray:
    """Of each pair the face that goes: that of the smaller sheet, on one sheet that with more overlaps.

    areas: (m,). left, right: faces beside the edges that are not cut. A sheet is what hangs together of faces
    that overlap others.
    """
    m = len(areas)
    lying = mask_of(m, pairs)
    joined = lying[left] & lying[right]
    n, sheet = components(m, left[joined], right[joined])
    size = group_sum(np.where(lying, areas, 0.0), sheet, n)[sheet]
    often = group_count(pairs.ravel(), m)
    one, two = pairs.T
    same = sheet[one] == sheet[two]
    first = np.where(same, often[one] >= often[two], size[one] <= size[two])
    return sorted_distinct(np.where(first, one, two))
