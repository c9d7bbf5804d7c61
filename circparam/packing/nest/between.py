"""Charts placed between others: a layout of some charts is completed with all others."""

from dataclasses import replace

import numpy as np

from circparam.packing.budget import Budget
from circparam.packing.nest.masks import chart_masks
from circparam.packing.nest.places import GridPages, Single
from circparam.packing.nest.schedule import SCHEDULE
from circparam.packing.nest.search import SIGMAS, Board, chart_angles, make_board
from circparam.packing.placement import PackTask, Placement


def completed(task: PackTask, start: Placement) -> Placement | None:
    """A layout on one page with the charts of page −1 put between the others, the largest first.

    The page is the smallest of some that holds all charts; None if no page does. Charts that lie already keep
    their places. The budget counts the cells that are transformed.
    """
    shapes, options = task.shapes, task.options
    rest = np.flatnonzero(start.page < 0)
    if len(rest) == 0:
        return start
    rest = rest[np.argsort(-shapes.area[rest], kind="stable")]
    cells = SCHEDULE.cells(shapes.n, options.effort)
    texels = (options.resolution - 2 * options.border + options.gap) / cells
    first = options.border - options.gap / 2  # texel at which the first cell begins
    # the density at which a page at the scale of the start has so many cells
    cell = texels / start.scale
    density = float(shapes.area.sum() / (cells * cell) ** 2 / options.pages)
    board = make_board(shapes, options, chart_angles(shapes, options, cell), cells, density)
    used: Single = np.zeros((board.side, board.side), np.float32)
    at = replace(start, scale=start.scale / texels, offset=(start.offset - first) / texels)
    _paint(used, task, at, options.gap / 2 / texels)
    budget = Budget(SCHEDULE.operations(shapes.n, options.effort), lambda: task.monitor.expired)
    side, step = cells, 1
    while side <= board.side and not budget.over:
        placed = _put(board, rest.tolist(), used, side, budget)
        if placed is not None:
            angle, offset = start.angle.copy(), at.offset.copy()
            for c, (k, y, x) in zip(rest.tolist(), placed, strict=True):
                angle[c] = board.masks[c].angle[k]
                offset[c] = np.array([x, y]) - board.masks[c].low[k]
            smaller = cells / side
            offset = offset * (texels * smaller) + first
            return Placement(start.scale * smaller, angle, offset, np.zeros(shapes.n, np.int64))
        side, step = side + step, 2 * step
    return None


def _paint(used: Single, task: PackTask, placement: Placement, grow: float) -> None:
    """Take the cells of the charts that lie on the page; scale, offsets and ``grow`` are in cells."""
    shapes = task.shapes
    world = shapes.place(placement.angle, placement.offset, placement.scale)
    for c in np.flatnonzero(placement.page >= 0).tolist():
        part = slice(shapes.edge_start[c], shapes.edge_start[c + 1])
        edges = world[shapes.start[part]], world[shapes.end[part]]
        masks = chart_masks(*edges, np.zeros(1), grow)
        x, y = masks.low[0].astype(np.int64).tolist()
        rows, columns = np.nonzero(masks.cells[0])
        rows, columns = rows + y, columns + x
        ok = (rows >= 0) & (columns >= 0) & (rows < len(used)) & (columns < len(used))
        used[rows[ok], columns[ok]] = 1


def _put(
    board: Board, charts: list[int], used: Single, side: int, budget: Budget
) -> list[tuple[int, int, int]] | None:
    """The mask, row and column of each of some charts on a page of ``side`` cells; None without room."""
    used = used.copy()
    used[side:] = 1
    used[:, side:] = 1
    page = GridPages(used[None], side, SIGMAS[0])
    at: list[tuple[int, int, int]] = []
    for c in charts:
        masks = board.masks[c]
        pick = np.flatnonzero(masks.size.max(1) <= side)
        if len(pick) == 0 or not budget.spend(len(pick) * float(board.side) ** 2):
            return None
        place = page.find(masks, board.spectra[c][pick], pick, masks.area[pick])
        if place is None:
            return None
        page.fill(masks, *place)
        at.append(place[:3])
    return at
