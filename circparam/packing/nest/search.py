"""Nesting: charts are placed one by one at the place of most contact, at every angle, holes included.

FFT correlates a grid of the page with the mask of a chart. Masks and their spectra are made once; a larger
scale of the charts is a smaller page on the same grid.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import IntArray
from circparam.packing.budget import Budget
from circparam.packing.nest.masks import Masks
from circparam.packing.nest.places import GridPages, Spectrum

QUARTERS = np.pi / 2 * np.array([0, 1, 2, -1])  # of a turn, in radians

# Spread of the logarithmic area by which later trials change the order.
LOG_AREA_SPREAD = 0.5

# Blurs of the contact score, 1, 2, 4 and 8 cells, one for each trial in turn: wide ones pull charts into bays.
# One blur alone covers 0.9 % less. After so many trials without a layout charts need larger pages.
BLURS = 4


@dataclass(frozen=True, eq=False)
class Board:
    """All charts as masks at one cell size. spectra: of the masks, on a grid of ``side`` cells a side.

    Pages have a cell less at least, so that no mask reaches round the grid.
    """

    masks: Sequence[Masks]
    spectra: Sequence[Spectrum]
    side: int


@dataclass(frozen=True, eq=False)
class GridLayout:
    """A layout on the grid: page side in cells, and for each chart its mask, row, column and page."""

    side: int
    mask: IntArray
    row: IntArray
    column: IntArray
    page: IntArray


def search(
    board: Board,
    side: int,
    pages: int,
    budget: Budget,
    least: int = 0,
    allowed: list[IntArray] | None = None,
) -> list[GridLayout]:
    """Layouts of falling page side, best first: a greedy search from many orders.

    Trials sort charts by area and by length, later ones with noise. Each trial takes half of the masks and the
    next blur, and finds the smallest page on which charts fit in that order. side, least: cells of the largest
    and of the smallest page that is of use. Without any layout the search ends after BLURS trials. allowed: the
    masks of each chart that may be used, None for all.
    """
    allowed = allowed or [np.arange(len(m.angle)) for m in board.masks]
    rng = np.random.default_rng(20)
    area = np.array([m.area.mean() for m in board.masks])
    # no page is smaller than the page that holds the longest chart alone, nor than all charts
    length = np.array([m.size[a].max(1).min() for m, a in zip(board.masks, allowed, strict=True)])
    least = max(least, int(length.max()), int(np.sqrt(area.sum() / pages)))
    layouts: list[GridLayout] = []
    trial = 0
    while side >= least and (layouts or trial < BLURS) and not budget.over:
        key = np.log(area) if trial % 2 == 0 else 2 * np.log(length)
        if trial > 1:
            key = key + rng.normal(0, LOG_AREA_SPREAD, len(key))
        masks = [a[_half(rng, len(a))] for a in allowed]
        order = np.argsort(-key, kind="stable")
        sigma = 2.0 ** (trial % BLURS)
        fits = partial(lay_out, board, order, sigma=sigma, pages=pages, choice=masks, budget=budget)
        found = smallest_page(fits, side, least)
        layouts = found + layouts
        side = layouts[0].side - 1 if layouts else side
        trial += 1
    return layouts


def smallest_page(
    fits: Callable[[int], GridLayout | None], side: int, least: int
) -> list[GridLayout]:
    """Layouts on pages from ``side`` down to ``least``, best first: if there is one at all, by bisection."""
    layouts: list[GridLayout] = []
    middle = side
    while least <= side:
        found = fits(middle)
        if found is not None:
            layouts.insert(0, found)
            side = middle - 1
        elif layouts:
            least = middle + 1
        else:
            break
        middle = (least + side) // 2
    return layouts


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


def _half(rng: np.random.Generator, n: int) -> IntArray:
    """About half of 0..n-1 at random, never none; all of a few."""
    pick = np.flatnonzero(rng.random(n) < 0.5) if n > 4 else np.arange(n)
    return pick if len(pick) else np.array([int(rng.integers(n))])
