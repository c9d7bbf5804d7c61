"""Nesting: charts are placed one by one at the place of most contact, at every angle, holes included.

FFT correlates a grid of the page with the mask of a chart. The first correlation is with the taken cells, where
any common cell forbids the place. The second is with those cells blurred, and measures contact. Masks and their
spectra are made once; a larger scale of the charts is a smaller page on the same grid.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from circparam.core import clock
from circparam.core.arrays import FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.packing.budget import Budget
from circparam.packing.nest.masks import Masks, chart_masks
from circparam.packing.nest.places import GridPages, Spectrum, sf, spectra_of
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles, least_square_angles
from circparam.packing.placement import Placement

# A chart gets so many angles that its tips move by at least this between two of them (cells).
_TIP = 3.0

# The grid of the transforms is this much larger than the page at the density that is hoped for.
SLACK = 1.25

# Side of the first page over the side at the expected density: a layout found at once costs less than two
# failures.
FIRST = 1.18

# A chart without a place goes earlier, as if its logarithmic size were larger by BLAME, up to RETRIES times a
# round. An early chart (below the share NEARLY of the area) does not.
RETRIES = 3
BLAME = 0.5
NEARLY = 0.9

# Blurs of the contact score, in cells, of the first tries.
SIGMAS = (2.0, 4.0, 1.2, 8.0, 3.0)


def cell_size(shapes: Shapes, options: PackOptions, cells: int, density: float) -> float:
    """Side of a cell in uv units at which charts cover ``density`` of all pages of ``cells`` squared."""
    return float(np.sqrt(shapes.area.sum() / (density * options.pages))) / cells


@dataclass(frozen=True, eq=False)
class Board:
    """All charts as masks at one cell size, with spectra. cell: uv units; side: of the FFT grid."""

    masks: list[Masks]
    spectra: list[Spectrum]
    cell: float
    side: int


def chart_angles(shapes: Shapes, options: PackOptions, cell: float, most: int) -> list[FloatArray]:
    """Angles at which each chart is tried: more for charts that reach further, at most ``most``."""
    box = least_box_angles(shapes, options.rotate)
    square = least_square_angles(shapes, options.rotate)
    reach = shapes.radius / cell
    count = 4 * np.ceil(np.clip(2 * np.pi * reach / _TIP, 8, most) / 4).astype(np.int64)
    if options.rotate != "free":
        count[:] = 1 if options.rotate == "none" else 4
        box[:] = 0.0
    more = (reach > 0.5 * reach.max()) & (options.rotate == "free")
    if shapes.upright is not None:
        count[shapes.upright], box[shapes.upright] = 4, 0.0
        more &= ~shapes.upright
    return [
        np.r_[
            box[c] + np.arange(count[c]) * (2 * np.pi / count[c]),
            square[c] + np.arange(4 if more[c] else 0) * (np.pi / 2),
        ]
        for c in range(shapes.n)
    ]


@dataclass(frozen=True, eq=False)
class GridLayout:
    """A layout on the grid: page side in cells, and for each chart its mask, row, column and page."""

    side: int
    mask: IntArray
    row: IntArray
    column: IntArray
    page: IntArray


def make_board(
    shapes: Shapes, options: PackOptions, angles: list[FloatArray], cells: int, density: float
) -> Board:
    """Masks and spectra at the scale at which charts cover ``density`` of a page of ``cells`` squared."""
    cell = cell_size(shapes, options, cells, density)
    # the page that is found may be larger than cells, and its texels so many more of them
    grow = options.gap / 2 * cells * SLACK / options.resolution
    masks = []
    largest = 0
    for c in range(shapes.n):
        a, b = shapes.outline(c)
        masks.append(chart_masks(a / cell, b / cell, angles[c], grow))
        largest = max(largest, int(masks[-1].size.min(0).max()))
    side = sf.good_size(max(int(cells * SLACK), largest + 2), True)
    while side % 2:
        side = sf.good_size(side + 1, True)
    return board_of(masks, cell, side)


def board_of(masks: list[Masks], cell: float, side: int) -> Board:
    """Masks of charts with their spectra on an FFT grid of ``side`` cells."""
    spectra = []
    for m in masks:
        clock.tick()
        spectra.append(spectra_of(m, side))
    return Board(masks, spectra, cell, side)


def lay_out(
    board: Board,
    order: IntArray,
    side: int,
    sigma: float,
    pages: int,
    choice: list[IntArray],
    budget: Budget,
) -> GridLayout | None:
    """Put charts in the order given on pages of ``side`` cells; None as soon as one does not fit.

    sigma: blur of the contact score in cells. choice: the masks of each chart that are tried.
    """
    found = _attempt(board, order, side, sigma, pages, choice, budget)
    return found if isinstance(found, GridLayout) else None


def _attempt(
    board: Board,
    order: IntArray,
    side: int,
    sigma: float,
    pages: int,
    choice: list[IntArray],
    budget: Budget,
) -> GridLayout | int:
    """As ``lay_out``; the chart that does not fit where one does not, −1 if the budget is used up."""
    at = np.zeros((4, len(board.masks)), np.int64)
    page = GridPages.empty(pages, board.side, side, sigma)
    for c in order.tolist():
        masks = board.masks[c]
        pick = choice[c][masks.size[choice[c]].max(1) <= side]
        if len(pick) == 0:
            return int(c)
        if not budget.spend(len(pick) * float(board.side) ** 2):
            return -1
        place = page.find(masks, board.spectra[c][pick], pick, masks.area[pick])
        if place is None:
            return int(c)
        page.fill(masks, *place)
        at[:, c] = place
    return GridLayout(side, *at)


def to_placement(board: Board, found: GridLayout, options: PackOptions) -> Placement:
    """A layout on the grid in texels. The free side of the page lies between the borders."""
    n = len(board.masks)
    k = found.mask
    angle = np.array([board.masks[c].angle[k[c]] for c in range(n)])
    low = np.array([board.masks[c].low[k[c]] for c in range(n)])
    # masks are grown by half the gap, which at the border is not needed: the free square is that much larger
    inner = options.resolution - 2 * options.border + options.gap
    texels = inner / found.side
    corner = np.stack([found.column, found.row], 1) - low
    offset = corner * texels + options.border - options.gap / 2
    return Placement(texels / board.cell, angle, offset, found.page)


@dataclass(frozen=True, eq=False)
class Terms:
    """Conditions for a layout. largest: page side in cells beyond which it is of no use (None: the whole grid).
    allowed: the masks of each chart that may be used (None: all). patience: tries until a first one."""

    largest: int | None = None
    allowed: list[IntArray] | None = None
    patience: int = 8


def search(
    board: Board,
    shapes: Shapes,
    options: PackOptions,
    cells: int,
    budget: Budget,
    terms: Terms = Terms(),  # noqa: B008
) -> list[GridLayout]:
    """Layouts of falling page side, best first.

    Greedy orders by size come first, then perturbed orders with a random part of the angles and another blur.
    Each must beat the best page side by a cell, and continues while it does.
    """
    allowed = terms.allowed or [np.arange(len(m.angle)) for m in board.masks]
    rng = np.random.default_rng(20)
    area = np.log(np.maximum(shapes.area, 1e-300))
    span = 2 * np.log(np.maximum(shapes.radius, 1e-300))
    climb = _Climb(board, shapes, options.pages, budget)
    most = int(board.side if terms.largest is None else min(board.side, terms.largest))
    # no page is smaller than the one that holds the longest chart alone
    least = max(int(m.size[a].max(1).min()) for m, a in zip(board.masks, allowed, strict=True))
    tried = 0
    failures = 0
    while failures < 400 and (climb.results[0].side if climb.results else most + 1) > least:
        key = area if tried % 2 == 0 else span
        sigma = SIGMAS[tried % len(SIGMAS)]
        share = 0.5
        if tried >= 4:
            key = key + rng.normal(0, 0.25, shapes.n)
            share = float(rng.choice([0.15, 0.3, 0.6]))
            sigma = float(np.exp(rng.uniform(0, 2.2)))
        choice = [a[_some(rng, len(a), share)] for a in allowed]
        tried += 1
        side = min(int(cells * FIRST), most)
        if failures and not climb.results:
            side = min(int(side * 1.05**failures), most)
        failures = 0 if climb.round(key, side, sigma, choice) else failures + 1
        if budget.left <= 0 or not budget.spend(0):
            break
        if not climb.results and failures > terms.patience:
            break
    return climb.results


@dataclass(eq=False)
class _Climb:
    """The way to smaller pages. results: layouts of falling page side, best first."""

    board: Board
    shapes: Shapes
    pages: int
    budget: Budget
    results: list[GridLayout] = field(default_factory=list)

    def round(self, key: FloatArray, side: int, sigma: float, choice: list[IntArray]) -> bool:
        """Lay out by falling key (n,) on smaller and smaller pages, the first of ``side`` where nothing is
        found yet; whether that found anything."""
        found_any, stride, again = False, 1, RETRIES
        order = np.argsort(-key, kind="stable")
        while True:
            if self.results:
                side = self.results[0].side - stride
            found = _attempt(self.board, order, side, sigma, self.pages, choice, self.budget)
            if isinstance(found, GridLayout):
                self.results.insert(0, found)
                found_any, stride = True, 2 * stride
            elif stride > 1:
                stride = 1
            elif again and found >= 0 and (self.results or self._placed(order, found) > NEARLY):
                again -= 1
                key = key + BLAME * (np.arange(len(key)) == found)
                order = np.argsort(-key, kind="stable")
            else:
                return found_any

    def _placed(self, order: IntArray, chart: int) -> float:
        """Share of the area of all charts that comes before one of them in an order."""
        area = self.shapes.area[order]
        return float(area[: int(np.flatnonzero(order == chart)[0])].sum() / area.sum())


def first_layout(
    board: Board, shapes: Shapes, options: PackOptions, side: int, budget: Budget
) -> GridLayout | None:
    """The first layout found on pages of ``side`` cells, the fewest pages first."""
    rng = np.random.default_rng(20)
    key = np.log(np.maximum(shapes.area, 1e-300))
    everything = [np.arange(len(m.angle)) for m in board.masks]
    for pages in range(1, options.pages + 1):
        if pages * side**2 < sum(float(m.area.min()) for m in board.masks):
            continue
        for tried in range(6):
            order = np.argsort(-key - rng.normal(0, 0.1 * tried, shapes.n), kind="stable")
            found = lay_out(board, order, side, SIGMAS[tried % 5], pages, everything, budget)
            if found is not None or budget.left <= 0:
                return found
    return None


def _some(rng: np.random.Generator, n: int, share: float) -> IntArray:
    """A random part of 0..n-1, never empty; all of a few."""
    pick = np.flatnonzero(rng.random(n) < share) if n > 4 else np.arange(n)
    return pick if len(pick) else np.array([int(rng.integers(n))])
