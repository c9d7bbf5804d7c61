"""Sketches of pages: how large a page some outlines need, told in milliseconds on a coarse grid.

For whoever weighs many changes of the charts against each other: sketches rank them. What a page of charts
covers in the end is a tenth more, since packing goes on from such a layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.packing.budget import Budget
from circparam.packing.nest.masks import Masks, chart_masks
from circparam.packing.nest.search import SIGMAS, Spectrum, blur_transfer, sf

SEED = 9
# even angles at which an outline is tried: none of its tips moves by more than TIP cells between
LEAST_ANGLES, ANGLES, TIP = 8, 16, 3.0
TURNS = np.arange(24) * (
    np.pi / 48
)  # among which those of the least box and the least square are found
FULLEST = 0.78  # share of its cells that no page of a few outlines fills: none smaller is tried
SHUFFLED = 0.3  # spread of the logarithm of the sizes by which later tries change the order
# tries in which all masks take part, by size and by reach; later ones take half of them
FIRST_TRIES = 2
LARGEST = 4  # outlines that are tried at all their angles; smaller ones at every other one


@dataclass(frozen=True, eq=False)
class Sketch:
    """One outline as masks at several angles.

    start, end: (e, 2) its edges about the middle (2,) of their box, in uv units. area, least: the cells it has,
    and the side of the smallest page that holds it alone.
    """

    start: FloatArray
    end: FloatArray
    middle: FloatArray
    masks: Masks
    area: float
    least: int


@dataclass(frozen=True, eq=False)
class SketchedPage:
    """Where sketches lie on a page of ``side`` cells: the mask, row and column of each (n,)."""

    side: int
    mask: IntArray
    row: IntArray
    column: IntArray


@dataclass(frozen=True, eq=False)
class Easel:
    """What all sketches have in common. cell: its side in uv units. grow: cells that outlines are grown by."""

    cell: float
    grow: float

    def sketch(self, start: FloatArray, end: FloatArray) -> Sketch:
        """An outline of edges from start to end (e, 2) in uv units."""
        middle = (start.min(0) + start.max(0)) / 2
        angles = _angles(start[:: max(len(start) // 100, 1)] / self.cell)
        start, end = start - middle, end - middle
        masks = chart_masks(start / self.cell, end / self.cell, angles, self.grow)
        return Sketch(
            start, end, middle, masks, float(masks.area.mean()), int(masks.size.max(1).min())
        )


def _angles(points: FloatArray) -> FloatArray:
    """Angles for an outline (cells): even ones from that of its least box, and those of its least square."""
    c, s = np.cos(TURNS), np.sin(TURNS)
    w = np.ptp(np.outer(c, points[:, 0]) - np.outer(s, points[:, 1]), axis=1)
    h = np.ptp(np.outer(s, points[:, 0]) + np.outer(c, points[:, 1]), axis=1)
    box, square = TURNS[int(np.argmin(w * h))], TURNS[int(np.argmin(np.maximum(w, h)))]
    around = np.pi * float(np.maximum(w, h).max())
    count = 4 * int(np.ceil(np.clip(around / TIP, LEAST_ANGLES, ANGLES) / 4))
    even: FloatArray = box + np.arange(count) * (2 * np.pi / count)
    if count < ANGLES:
        return even
    return np.concatenate([even, square + np.arange(4) * (np.pi / 2)])


@dataclass(frozen=True, eq=False)
class _Board:
    """Sketches on a grid of ``side`` squared cells; spectra: (k, side, side // 2 + 1), those of their masks."""

    sketches: Sequence[Sketch]
    spectra: list[Spectrum]
    side: int


def _board(sketches: Sequence[Sketch], side: int) -> _Board:
    """The board for pages of up to ``side`` cells."""
    size = int(sf.next_fast_len(side, real=True))
    spectra = []
    for s in sketches:
        block = np.zeros((len(s.masks.cells), size, size), np.float32)
        h, w = (min(k, size) for k in s.masks.cells.shape[1:])
        block[:, :h, :w] = s.masks.cells[:, :h, :w]
        spectra.append(np.conj(sf.rfft2(block)))
    return _Board(sketches, spectra, size)


def least_page(
    sketches: Sequence[Sketch], below: int, tries: int, budget: Budget
) -> SketchedPage | None:
    """The smallest page found that holds all sketches; None where none is under ``below`` cells wide.

    tries: orders that are tried without success before the search ends; it goes on with every success.
    budget: of cells that are transformed.
    """
    least = max((s.least for s in sketches), default=1)
    least = max(least, int(np.sqrt(sum(s.area for s in sketches) / FULLEST)))
    side = below - 1
    if side < least:
        return None
    board = _board(sketches, side)
    rng = np.random.default_rng(SEED)
    found: SketchedPage | None = None
    failures = tried = 0
    while failures < tries and side >= least and not budget.over:
        order, sigma, choice = _try(rng, tried, sketches)
        tried += 1
        failures += 1
        stride = 1
        while side >= least and not budget.over:
            page = _laid_out(board, order, side, sigma, choice, budget)
            if page is not None:
                found, failures, stride = page, 0, 2 * stride
                side = max(side - stride, least) if side > least else least - 1
            elif found is not None and stride > 1:
                side, stride = found.side - 1, 1
            else:
                break
    return found


def _try(
    rng: np.random.Generator, tried: int, sketches: Sequence[Sketch]
) -> tuple[IntArray, float, list[IntArray]]:
    """(order, blur, masks of each sketch) of one try: by size and by reach at first, then perturbed."""
    size = np.log([s.area if tried % 2 == 0 else float(s.least) ** 2 for s in sketches])
    choice = [np.arange(len(s.masks.angle)) for s in sketches]
    if tried >= FIRST_TRIES:
        size = size + rng.normal(0, SHUFFLED, len(size))
        half = [c[rng.random(len(c)) < 0.5] for c in choice]
        choice = [h if len(h) else c for h, c in zip(half, choice, strict=True)]
    order = np.argsort(-size, kind="stable")
    if tried < FIRST_TRIES:
        for k in order[LARGEST:].tolist():
            choice[k] = choice[k][:: 2 if len(choice[k]) > LEAST_ANGLES else 1]
    return order, SIGMAS[tried % len(SIGMAS)], choice


def _laid_out(
    board: _Board,
    order: IntArray,
    side: int,
    sigma: float,
    choice: list[IntArray],
    budget: Budget,
) -> SketchedPage | None:
    """Sketches put one by one where they touch most, on a page of ``side`` cells; None where one finds no place
    that is free."""
    size = board.side
    at = np.zeros((3, len(order)), np.int64)
    grid = np.ones((size, size), np.float32)
    grid[:side, :side] = 0
    blur = blur_transfer(size, sigma)
    for turn, c in enumerate(order.tolist()):
        masks = board.sketches[c].masks
        pick = choice[c][masks.size[choice[c]].max(1) <= side]
        if len(pick) == 0:
            return None
        budget.spend(len(pick) * float(size) ** 2)
        page = sf.rfft2(grid)
        spot: tuple[int, int, int] | None
        if turn == 0:
            spot = _corner(sf.irfft2(page * blur, s=(size, size)), masks, pick, side)
        else:
            spot = _touching(page, blur, board.spectra[c], masks, pick, side)
        if spot is None:
            return None
        k, y, x = spot
        at[:, c] = spot
        h, w = masks.size[k]
        grid[y : y + h, x : x + w][masks.cells[k, :h, :w]] = 1
    return SketchedPage(side, *at)


def _corner(blurred: FloatArray, masks: Masks, pick: IntArray, side: int) -> tuple[int, int, int]:
    """The mask that touches most in a corner of an empty page, and its row and column there."""
    best, spot = -1.0, (int(pick[0]), 0, 0)
    for k in pick.tolist():
        h, w = masks.size[k].tolist()
        cells = masks.cells[k, :h, :w]
        for y, x in ((0, 0), (0, side - w), (side - h, 0), (side - h, side - w)):
            score = float(blurred[y : y + h, x : x + w][cells].sum()) / float(masks.area[k])
            if score > best:
                best, spot = score, (k, y, x)
    return spot


def _touching(
    page: Spectrum, blur: FloatArray, spectra: Spectrum, masks: Masks, pick: IntArray, side: int
) -> tuple[int, int, int] | None:
    """The free place where most of a mask lies near others or the border; None where nothing is free."""
    size = len(page)
    kernel = spectra[pick]
    hit = sf.irfft2(kernel * page, s=(size, size))[:, :side, :side]
    free: BoolArray = hit < 0.5
    # what begins too far right or down would come round the grid
    at = np.arange(side)
    free &= (at[None] <= side - masks.size[pick, 0][:, None])[:, :, None]
    free &= (at[None] <= side - masks.size[pick, 1][:, None])[:, None, :]
    some = np.flatnonzero(free.any((1, 2)))
    if len(some) == 0:
        return None
    score = sf.irfft2(kernel[some] * (page * blur), s=(size, size))[:, :side, :side]
    score = np.where(free[some], score / masks.area[pick[some]][:, None, None], -1)
    k, rest = divmod(int(score.argmax()), side * side)
    return int(pick[some[k]]), rest // side, rest % side
