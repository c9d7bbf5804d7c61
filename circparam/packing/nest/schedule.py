"""How much work goes into a page of nested charts."""

from __future__ import annotations

from circparam.core.records import dataclass


@dataclass(frozen=True)
class Schedule:
    """Effort of nesting by the number of charts: set by trial, so that a search takes seconds at effort 1.

    hoped_share: share of the page that is hoped for; it sets the cell. Where no layout fits, the next try hopes
        for ``less_hope`` times as much, ``tries`` times in all.
    few, very_few, handful: numbers of charts. Up to ``few`` the grid is coarse, up to ``very_few`` several
        layouts are compacted, up to ``handful`` grid and search are smaller still.
    handful_cells, coarse_cells, cells: side of the grid, coarse for few charts because compaction follows. On
        13 meshes 64 cells cover 0.605 of the page in the mean, 128 cells 0.596 with more than twice the cells.
        On three meshes of 63 to 96 charts 96 cells cover 0.607, 128 cells 0.594, 192 cells 0.573.
    fixed_cells: side of the grid at a scale the user fixed, which the compaction does not mend afterwards.
    handful_budget, coarse_budget, budget: cells transformed in the search on each grid: half a second or less.
    beaten, patience: for a given start: share of its scale that the search must reach, and tries until the
        first success.
    compacted_up_to: charts up to which the linear programs are solved in a second or so.
    kept: layouts of very few charts that are compacted; one of more.
    full: share of the scale at which the longest chart fills the page alone, from which on nothing else is
        searched.
    rough_steps, fine_steps, many_fine_steps: linear programs for each candidate, then for the best, of few and
        of many charts. fine_trust: the first trust region of the latter, in texels of a page of 2048; small, as
        the rough ones leave little to move.
    strict_steps, strict_trust: the same for a layout that the check refuses: it is all but locked.
    rows: rows of all linear programs together; beyond, the steps end.
    shelf_below: of many charts, rows of boxes are compacted only where nothing reached that much more than
        their scale.
    lone_rounds: rounds of the search for the angle of a single chart, each four times finer.
    askew: share of the side of a page beyond which a straight chart may lie as it fits best.
    straight_cost: share of the covered area that straight charts along the axes may cost. The search measures
        the cost with ``straight_budget`` times its budget if these charts have ``straight_area`` of the area.
    tiling: share of the area in straight charts from which few charts get the grid of many. Rounding to coarse
        cells would lose tilings (0.82 to 0.89 of the page on a part of 30 rectangles).
    tiny_area, tiny_reach, tiny_share: a chart up to this share of the area and this diameter, in roots of the
        area, is tiny. If all tiny charts of many have at most ``tiny_share``, the others are laid out first
        (scans of 69 and 104 charts: 0.65 to 0.71 and 0.68 to 0.73 of the page, of 75 the same).
    """

    hoped_share: float = 0.68
    less_hope: float = 0.75
    tries: int = 4
    few: int = 60
    very_few: int = 30
    handful: int = 12
    handful_cells: int = 56
    handful_budget: float = 1.5e7
    coarse_cells: int = 64
    cells: int = 96
    fixed_cells: int = 160
    coarse_budget: float = 0.45e8
    budget: float = 0.6e8
    patience: int = 100
    compacted_up_to: int = 150
    kept: int = 2
    smaller: float = 0.97
    beaten: float = 0.94
    full: float = 0.9995
    rough_steps: int = 5
    fine_steps: int = 12
    many_fine_steps: int = 7
    fine_trust: float = 8.0
    strict_steps: int = 3
    strict_trust: float = 1.0
    rows: float = 250_000
    shelf_below: float = 1.03
    lone_rounds: int = 8
    askew: float = 0.5
    straight_cost: float = 0.02
    straight_budget: float = 0.5
    straight_area: float = 0.05
    tiling: float = 0.5
    tiny_area: float = 0.004
    tiny_reach: float = 0.2
    tiny_share: float = 0.03


SCHEDULE = Schedule()
