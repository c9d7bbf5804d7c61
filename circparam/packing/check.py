"""Whether a finished layout keeps its promises on the raster: no texel shared, gaps and borders wide enough."""

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.coverage import painted
from circparam.geometry.raster import crowded_labels, free_border, shared_texels, smallest_gap
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes


@dataclass(frozen=True, eq=False)
class PlacedCharts:
    """Charts as they lie on their pages, to be checked: in uv of the page each chart lies on.

    start, end: (b, 2) edges of their outlines. chart: (b,) whose they are. page: (n,) page of each chart.
    """

    start: FloatArray
    end: FloatArray
    chart: IntArray
    page: IntArray

    @classmethod
    def of(cls, shapes: Shapes, uv: FloatArray, page: IntArray) -> "PlacedCharts":
        """Charts at uv (nv, 2), in units of the page (n,) that each chart lies on."""
        return cls(uv[shapes.start], uv[shapes.end], shapes.owner[shapes.start], page)

    def on_page(self, tile: int, side: int) -> tuple[FloatArray, FloatArray, IntArray]:
        """Edges in texels of a page, from start (b, 2) to end, and their charts."""
        here = self.page[self.chart] == tile
        start, end = (x[here].astype(np.float32).astype(float) for x in (self.start, self.end))
        return start * side, end * side, self.chart[here]


def faults(placed: PlacedCharts, options: PackOptions) -> tuple[str | None, FloatArray]:
    """Check a finished layout on the raster, as single-precision numbers, which formats store.

    Returns (the fault or None, (pages,) covered share of each page).
    """
    share = np.zeros(options.pages)
    for tile in range(options.pages):
        start, end, chart = placed.on_page(tile, options.resolution)
        grid = painted(start, end, chart, options.resolution)
        share[tile] = np.count_nonzero(grid >= 0) / grid.size
        if start.size and (start.min() < 0 or start.max() > options.resolution):
            return "a chart leaves the page", share
        clashes = shared_texels(grid, start, end, chart)
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
        grid = painted(*placed.on_page(tile, options.resolution), options.resolution)
        out[crowded_labels(grid, options.padding + 1)] = True
    return out
