"""Halve charts: two parts of one area, each in one piece where the chart allows it."""

import numpy as np

from circparam.core.arrays import (
    cross2,
    first_of_groups,
    first_of_runs,
    group_sum,
    mask_of,
)
from circparam.core.graph import distances, severed, undirected
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import ANY_BOUND
from circparam.seams.evaluate import jacobians
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.layout import ChartLayouts
from circparam.solvers import dirichlet


def halve_between_ends(atlas: Atlas, graph: DualGraph, chart: IntArray, which: BoolArray) -> None:
    """Cut the charts ``which`` ((n,) bool) across the way between their ends, the cells farthest apart.

    chart: (m,) of each face.
    """
    cells = _Cells.of(atlas, graph, chart, which)
    links = undirected(len(cells.chart), cells.tail, cells.head, graph.step[cells.edge])
    one = first_of_groups(cells.chart, -distances(links, first_of_groups(cells.chart)))
    from_one = distances(links, one)
    other = first_of_groups(cells.chart, -from_one)
    cells.cut(atlas, from_one - distances(links, other))


def halve_evenly(atlas: Atlas, graph: DualGraph, layouts: ChartLayouts, which: BoolArray) -> None:
    """Cut the charts ``which`` ((n,) bool) into halves that are equally distorted, to first order.

    The cut is a line of the layout in the direction g = Σ A (E − Ē) p in which the distortion grows: sums over
    the faces of a chart, with area A, energy E, mean energy Ē of the chart, centre p. Across g one half would
    keep most of it: of a rough scan a part above the bound wherever it is cut, down to single faces.
    """
    cut_mesh, n = layouts.cut_mesh, layouts.cut_mesh.n_charts
    cells = _Cells.of(atlas, graph, cut_mesh.chart, which)
    faces, chart = cells.faces, cut_mesh.chart[cells.faces]
    energy = _face_energies(layouts)[faces]
    area = cut_mesh.areas[faces]
    centre = layouts.uv[cut_mesh.faces[faces]].mean(1)
    mean = group_sum(area * energy, chart, n) / np.maximum(cut_mesh.chart_areas, 1e-300)
    excess = area * (energy - mean[chart])
    growth = np.stack([group_sum(excess * x, chart, n) for x in centre.T], axis=1)
    beside = group_sum(area * cross2(growth[chart], centre), cells.cell, len(cells.area))
    cells.cut(atlas, beside / np.maximum(cells.area, 1e-300))


def _face_energies(layouts: ChartLayouts) -> FloatArray:
    """(m,) energy of each face, with the roughness that its surface leaves out; never infinite."""
    cut_mesh = layouts.cut_mesh
    energy = dirichlet.energy(jacobians(cut_mesh, layouts.uv[cut_mesh.faces]))
    energy = np.minimum(energy, ANY_BOUND)
    return energy if cut_mesh.roughness is None else energy + cut_mesh.roughness.values


@dataclass(frozen=True, eq=False)
class _Cells:
    """The cells (k,) of some charts. faces: (m,) numbers of their faces, cell: (m,) of each. chart, area: (k,).
    edge: (e,) edges between two of them inside a chart, tail, head: (e,) cells there."""

    faces: IntArray
    cell: IntArray
    chart: IntArray
    area: FloatArray
    edge: IntArray
    tail: IntArray
    head: IntArray

    @staticmethod
    def of(atlas: Atlas, graph: DualGraph, chart: IntArray, which: BoolArray) -> "_Cells":
        """Those of the charts ``which`` ((n,) bool) of an atlas."""
        faces = np.flatnonzero(which[chart])
        number = np.cumsum(mask_of(graph.n, graph.cell[faces])) - 1
        cell, k = number[graph.cell[faces]], int(number[-1]) + 1
        of_cell = np.zeros(k, np.int64)
        of_cell[cell] = chart[faces]
        area = group_sum(atlas.surface.areas[faces], cell, k)
        edge = np.flatnonzero(~atlas.cut & which[chart[atlas.surface.sides[0]]])
        tail, head = number[graph.tail[edge]], number[graph.head[edge]]
        return _Cells(faces, cell, of_cell, area, edge, tail, head)

    def cut(self, atlas: Atlas, along: FloatArray) -> None:
        """Cut between the halves that come first and last by ``along`` (k,); pieces apart join the other."""
        first = _first_halves(self.chart, along, self.area)
        for half in (True, False):
            apart = severed(first == half, self.tail, self.head, self.area, self.chart)
            first[apart] = not half
        atlas.cut[self.edge[first[self.tail] != first[self.head]]] = True


def _first_halves(group: IntArray, along: FloatArray, area: FloatArray) -> BoolArray:
    """(cells,) bool: in the first half of the area of its group, in the order of ``along``; at least one cell,
    and all of a single one."""
    order = np.lexsort((along, group))
    start = first_of_runs(group[order])
    size = np.diff(np.r_[start, len(order)])
    total = np.cumsum(area[order])
    before = np.r_[0.0, total][start]
    half = np.repeat((before + total[start + size - 1]) / 2, size)
    inside = total <= half
    inside[start] = True
    out = np.zeros(len(order), bool)
    out[order] = inside
    return out
