"""Charts placed between others: the layout of the large charts is completed with all small ones."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.packing.budget import Budget
from circparam.packing.nest.masks import Masks, chart_masks
from circparam.packing.nest.places import GridPages, Single, sf
from circparam.packing.nest.search import SIGMAS, Board, board_of
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes
from circparam.packing.placement import Placement

SIDE = 72  # cells along the page of the charts that lie already
SIDES = (1.0, 1.02, 1.04, 1.07, 1.1, 1.14, 1.2, 1.3)  # of that, pages that are tried for all
ANGLES = 12  # at most at which a chart is tried


def lying(placement: Placement) -> BoolArray:
    """(n,) the charts that lie somewhere."""
    return np.asarray(placement.page >= 0)


def filled(
    shapes: Shapes, options: PackOptions, start: Placement, angles: list[FloatArray], budget: Budget
) -> Placement | None:
    """A layout on one page with the unplaced charts put between the others. The page is the smallest of some
    that holds all; None if no page does.

    angles: at which each is tried. budget: of cells that are transformed.
    """
    there = lying(start)
    inner = options.resolution - 2 * options.border + options.gap
    frame = _Frame(inner / SIDE, options.border - options.gap / 2)
    grow = options.gap / 2 / frame.texels
    size = int(sf.good_size(int(SIDE * SIDES[-1]) + 1, True))
    used: Single = np.zeros((size, size), np.float32)
    world = shapes.place(start.angle, frame.cells(start.offset), start.scale / frame.texels)
    for c in np.flatnonzero(there).tolist():
        part = slice(shapes.edge_start[c], shapes.edge_start[c + 1])
        edges = world[shapes.start[part]], world[shapes.end[part]]
        _paint(used, chart_masks(*edges, np.zeros(1), grow))
    rest = np.flatnonzero(~there)
    rest = rest[np.argsort(-shapes.area[rest], kind="stable")]
    cell, outlines = frame.texels / start.scale, [shapes.outline(c) for c in rest.tolist()]
    masks = [
        chart_masks(a / cell, b / cell, angles[c][:ANGLES], grow)
        for c, (a, b) in zip(rest.tolist(), outlines, strict=True)
    ]
    board = board_of(masks, cell, size)
    for factor in SIDES:
        side = int(SIDE * factor)
        at = _put(board, used.copy(), side, budget)
        if at is not None:
            return _placement(start, board, (rest, at), frame, SIDE / side)
        if budget.over:
            break
    return None


@dataclass(frozen=True)
class _Frame:
    """Texels of a cell, and where the first cell begins."""

    texels: float
    begin: float

    def cells(self, offset: FloatArray) -> FloatArray:
        """Offsets in cells."""
        return (offset - self.begin) / self.texels


def _paint(used: Single, masks: Masks) -> None:
    """Set the cells of a chart that lies on the page."""
    x, y = masks.low[0].astype(np.int64).tolist()
    rows, columns = np.nonzero(masks.cells[0])
    rows, columns = rows + y, columns + x
    ok = (rows >= 0) & (columns >= 0) & (rows < len(used)) & (columns < len(used))
    used[rows[ok], columns[ok]] = 1


def _put(
    board: Board, used: Single, side: int, budget: Budget
) -> list[tuple[int, int, int]] | None:
    """The mask, row and column of each chart of a board on a page of ``side`` cells, or None."""
    used[side:] = 1
    used[:, side:] = 1
    page = GridPages(used[None], side, SIGMAS[0])
    at: list[tuple[int, int, int]] = []
    for masks, spectra in zip(board.masks, board.spectra, strict=True):
        pick = np.flatnonzero(masks.size.max(1) <= side)
        if len(pick) == 0 or not budget.spend(len(pick) * float(board.side) ** 2):
            return None
        place = page.find(masks, spectra[pick], pick, masks.area[pick].astype(np.float64))
        if place is None:
            return None
        page.fill(masks, *place)
        at.append(place[:3])
    return at


def _placement(
    start: Placement,
    board: Board,
    put: tuple[IntArray, list[tuple[int, int, int]]],
    frame: _Frame,
    smaller: float,
) -> Placement:
    """All charts on a page. The old layout takes ``smaller`` of its side."""
    angle, offset = start.angle.copy(), frame.cells(start.offset)
    for c, masks, (k, y, x) in zip(put[0].tolist(), board.masks, put[1], strict=True):
        angle[c] = masks.angle[k]
        offset[c] = np.array([x, y]) - masks.low[k]
    offset = offset * (frame.texels * smaller) + frame.begin
    return Placement(start.scale * smaller, angle, offset, np.zeros(len(angle), np.int64))
