"""Nesting: charts are placed one by one at the place of most contact, at every angle, holes included.

FFT correlates a grid of the page with the mask of a chart. The first correlation is with the taken cells, where
any common cell forbids the place. The second is with those cells blurred, and measures contact. Masks and their
spectra are made once; a larger scale of the charts is a smaller page on the same grid.
"""

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

# A chart is tried at so many angles that its tips move by TIP_CELLS between two of them, up to ANGLES_MOST.
TIP_CELLS = 3.0
ANGLES_MOST = 24

# The grid of the transforms is this much larger than the page at the density that is hoped for.
GRID_SLACK = 1.18

# Spread of the logarithmic area by which later trials change the order.
LOG_AREA_SPREAD = 0.25

# Blurs of the contact score in cells, one for each trial in turn: wide ones pull charts into bays.
SIGMAS = tuple(2.0 ** np.array([1, 2, 0, 3]))

# Trials until the first layout; without one the charts need larger pages.
TRIALS_MOST = 8


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


def chart_angles(
    shapes: Shapes, options: PackOptions, cell: float, most: int = ANGLES_MOST
) -> list[FloatArray]:
    """Angles (k,) in radians at which each chart is tried: more for charts that reach further, about ``most``.

    cell: side of a cell in uv units.
    """
    box = least_box_angles(shapes, options.rotate)
    square = least_square_angles(shapes, options.rotate)
    reach = shapes.radius / cell
    count = 4 * np.ceil(np.clip(2 * np.pi * reach / TIP_CELLS, 8, most) / 4).astype(np.int64)
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
    side = sf.good_size(int(cells * GRID_SLACK), True)
    while side % 2:
        side = sf.good_size(side + 1, True)
    grow = (
        options.gap / 2 * side / options.resolution
    )  # on the largest page, whose texels are the most cells
    masks = []
    for c in range(shapes.n):
        a, b = shapes.outline(c)
        masks.append(chart_masks(a / cell, b / cell, angles[c], grow))
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

    order: (n,) charts. sigma: blur of the contact score in cells. choice: the masks of each chart that are
    tried. budget: of cells that are transformed.
    """
    at = np.zeros((4, len(board.masks)), np.int64)
    page = GridPages.empty(pages, board.side, side, sigma)
    for c in order.tolist():
        masks = board.masks[c]
        pick = choice[c][masks.size[choice[c]].max(1) <= side]
        budget.spend(float(board.side) ** 2 * max(len(pick), 1))
        if len(pick) == 0 or budget.over:
            return None
        place = page.find(masks, board.spectra[c][pick], pick, masks.area[pick])
        if place is None:
            return None
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


def search(
    board: Board,
    shapes: Shapes,
    options: PackOptions,
    budget: Budget,
    largest: float = np.inf,
    allowed: list[IntArray] | None = None,
) -> list[GridLayout]:
    """Layouts of falling page side, best first: a greedy search from many orders.

    Trials sort charts by area and by length, later ones with noise. Each trial takes half of the masks and the
    next blur, and shrinks the page as long as charts fit. largest: side in cells of the largest page that is
    of use. allowed: the masks of each chart that may be used, None for all.
    """
    allowed = allowed or [np.arange(len(m.angle)) for m in board.masks]
    rng = np.random.default_rng(20)
    area = np.log(np.maximum(shapes.area, 1e-300))
    length = 2 * np.log(np.maximum(shapes.radius, 1e-300))
    # no page is smaller than the page that holds the longest chart alone
    least = max(int(m.size[a].max(1).min()) for m, a in zip(board.masks, allowed, strict=True))
    side = int(min(board.side, largest))
    layouts: list[GridLayout] = []
    trial = 0
    while side >= least and not budget.over and (layouts or trial < TRIALS_MOST):
        key = length if trial % 2 else area
        if trial > 1:
            key = key + rng.normal(0, LOG_AREA_SPREAD, shapes.n)
        masks = [a[_half(rng, len(a))] for a in allowed]
        sigma = SIGMAS[trial % len(SIGMAS)]
        layouts = _shrink(board, key, side, sigma, options.pages, masks, budget) + layouts
        side = layouts[0].side - 1 if layouts else side
        trial += 1
    return layouts


def _shrink(
    board: Board,
    key: FloatArray,
    side: int,
    sigma: float,
    pages: int,
    choice: list[IntArray],
    budget: Budget,
) -> list[GridLayout]:
    """Layouts by falling key (n,) on smaller and smaller pages from ``side`` on, best first.

    Every success doubles the step to the next page.
    """
    order = np.argsort(-key, kind="stable")
    layouts: list[GridLayout] = []
    step = 1
    while side > 0:
        found = lay_out(board, order, side, sigma, pages, choice, budget)
        if found is not None:
            layouts.insert(0, found)
            step *= 2
            side = found.side - step
        elif step > 1:
            step = 1
            side = layouts[0].side - 1
        else:
            break
    return layouts


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
        for tried in range(TRIALS_MOST):
            order = np.argsort(-key - rng.normal(0, 0.1 * tried, shapes.n), kind="stable")
            found = lay_out(
                board, order, side, SIGMAS[tried % len(SIGMAS)], pages, everything, budget
            )
            if found is not None or budget.left <= 0:
                return found
    return None


def _half(rng: np.random.Generator, n: int) -> IntArray:
    """About half of 0..n-1 at random, never none; all of a few."""
    pick = np.flatnonzero(rng.random(n) < 0.5) if n > 4 else np.arange(n)
    return pick if len(pick) else np.array([int(rng.integers(n))])
