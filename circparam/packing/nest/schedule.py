"""How much work goes into a page of nested charts."""

import math

from circparam.core.records import dataclass


@dataclass(frozen=True)
class Schedule:
    """Work of nesting at effort 1, which every effort multiplies; and the grid of its search.

    page_cells, chart_cells: side of a page on the grid, and by how much it grows with the root of the number of
        charts. Compaction mends the error of the grid, so finer ones only take longer.
    cells_power: power of the effort by which the grid is finer. The few trials of
        a draft find more on a coarse grid: 1.8 % of the page on 20 meshes.
    grid_operations: cells that a search transforms, over the cube root of the number of charts.
    program_work: rows times charts of all linear programs together, about a second.
    covered_share: share of the page that charts are hoped to cover; it sets the cell.
    candidates: layouts of the search that are compacted; the third one never won.
    rough_steps: linear programs by which candidates are compared; the best of them then grows until it locks.
    straight_loss: share of the covered area that straight charts along the axes may cost.
    """

    page_cells: int = 44
    chart_cells: int = 4
    cells_power: float = 0.125
    grid_operations: float = 1.5e7
    program_work: float = 5e6
    covered_share: float = 0.68
    candidates: int = 2
    rough_steps: int = 4
    straight_loss: float = 0.02

    def cells(self, charts: int, effort: float) -> int:
        """Side of a page of so many charts on the grid."""
        side = self.page_cells + self.chart_cells * math.sqrt(charts)
        return max(int(side * effort**self.cells_power), 1)

    def operations(self, charts: int, effort: float) -> float:
        """Cells that a search for so many charts may transform."""
        return self.grid_operations * math.cbrt(charts) * effort


SCHEDULE = Schedule()
