"""Grow first charts: regions of the dual graph round seeds that lie far apart, until every chart is a disk."""

from functools import cached_property
from itertools import count

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    first_of_groups,
    group_max,
    group_sum,
    mask_of,
    norms3,
    numbered,
    slices,
    sorted_distinct,
    unit,
)
from circparam.core.graph import components, distances, nearest, undirected
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface

NORMAL_WEIGHT = 3.0  # how much a turn of the normal lengthens a step


class DualGraph:
    """Cells (faces joined across locked edges) and the steps between them, made when they are first asked for.

    For many an atlas of a large surface nobody asks. surface: what it is of. whole: (e,) bool, edges that join
    faces to cells besides the locked ones.
    """

    def __init__(self, surface: Surface, whole: BoolArray | None = None) -> None:
        self._surface = surface
        self._joined = surface.locked if whole is None else surface.locked | whole

    @cached_property
    def _cells(self) -> tuple[int, IntArray]:
        return components(len(self._surface.faces), *self._surface.sides[:, self._joined])

    @property
    def n(self) -> int:
        """Number of cells."""
        return self._cells[0]

    @property
    def cell(self) -> IntArray:
        """(m,) cell of each face."""
        return self._cells[1]

    @cached_property
    def tail(self) -> IntArray:
        """(e,) cell on the first side of every edge."""
        return self.cell[self._surface.sides[0]]

    @cached_property
    def head(self) -> IntArray:
        """(e,) cell on the other side."""
        return self.cell[self._surface.sides[1]]

    @cached_property
    def step(self) -> FloatArray:
        """(e,) cost of the step between both: the distance of the centroids, more where the normal turns."""
        surface, (n, cell) = self._surface, self._cells
        area = np.maximum(surface.areas, 1e-300)
        total = group_sum(area, cell, n)
        middle = np.empty((len(cell), 3))
        for k in slices(len(cell)):
            p, q, r = (surface.points[surface.faces[k, j]] for j in range(3))
            middle[k] = (p + q + r) / 3
        centre = group_sum(middle * area[:, None], cell, n) / total[:, None]
        normal = unit(group_sum(surface.normals * area[:, None], cell, n))
        a, b = self.tail, self.head
        turn, far = np.empty(len(a)), np.empty(len(a))
        for k in slices(len(a)):
            x, y, z = (normal[a[k]] * normal[b[k]]).T
            turn[k] = 1 - (x + y + z)
            far[k] = norms3(centre[a[k]] - centre[b[k]])
        return far * (1 + NORMAL_WEIGHT * turn) + 1e-9 * float(np.sqrt(total.sum()))


def grow(
    n: int, tail: IntArray, head: IntArray, step: FloatArray, count: int, rounds: int = 2
) -> IntArray:
    """(n,) region of every cell: at least one region a component, ``count`` regions if there are cells enough.

    Seeds lie farthest apart (Gonzalez 1985); then each moves to the middle of its region (Lloyd), so many
    rounds. Deterministic.
    """
    graph = undirected(n, tail, head, step)
    _, component = components(n, tail, head)
    middle = _far_seeds(graph, component, count)
    for turn in range(rounds + 1):
        _, _, source = nearest(graph, middle)
        region = numbered(source)[1]
        if turn == rounds:
            break
        between = region[tail] != region[head]
        rim = sorted_distinct(np.r_[tail[between], head[between]])
        if len(rim) == 0:
            break
        inner = undirected(n, tail[~between], head[~between], step[~between])
        depth = distances(inner, rim)
        depth[~np.isfinite(depth)] = 0
        middle = first_of_groups(region, -depth)
    return region


def _far_seeds(graph: sps.csr_matrix, component: IntArray, count: int) -> IntArray:
    """Seeds far apart, at least one in every component: each time the cell that is farthest from all seeds.

    Components do not bear on each other, so a round takes the farthest cell of every one that reaches at
    least half as far as the best: as many rounds as the busiest component has seeds, not one a seed.
    """
    n = len(component)
    _, first = np.unique(component, return_index=True)
    seeds = [first]
    missing = min(count, n) - len(first)
    distance = distances(graph, first)
    while missing > 0:
        reach = group_max(distance, component, len(first))
        best = float(reach.max())
        if best <= 0:
            break
        candidate = np.flatnonzero((distance == reach[component]) & (distance > best / 2))
        far = candidate[first_of_groups(component[candidate])]
        far = far[np.lexsort((far, -distance[far]))][:missing]
        seeds.append(far)
        missing -= len(far)
        distance = np.minimum(distance, distances(graph, far, best))
    return np.concatenate(seeds)


def first_charts(atlas: Atlas, graph: DualGraph, count: int) -> None:
    """Cut the surface into about ``count`` regions, keeping the seams there are."""
    use = ~atlas.cut
    region = grow(graph.n, graph.tail[use], graph.head[use], graph.step[use], count)
    atlas.cut |= region[graph.tail] != region[graph.head]


def split_charts(
    atlas: Atlas,
    graph: DualGraph,
    chart: IntArray,
    which: BoolArray,
    pieces: int = 2,
    rounds: int = 2,
) -> BoolArray:
    """Cut the charts ``which`` ((n,) bool) into about ``pieces`` regions each; returns the edges newly cut."""
    use = ~atlas.cut & which[chart[atlas.surface.sides[0]]]
    cells = mask_of(graph.n, graph.cell[which[chart]])
    number = np.cumsum(cells) - 1
    tail, head = number[graph.tail[use]], number[graph.head[use]]
    n = int(cells.sum())
    region = grow(n, tail, head, graph.step[use], pieces * int(which.sum()), rounds)
    new = mask_of(len(atlas.cut), np.flatnonzero(use)[region[tail] != region[head]])
    atlas.cut |= new
    return new


def make_disks(atlas: Atlas, graph: DualGraph) -> None:
    """Split charts until all are disks or disks with holes, or cells that cannot be split.

    A chart that a few halvings do not help is cut into ever more pieces.
    """
    for attempt in count():
        cut_mesh = atlas.cut_mesh()
        bad = not_disks(cut_mesh)
        pieces = 2 ** max(attempt - 2, 1)
        if not bad.any() or not split_charts(atlas, graph, cut_mesh.chart, bad, pieces, 1).any():
            return
