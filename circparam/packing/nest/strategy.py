"""Nesting from end to end: a search on a coarse grid, then the best layouts compacted until they lock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace

import numpy as np

from circparam.core.arrays import IntArray
from circparam.core.records import dataclass
from circparam.packing.budget import Budget
from circparam.packing.nest.between import ANGLES, SIDE, filled, lying
from circparam.packing.nest.compaction import compact, roughly
from circparam.packing.nest.growth import Growth
from circparam.packing.nest.schedule import SCHEDULE
from circparam.packing.nest.search import (
    Board,
    GridLayout,
    Terms,
    cell_size,
    chart_angles,
    first_layout,
    make_board,
    search,
    to_placement,
)
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_square_angles
from circparam.packing.placement import PackTask, Placement
from circparam.packing.straight import Straight, straight_charts

ALONG = 4  # angles at which a straight chart lies along the axes


def nested(
    task: PackTask,
    skyline: Callable[[], Placement | None] = lambda: None,
    shelf: Placement | None = None,
) -> Placement | None:
    """The best placement by nesting; None if the search found none.

    skyline: layout of charts on a skyline, compacted in place of the search's layout, or beside it for few
    charts. shelf: rows of boxes, compacted too if the others fail: for charts like boxes they can be the best
    start. A long first step may push a thin tip through a neighbour, and no later step undoes it. The check on
    the raster (``task.sound``) sees this, and the next layout is taken.
    """
    shapes, options = task.shapes, task.options
    if options.fixed_scale is not None:
        return _at_fixed_scale(task, options.fixed_scale)
    if shapes.n == 1:
        return _alone(shapes, options)
    if task.start is None:
        task = replace(task, start=_large_first(task))
    task = _begun(task)
    if task.start is not None:
        going_on = _going_on(task)
        if going_on is not None:
            return going_on
    layouts, straight = _layouts(task)
    if shapes.n <= SCHEDULE.compacted_up_to:
        compacted = _compacted(task, layouts, (skyline(), shelf), _growth(task, straight))
        if compacted is not None:
            return compacted
    return layouts[0] if layouts else None


def _large_first(task: PackTask) -> Placement | None:
    """If most of many charts are tiny: a layout of the large charts, which are few and so are laid out better.
    The others, on page −1, find a place between them. None for other charts."""
    shapes, options = task.shapes, task.options
    if shapes.n <= SCHEDULE.few or options.pages > 1 or options.rotate != "free":
        return None
    area = float(shapes.area.sum())
    long = 2 * shapes.radius > SCHEDULE.tiny_reach * np.sqrt(area)
    large = np.flatnonzero(long | (shapes.area > SCHEDULE.tiny_area * area))
    if len(large) > SCHEDULE.few or shapes.area[large].sum() < (1 - SCHEDULE.tiny_share) * area:
        return None
    alone = replace(task, shapes=shapes.part(large), found={}, sound=lambda _: True)
    found = nested(alone)
    if found is None:
        return None
    angle, offset, page = np.zeros(shapes.n), np.zeros((shapes.n, 2)), np.full(shapes.n, -1)
    angle[large], offset[large], page[large] = found.angle, found.offset, found.page
    return Placement(found.scale, angle, offset, page)


def _begun(task: PackTask) -> PackTask:
    """The task with all charts placed in the given layout, if that holds only the large ones."""
    shapes, options, start = task.shapes, task.options, task.start
    if start is None or lying(start).all():
        return task
    budget = Budget(SCHEDULE.coarse_budget * options.effort, lambda: task.monitor.expired)
    inner = options.resolution - 2 * options.border + options.gap
    cell = inner / SIDE / start.scale
    angles = chart_angles(shapes, options, cell, ANGLES)
    return replace(task, start=filled(shapes, options, start, angles, budget))


def _going_on(task: PackTask) -> Placement | None:
    """The given layout grown until it locks, or a better one of the search. None for straight charts, which may
    have to lie along the axes, or if no layout passes the check."""
    shapes, start = task.shapes, task.start
    side = float(np.sqrt(shapes.area.sum() / SCHEDULE.hoped_share / task.options.pages))
    if start is None:
        return None
    if (
        task.options.straighten != "off"
        and straight_charts(shapes, SCHEDULE.askew * side).counts.any()
    ):
        return None
    growth = _growth(task, None)
    grown = _grown(task, growth, start) if shapes.n <= SCHEDULE.few else None
    better: list[Placement] = []
    if grown is None or grown.scale < SCHEDULE.full * _most(shapes, task.options):
        boards, beat = _Boards(shapes, task.options, None), start.scale * SCHEDULE.beaten
        better = _searched(task, boards, beat=beat, patience=SCHEDULE.patience)
    return _compacted(task, better, (None, None), growth, grown)


def _most(shapes: Shapes, options: PackOptions) -> float:
    """The scale at which the longest chart alone fills its page."""
    box = shapes.boxes(least_square_angles(shapes, options.rotate))
    return (options.resolution - 2 * options.border) / float((box[:, 2:] - box[:, :2]).max())


def _growth(task: PackTask, straight: Straight | None) -> Growth:
    """Data and budget that all compacted layouts share."""
    rows = SCHEDULE.rows * min(1.0, max(4 * task.options.effort, 0.25))
    return Growth(task.shapes, task.options, Budget(rows, lambda: task.monitor.expired), straight)


def _grown(task: PackTask, growth: Growth, start: Placement) -> Placement:
    """The layout that is known already, grown: a little smaller at first, as its gaps may be narrow."""
    smaller = replace(start, scale=start.scale * SCHEDULE.smaller)
    steps = _steps(SCHEDULE.rough_steps, min(1.0, 4 * task.options.effort))
    return roughly(growth, smaller, steps, 0.0)


def _layouts(task: PackTask) -> tuple[list[Placement], Straight | None]:
    """Layouts of the search, and the charts that lie along the axes in them.

    Straight charts lie along the axes if that costs little. A layout without straight charts along the axes
    must be this much better, so the search asks for no less.
    """
    shapes, options = task.shapes, task.options
    straight = None
    if shapes.upright is not None:
        straight = Straight(np.zeros(shapes.n), shapes.upright)
        return _searched(task, _Boards(shapes, options, straight)), straight
    if options.rotate == "free" and options.straighten != "off":
        side = float(np.sqrt(shapes.area.sum() / SCHEDULE.hoped_share / options.pages))
        straight = straight_charts(shapes, SCHEDULE.askew * side)
        if shapes.area[straight.counts].sum() < SCHEDULE.straight_area * shapes.area.sum():
            straight = None
    boards = _Boards(shapes, options, straight)
    along = _searched(task, boards, along=True) if straight is not None else []
    if not along:
        return _searched(task, boards), None
    free = _searched(task, boards, beat=along[0].scale / np.sqrt(1 - SCHEDULE.straight_cost))
    return (free, None) if free else (along, straight)


@dataclass(eq=False)
class _Boards:
    """Boards for all searches of the same charts, each made once.

    straight: charts that are tried along the axes too, at the first ``ALONG`` of their angles.
    """

    shapes: Shapes
    options: PackOptions
    straight: Straight | None
    known: dict[tuple[int, float], Board] = field(default_factory=dict)

    @property
    def tiling(self) -> bool:
        """Whether straight charts have most of the area; coarse cells would lose their tiling."""
        if self.straight is None:
            return False
        area = self.shapes.area
        return bool(area[self.straight.counts].sum() > SCHEDULE.tiling * area.sum())

    def of(self, cells: int, density: float) -> Board:
        """The board of ``cells`` squared of which charts are hoped to cover ``density``."""
        if (cells, density) not in self.known:
            shapes = self.shapes
            cell = cell_size(shapes, self.options, cells, density)
            most = 64 if shapes.n <= SCHEDULE.very_few else 24
            angles = chart_angles(shapes, self.options, cell, most)
            if self.straight is not None and shapes.upright is None:
                for c in np.flatnonzero(self.straight.counts).tolist():
                    angles[c] = np.r_[
                        self.straight.angle[c] + np.arange(ALONG) * (np.pi / 2), angles[c]
                    ]
            self.known[cells, density] = make_board(shapes, self.options, angles, cells, density)
        return self.known[cells, density]

    def along(self, board: Board) -> list[IntArray]:
        """The masks of each chart with which straight charts lie along the axes."""
        counts = np.zeros(self.shapes.n, bool) if self.straight is None else self.straight.counts
        return [np.arange(ALONG if counts[c] else len(m.angle)) for c, m in enumerate(board.masks)]


def _compacted(
    task: PackTask,
    layouts: list[Placement],
    plain: tuple[Placement | None, Placement | None],
    growth: Growth,
    grown: Placement | None = None,
) -> Placement | None:
    """The best layout grown until it locks; None if none passes the check.

    plain: skyline and shelf. grown: result of ``_grown`` for the given layout, with the same budget.
    """
    (skyline, shelf), budget = plain, growth.budget
    shapes, options = task.shapes, task.options
    few = shapes.n <= SCHEDULE.few
    part = min(1.0, 4 * options.effort)
    starts = layouts[: SCHEDULE.kept if shapes.n <= SCHEDULE.very_few else 1]
    if task.start is not None:  # in place of the second layout
        starts = starts[:1]
        if grown is None:
            starts.insert(0, replace(task.start, scale=task.start.scale * SCHEDULE.smaller))
    starts += [skyline] if skyline is not None else []
    if not few:
        starts = sorted(starts, key=lambda p: -p.scale)[:1]
    rough = [] if grown is None else [grown]
    for start in [*starts, *([shelf] if shelf is not None else [])]:
        if budget.late or (rough and budget.left < SCHEDULE.rows / 3):
            continue
        reached = rough[0].scale if rough else 0.0
        if start is shelf and not few and reached > SCHEDULE.shelf_below * start.scale:
            continue
        rough.append(roughly(growth, start, _steps(SCHEDULE.rough_steps, part), reached))
        rough.sort(key=lambda p: -p.scale)
    steps = _steps(SCHEDULE.fine_steps if few else SCHEDULE.many_fine_steps, part)
    for start in rough:
        # half the steps where all of them lead astray
        for count in (steps, steps // 2):
            fine = compact(growth, start, count, SCHEDULE.fine_trust)
            if task.sound(fine):
                return fine
            # the straight strips were too narrow somewhere: the full gap everywhere may do
            safe = compact(growth, fine, SCHEDULE.strict_steps, SCHEDULE.strict_trust, True)
            if task.sound(safe):
                return safe
    return None


def on_page(placement: Placement, before: PackOptions, after: PackOptions) -> Placement:
    """The same layout on a page of another resolution and padding."""
    if before is after:
        return placement
    factor = _inner(after) / _inner(before)
    offset = (placement.offset - before.border) * factor + after.border
    return replace(placement, scale=placement.scale * factor, offset=offset)


def _inner(options: PackOptions) -> float:
    """Side in texels of the page between its borders."""
    return options.resolution - 2 * options.border


def _alone(shapes: Shapes, options: PackOptions) -> Placement:
    """One chart in the middle of its page, at the angle where it fits the smallest square."""
    angle = least_square_angles(shapes, options.rotate, rounds=SCHEDULE.lone_rounds)
    box = shapes.boxes(angle)
    side = float((box[:, 2:] - box[:, :2]).max())
    scale = (options.resolution - 2 * options.border) / side
    straight = straight_charts(shapes, np.inf)
    if options.rotate == "free" and options.straighten != "off" and straight.counts.all():
        along = shapes.boxes(straight.angle)
        longer = float((along[:, 2:] - along[:, :2]).max()) / side
        if longer**2 <= 1 + SCHEDULE.straight_cost:
            angle, box, side = straight.angle, along, side * longer
            scale = (options.resolution - 2 * options.border) / side
    middle = (box[:, 2:] + box[:, :2]) / 2
    offset = options.resolution / 2 - middle * scale
    return Placement(scale, angle, offset, np.zeros(1, np.int64))


def _steps(most: int, part: float) -> int:
    return max(2, round(most * part))


def _searched(
    task: PackTask,
    boards: _Boards,
    along: bool = False,
    beat: float | None = None,
    patience: int = Terms.patience,
) -> list[Placement]:
    """Layouts of the search on the grid, best first; empty if it found none.

    along: straight charts lie along the axes in all of them. beat: scale that they must exceed, for which one
    grid is searched, with half the budget as with straight charts. patience: tries until a first one.
    """
    shapes, options = task.shapes, task.options
    # several pages share the cells of one, so that the work stays the same
    few = shapes.n <= SCHEDULE.few
    side, operations = SCHEDULE.cells, SCHEDULE.budget
    if shapes.n <= SCHEDULE.handful:
        side, operations = SCHEDULE.handful_cells, SCHEDULE.handful_budget
    elif few and not boards.tiling:
        side, operations = SCHEDULE.coarse_cells, SCHEDULE.coarse_budget
    cells = int(side / np.sqrt(min(options.pages, 6)))
    box = shapes.boxes(least_square_angles(shapes, options.rotate))
    widest = float((box[:, 2:] - box[:, :2]).max())
    density = float(min(SCHEDULE.hoped_share, 0.97 * shapes.area.sum() / widest**2 / options.pages))
    operations *= SCHEDULE.straight_budget if along or beat is not None else 1.0
    budget = Budget(operations * options.effort, lambda: task.monitor.expired)
    for _ in range(SCHEDULE.tries if beat is None else 1):
        board = boards.of(cells, density)
        largest = None
        if beat is not None:
            inner = options.resolution - 2 * options.border + options.gap
            largest = int(np.ceil(inner / (beat * board.cell))) - 1
        terms = Terms(largest, boards.along(board) if along else None, patience)
        found = search(board, shapes, options, cells, budget, terms)
        if found or budget.over:
            return [to_placement(board, f, options) for f in _different(found)]
        density *= SCHEDULE.less_hope
    return []


def _different(found: list[GridLayout]) -> list[GridLayout]:
    """The best layouts, one of each arrangement: those of one climb often differ in the page side only."""
    kept: list[GridLayout] = []
    for f in found:
        if all(not np.array_equal(f.mask, k.mask) for k in kept):
            kept.append(f)
    return kept[:4]


def _at_fixed_scale(task: PackTask, scale: float) -> Placement | None:
    """A layout at the scale the user fixed, on as few pages as the search finds."""
    shapes, options = task.shapes, task.options
    inner = options.resolution - 2 * options.border + options.gap
    cells = SCHEDULE.fixed_cells
    # the cell at which a page at that scale has this many cells a side
    density = float(shapes.area.sum() * scale**2 / inner**2 / options.pages)
    if not 0 < density <= 1:
        return None
    cell = cell_size(shapes, options, cells, density)
    angles = chart_angles(shapes, options, cell, 32 if shapes.n <= SCHEDULE.very_few else 16)
    board = make_board(shapes, options, angles, cells, density)
    budget = Budget(SCHEDULE.budget * options.effort, lambda: task.monitor.expired)
    found = first_layout(board, shapes, options, cells, budget)
    return None if found is None else to_placement(board, found, options)
