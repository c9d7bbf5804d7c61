"""Nesting from end to end: a search on a coarse grid, then the best layout compacted until it locks."""

import numpy as np

from circparam.core import clock
from circparam.packing.budget import Budget
from circparam.packing.nest.compaction import Ascent, Growth
from circparam.packing.nest.masks import chart_masks
from circparam.packing.nest.places import sf, spectra_of
from circparam.packing.nest.search import QUARTERS, Board, GridLayout, search
from circparam.packing.options import PackOptions
from circparam.packing.outlines import ANGLE_STEPS, Shapes, least_box_angles, least_square_angles
from circparam.packing.placement import PackTask, Placement
from circparam.packing.straight import Straight, straight_charts

# Side of the largest page on the grid, for one chart. It grows with the fourth root of the number of charts:
# with the sixth pages cover 2 to 3 % less, with 46 cells 0.8 % less. Compaction mends the error of the grid.
GRID_CELLS = 48

# Share of the largest page that the charts cover, so of the smallest that is worth a search.
SPARSE_SHARE = 0.5

# Cells that a search transforms, over the root of the number of charts; the linear programs of all
# ascents together have a hundredth as many rows.
GRID_OPERATIONS = 1.6e7

# Charts up to which there is a search at effort 1. More charts are as full from the skyline alone: 247 to 400
# charts 1.00 of the page in 0.6 of the time, 221 charts 0.98 in 0.7.
SEARCH_CHARTS = 250

# Share of the covered area that straight charts along the axes may cost.
STRAIGHT_LOSS = 0.02


def nested(task: PackTask) -> Placement | None:
    """The best placement by nesting; None if there is none.

    The layout of the search grows beside layouts of other packers, which are the better start for charts like
    boxes, and the only one for many charts. A long step may push a thin tip through a neighbour, and no later
    step undoes it. The check on the raster (``task.sound``) sees this, and the next layout is taken.
    """
    shapes, options = task.shapes, task.options
    if options.fixed_scale is not None:
        return _at_fixed_scale(task, options.fixed_scale)
    if shapes.n == 1:
        return _alone(shapes, options)
    start, straight = None, _straight(shapes, options)
    if shapes.n <= SEARCH_CHARTS * np.sqrt(options.effort):
        start, straight = _searched(task, straight)
    budget = Budget(GRID_OPERATIONS / 100 * options.effort, lambda: task.monitor.expired)
    growth = Growth(shapes, options, budget, straight)
    starts = [p for p in (start, *task.found.values()) if p is not None and p.scale >= task.least]
    grown = _compacted(task, starts, growth)
    if start is None or (grown is not None and grown.scale >= start.scale):
        return grown
    return start if grown is None or task.sound(start) else grown


def _searched(
    task: PackTask, straight: Straight | None
) -> tuple[Placement | None, Straight | None]:
    """The layout of the search, and which of the straight charts lie along the axes in it.

    Straight charts lie along the axes if that costs little: a layout with these charts at any angle must be so
    much better. Pages grow until there is a layout.
    """
    shapes, options = task.shapes, task.options
    # the least square that holds the longest chart
    square = float(shapes.sizes(least_square_angles(shapes, options.rotate)).max()) ** 2
    density = min(SPARSE_SHARE, shapes.area.sum() / square / options.pages)
    searches = 1 if straight is None or shapes.upright is not None else 2
    work = _work(shapes, options) / searches
    budgets = [Budget(work, lambda: task.monitor.expired) for _ in range(searches)]
    while not budgets[-1].over and density * options.resolution**2 > 1:
        board, cell = _board(shapes, options, density, straight)
        found, along = [], None
        # masks are grown by half the gap, which at the border is not needed
        most = (options.room + options.gap) / max(task.least * cell, 1e-300)
        side = int(min(board.side - 1, most))
        if straight is not None:
            count = np.where(straight.counts, 4, [len(m.angle) for m in board.masks])
            allowed = [np.arange(k) for k in count.tolist()]
            found, along = search(board, side, options.pages, budgets[0], allowed=allowed), straight
        if searches == 2 or straight is None:
            if found:
                side = int(np.ceil(found[0].side * np.sqrt(1 - STRAIGHT_LOSS))) - 1
            free = search(board, side, options.pages, budgets[-1])
            found, along = (free, None) if free else (found, along)
        if found:
            return to_placement(board, found[0], cell, options), along
        if side < board.side - 1:
            break
        density /= 2
    return None, None


def _work(shapes: Shapes, options: PackOptions) -> float:
    """Cells that a search may transform."""
    return float(GRID_OPERATIONS * np.sqrt(shapes.n) * options.effort)


def _cells(shapes: Shapes, options: PackOptions) -> int:
    """Side of a page in cells. Several pages share the cells of one, so that the work stays the same."""
    side = GRID_CELLS * np.sqrt(np.sqrt(shapes.n)) * np.cbrt(np.sqrt(options.effort))
    return max(int(side / np.sqrt(min(options.pages, 6))), 1)


def _straight(shapes: Shapes, options: PackOptions) -> Straight | None:
    """Charts that may have to lie along the axes; None for none. A chart longer than half a page need not."""
    if shapes.upright is not None:
        return Straight(np.zeros(shapes.n), shapes.upright)
    if options.rotate != "free" or options.straighten == "off":
        return None
    side = float(np.sqrt(shapes.area.sum() / SPARSE_SHARE / options.pages))
    straight = straight_charts(shapes, side / 2)
    return straight if straight.counts.any() else None


def _board(
    shapes: Shapes,
    options: PackOptions,
    density: float,
    straight: Straight | None = None,
    cells: int | None = None,
) -> tuple[Board, float]:
    """(masks of all charts, side of a cell in uv units) on pages of which charts cover ``density``.

    straight: charts that are tried along the axes too, at the first four of their angles. cells: side of a
    page, None for that of the search.
    """
    grid = int(sf.good_size((cells or _cells(shapes, options)) + 1, True))
    side = grid - 1
    cell = float(np.sqrt(shapes.area.sum() / (density * options.pages))) / side
    # on the largest page, whose texels are the most cells; see ``to_placement``
    grow = options.gap / 2 * side / (options.room + options.gap)
    box = least_box_angles(shapes, options.rotate)
    square = least_square_angles(shapes, options.rotate)
    upright = np.zeros(shapes.n, bool) if shapes.upright is None else shapes.upright
    # from one angle to the next no tip moves further than a tip of the largest chart does
    reach = shapes.radius / shapes.radius.max()
    count = 4 * np.maximum(np.ceil(reach * ANGLE_STEPS / 4), 1)
    masks, spectra = [], []
    for c in range(shapes.n):
        clock.tick()
        angles = QUARTERS[:1] if options.rotate == "none" else QUARTERS
        if options.rotate == "free" and not upright[c]:
            # even ones from that of the least box, quarters from that of the least square
            even = box[c] + 2 * np.pi / count[c] * np.arange(count[c])
            angles = np.concatenate([even, square[c] + QUARTERS])
        if straight is not None and straight.counts[c] and shapes.upright is None:
            angles = np.r_[straight.angle[c] + QUARTERS, angles]
        a, b = shapes.outline(c)
        masks.append(chart_masks(a / cell, b / cell, angles, grow))
        spectra.append(spectra_of(masks[-1], grid))
    return Board(masks, spectra, grid), cell


def to_placement(board: Board, found: GridLayout, cell: float, options: PackOptions) -> Placement:
    """A layout on the grid in texels. The free side of the page lies between the borders."""
    chosen = list(zip(board.masks, found.mask.tolist(), strict=True))
    angle = np.array([m.angle[k] for m, k in chosen])
    low = np.array([m.low[k] for m, k in chosen])
    # masks are grown by half the gap, which at the border is not needed: the free square is that much larger
    texels = (options.room + options.gap) / found.side
    corner = np.stack([found.column, found.row], 1) - low
    offset = corner * texels + options.border - options.gap / 2
    return Placement(texels / cell, angle, offset, found.page)


def _compacted(task: PackTask, candidates: list[Placement], growth: Growth) -> Placement | None:
    """The best candidate grown until it locks; None if none passes the check.

    All candidates grow by a step while half of the budget is left. The best of them grows on.
    """
    ascents: list[Ascent] = []
    half = growth.budget.left / 2
    for start in sorted(candidates, key=lambda p: -p.scale):
        if ascents and growth.budget.left < half:
            break
        ascent = Ascent(start)
        reached = max((a.placement.scale for a in ascents), default=0.0)
        ascent.climb(growth, 1, reached)
        ascents.append(ascent)
    for ascent in sorted(ascents, key=lambda a: -a.placement.scale):
        if task.sound(ascent.climb(growth)) or task.sound(ascent.settle(growth)):
            return ascent.placement
    return None


def _alone(shapes: Shapes, options: PackOptions) -> Placement:
    """One chart in the middle of its page, at the angle where it fits the smallest square."""
    angle = least_square_angles(shapes, options.rotate)
    side = float(shapes.sizes(angle).max())
    straight = straight_charts(shapes, np.inf)
    if options.rotate == "free" and options.straighten != "off" and straight.counts.all():
        longer = float(shapes.sizes(straight.angle).max())
        if (side / longer) ** 2 >= 1 - STRAIGHT_LOSS:
            angle, side = straight.angle, longer
    box = shapes.boxes(angle)
    scale = options.room / side
    offset = options.resolution / 2 - (box[:, 2:] + box[:, :2]) / 2 * scale
    return Placement(scale, angle, offset, np.zeros(1, np.int64))


def _at_fixed_scale(task: PackTask, scale: float) -> Placement | None:
    """A layout at the scale the user fixed, on as few pages as the search finds."""
    shapes, options = task.shapes, task.options
    area = float(shapes.area.sum()) * scale**2
    page = (options.room + options.gap) ** 2
    if not 0 < area <= page * options.pages:
        return None
    # no compaction mends the error of this grid, so it is twice as fine
    cells = 2 * _cells(shapes, options)
    board, cell = _board(shapes, options, area / page / options.pages, cells=cells)
    budget = Budget(_work(shapes, options), lambda: task.monitor.expired)
    for pages in range(1, options.pages + 1):
        found = search(board, board.side - 1, pages, budget, least=board.side - 1)
        if found:
            return to_placement(board, found[0], cell, options)
    return None
