"""Whether a finished layout keeps its promises on the raster: no texel shared, gaps and borders wide enough."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.geometry.raster import (
    LabelGrid,
    crowded_labels,
    free_border,
    shared_texels,
    smallest_gap,
)
from circparam.packing.coverage import Runs, face_runs, outline_runs, painted
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes


@dataclass(frozen=True, eq=False)
class PlacedCharts:
    """Charts as they lie on their pages, to be checked: in uv of the page each part lies on.

    start, end: (b, 2) outline edges, edge_owner: (b,) their charts. page: (n,) page of each chart. simple: (n,)
    charts whose outlines tell their covered texels (``Shapes.simple``), none if left out. corners: (m, 3, 2) of
    the faces that outlines do not tell of, owner: (m,) their charts.
    """

    corners: FloatArray
    owner: IntArray
    start: FloatArray
    end: FloatArray
    edge_owner: IntArray
    page: IntArray
    simple: BoolArray | None = None

    @classmethod
    def of(cls, shapes: Shapes, uv: FloatArray, page: IntArray) -> "PlacedCharts":
        """Charts at uv (nv, 2), in units of the page (n,) that each chart lies on."""
        return cls(
            uv[shapes.faces[shapes.scanned]],
            shapes.chart[shapes.scanned],
            uv[shapes.start],
            uv[shapes.end],
            shapes.owner[shapes.start],
            page,
            shapes.simple,
        )

    def raster(self, tile: int, side: int) -> tuple[LabelGrid, int]:
        """Owner of each texel of one page, −1 if empty; and how many texels have two owners."""
        simple = np.zeros(len(self.page), bool) if self.simple is None else self.simple
        here = self.page == tile
        on, around = here[self.owner], (here & simple)[self.edge_owner]
        start, end = _single(self.start[around]) * side, _single(self.end[around]) * side
        runs = [
            face_runs(_single(self.corners[on]) * side, self.owner[on], side),
            outline_runs(start, end, self.edge_owner[around], side),
        ]
        return painted(Runs.joined(runs), side)


def faults(placed: PlacedCharts, options: PackOptions) -> tuple[str | None, FloatArray]:
    """Check a finished layout on the raster, as single-precision numbers, which formats store.

    Returns (the fault or None, (pages,) covered share of each page).
    """
    share = np.zeros(options.pages)
    for tile in range(options.pages):
        grid, clashes = placed.raster(tile, options.resolution)
        share[tile] = np.count_nonzero(grid >= 0) / grid.size
        edges = placed.page[placed.edge_owner] == tile
        start, end = _single(placed.start[edges]), _single(placed.end[edges])
        if start.size and (start.min() < 0 or start.max() > 1):
            return "a chart leaves the page", share
        clashes += shared_texels(
            grid, start * options.resolution, end * options.resolution, placed.edge_owner[edges]
        )
        if clashes:
            return f"{clashes} texels are touched by two charts", share
        gap, _ = smallest_gap(grid, options.padding + 1)
        if gap < options.padding + 1:
            wrong = f"two charts are {gap:.2f} texels apart where {options.padding + 1} are needed"
            return wrong, share
        border = free_border(grid)
        if border < options.padding:
            wrong = f"{border} texels are free at the border where {options.padding} are needed"
            return wrong, share
    return None, share


def crowded(placed: PlacedCharts, options: PackOptions) -> BoolArray:
    """(n,) bool: charts with a covered texel nearer to one of another chart than ``padding`` + 1."""
    out = np.zeros(len(placed.page), bool)
    for tile in range(options.pages):
        out[crowded_labels(placed.raster(tile, options.resolution)[0], options.padding + 1)] = True
    return out


def _single(values: FloatArray) -> FloatArray:
    return values.astype(np.float32).astype(np.float64)
