"""Nesting from end to end: a search on a coarse grid, then the best layouts compacted until they lock."""

from dataclasses import field

import numpy as np

from circparam.core.arrays import IntArray
from circparam.core.records import dataclass
from circparam.packing.budget import Budget
from circparam.packing.nest.compaction import Ascent, compact
from circparam.packing.nest.growth import Growth
from circparam.packing.nest.schedule import SCHEDULE
from circparam.packing.nest.search import (
    GRID_SLACK,
    Board,
    GridLayout,
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

# First trust region of a layout that the check refuses, in texels of a page of 2048: it is all but locked.
STRICT_TRUST = 1.0


def nested(task: PackTask) -> Placement | None:
    """The best placement by nesting; None if the search found none.

    Layouts of the search grow beside layouts of other packers, which are the better start for charts like
    boxes. A long step may push a thin tip through a neighbour, and no later step undoes it. The check on the
    raster (``task.sound``) sees this, and the next layout is taken.
    """
    shapes, options = task.shapes, task.options
    if options.fixed_scale is not None:
        return _at_fixed_scale(task, options.fixed_scale)
    if shapes.n == 1:
        return _alone(shapes, options)
    layouts, straight = _layouts(task)
    candidates = layouts + list(task.found.values())
    budget = Budget(SCHEDULE.program_work * options.effort, lambda: task.monitor.expired)
    grown = _compacted(task, candidates, Growth(shapes, options, budget, straight))
    return grown or (layouts[0] if layouts else None)


def _layouts(task: PackTask) -> tuple[list[Placement], Straight | None]:
    """Layouts of the search, best first, and the charts that lie along the axes in them.

    Straight charts lie along the axes if that costs little: a layout with these charts at any angle must be so
    much better.
    """
    shapes, options = task.shapes, task.options
    straight = _straight(shapes, options)
    boards = _Boards(shapes, options, straight)
    if straight is None:
        return _searched(task, boards), None
    along = _searched(task, boards, along=True)
    if shapes.upright is not None:
        return along, straight
    beaten = along[0].scale / np.sqrt(1 - SCHEDULE.straight_loss) if along else 0.0
    free = _searched(task, boards, beaten)
    return (free, None) if free or not along else (along, straight)


def _straight(shapes: Shapes, options: PackOptions) -> Straight | None:
    """Charts that may have to lie along the axes; None for none. A chart longer than half a page need not."""
    if shapes.upright is not None:
        return Straight(np.zeros(shapes.n), shapes.upright)
    if options.rotate != "free" or options.straighten == "off":
        return None
    side = float(np.sqrt(shapes.area.sum() / SCHEDULE.covered_share / options.pages))
    straight = straight_charts(shapes, side / 2)
    return straight if straight.counts.any() else None


@dataclass(eq=False)
class _Boards:
    """Boards for all searches of the same charts, each made once. straight: charts that are tried along the
    axes too, at the first four of their angles."""

    shapes: Shapes
    options: PackOptions
    straight: Straight | None
    known: dict[float, Board] = field(default_factory=dict)

    @property
    def cells(self) -> int:
        """Side of a page in cells. Several pages share the cells of one, so that the work stays the same."""
        side = SCHEDULE.cells(self.shapes.n, self.options.effort)
        return max(int(side / np.sqrt(min(self.options.pages, 6))), 1)

    def of(self, density: float) -> Board:
        """The board of a page of which charts are hoped to cover ``density``."""
        if density not in self.known:
            cell = cell_size(self.shapes, self.options, self.cells, density)
            angles = chart_angles(self.shapes, self.options, cell)
            if self.straight is not None and self.shapes.upright is None:
                for c in np.flatnonzero(self.straight.counts).tolist():
                    along = self.straight.angle[c] + np.arange(4) * (np.pi / 2)
                    angles[c] = np.r_[along, angles[c]]
            self.known[density] = make_board(self.shapes, self.options, angles, self.cells, density)
        return self.known[density]

    def along(self, board: Board) -> list[IntArray]:
        """The masks of each chart with which straight charts lie along the axes."""
        counts = np.zeros(self.shapes.n, bool) if self.straight is None else self.straight.counts
        return [
            np.arange(4 if straight else len(m.angle))
            for straight, m in zip(counts.tolist(), board.masks, strict=True)
        ]


def _searched(
    task: PackTask, boards: _Boards, beaten: float = 0.0, along: bool = False
) -> list[Placement]:
    """Layouts of the search on the grid, best first; empty if it found none.

    beaten: scale that layouts must exceed, in texels per unit. along: straight charts lie along the axes. Both
    halve the budget, as there is another layout.
    """
    shapes, options = task.shapes, task.options
    box = shapes.boxes(least_square_angles(shapes, options.rotate))
    widest = float((box[:, 2:] - box[:, :2]).max())
    longest_alone = float(shapes.area.sum() / widest**2 / options.pages)
    density = min(SCHEDULE.covered_share, longest_alone)
    work = SCHEDULE.operations(shapes.n, options.effort) / (2 if along or beaten else 1)
    budget = Budget(work, lambda: task.monitor.expired)
    inner = options.resolution - 2 * options.border + options.gap
    found: list[GridLayout] = []
    while not budget.over:
        board = boards.of(density)
        largest = np.ceil(inner / (beaten * board.cell)) - 1 if beaten else np.inf
        allowed = boards.along(board) if along else None
        found = search(board, shapes, options, budget, largest, allowed)
        if found or beaten:
            break
        density /= GRID_SLACK**2  # pages of the next board begin where those of this one end
    return [to_placement(board, f, options) for f in _different(found)]


def _different(found: list[GridLayout]) -> list[GridLayout]:
    """One layout of each arrangement: those of one trial often differ in the page side only."""
    kept: list[GridLayout] = []
    for f in found:
        if all(not np.array_equal(f.mask, k.mask) for k in kept):
            kept.append(f)
        if len(kept) == SCHEDULE.candidates:
            break
    return kept


def _compacted(task: PackTask, candidates: list[Placement], growth: Growth) -> Placement | None:
    """The best candidate grown until it locks; None if none passes the check.

    All candidates grow by a few steps while half of the budget is left. The best of them grows on.
    """
    ascents: list[Ascent] = []
    for start in sorted(candidates, key=lambda p: -p.scale):
        if ascents and growth.budget.left < SCHEDULE.program_work * task.options.effort / 2:
            break
        ascent = Ascent(start)
        reached = max((a.placement.scale for a in ascents), default=0.0)
        ascent.climb(growth, SCHEDULE.rough_steps, reached)
        ascents.append(ascent)
    for ascent in sorted(ascents, key=lambda a: -a.placement.scale):
        ascent.climb(growth)
        if task.sound(ascent.placement):
            return ascent.placement
        # the straight strips were too narrow somewhere: the full gap everywhere may do
        safe = compact(growth, ascent.placement, STRICT_TRUST, strict=True)
        if task.sound(safe):
            return safe
    return None


def _inner(options: PackOptions) -> float:
    """Side in texels of the page between its borders."""
    return options.resolution - 2 * options.border


def _alone(shapes: Shapes, options: PackOptions) -> Placement:
    """One chart in the middle of its page, at the angle where it fits the smallest square."""
    angle = least_square_angles(shapes, options.rotate)
    box = shapes.boxes(angle)
    side = float((box[:, 2:] - box[:, :2]).max())
    straight = straight_charts(shapes, np.inf)
    if options.rotate == "free" and options.straighten != "off" and straight.counts.all():
        along = shapes.boxes(straight.angle)
        longer = float((along[:, 2:] - along[:, :2]).max())
        if (side / longer) ** 2 >= 1 - SCHEDULE.straight_loss:
            angle, box, side = straight.angle, along, longer
    scale = _inner(options) / side
    offset = options.resolution / 2 - (box[:, 2:] + box[:, :2]) / 2 * scale
    return Placement(scale, angle, offset, np.zeros(1, np.int64))


def _at_fixed_scale(task: PackTask, scale: float) -> Placement | None:
    """A layout at the scale the user fixed, on as few pages as the search finds."""
    shapes, options = task.shapes, task.options
    inner = options.resolution - 2 * options.border + options.gap
    # no compaction mends the error of this grid, so it is twice as fine
    cells = 2 * SCHEDULE.cells(shapes.n, options.effort)
    density = float(shapes.area.sum() * scale**2 / inner**2 / options.pages)
    if not 0 < density <= 1:
        return None
    angles = chart_angles(shapes, options, cell_size(shapes, options, cells, density))
    board = make_board(shapes, options, angles, cells, density)
    budget = Budget(SCHEDULE.operations(shapes.n, options.effort), lambda: task.monitor.expired)
    found = first_layout(board, shapes, options, cells, budget)
    return None if found is None else to_placement(board, found, options)
