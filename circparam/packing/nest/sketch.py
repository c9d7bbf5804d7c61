"""Sketches of pages: the page that some outlines need, found in milliseconds on a coarse grid.

For whoever weighs many changes of the charts against each other: sketches rank them. Packing continues from
such a layout and covers a tenth more.
"""

from collections.abc import Sequence
from dataclasses import field
from functools import lru_cache

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.packing.budget import Budget
from circparam.packing.nest.masks import Masks, chart_masks
from circparam.packing.nest.places import GridPages, Single, Spectrum, blur_transfer, sf, spectra_of
from circparam.packing.nest.search import SIGMAS
from circparam.packing.placement import Placement

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
EVEN = 1e-5  # of its cells: error of contacts between masks in corners
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


@dataclass(eq=False)
class _Step:
    """A chart on a page, after those before it. place: mask, row and column; None if no place is free.

    sketch: kept, so that no other one gets its number. after: next steps, by sketch and masks to choose from.
    """

    sketch: Sketch | None = None
    place: tuple[int, int, int] | None = None
    after: "dict[tuple[int, bytes], _Step]" = field(default_factory=dict)


class SketchCache:
    """Cache for pages of the same charts: pages with the same beginning share their steps.

    sketches: by the outlines that they show: several chords may lead to the same cut. locked: layouts grown
    until they lock, by ``page_key``. Nothing but time depends on it; in another process it is empty.
    """

    def __init__(self, kept: Sequence[Sketch] = ()) -> None:
        self._kept = {id(s): s for s in kept}
        self._spectra: dict[tuple[int, int], Spectrum] = {}
        self._pages: dict[tuple[int, int, float], _Step] = {}
        self.sketches: dict[tuple[bytes, bytes], Sketch] = {}
        self.locked: dict[tuple[bytes, ...], Placement] = {}

    def __reduce__(self) -> "tuple[type[SketchCache], tuple[()]]":
        return SketchCache, ()

    def keep(self, sketches: Sequence[Sketch]) -> None:
        """Keep the spectra of sketches that take part in many pages."""
        self._kept.update((id(s), s) for s in sketches)

    def first(self, size: int, side: int, sigma: float) -> _Step:
        """The empty page of ``side`` cells."""
        return self._pages.setdefault((size, side, sigma), _Step())

    def page_key(self, sketches: Sequence[Sketch], page: SketchedPage) -> tuple[bytes, ...]:
        """Key of a page of sketches that stay."""
        numbers = np.array([id(s) for s in sketches])
        return tuple(
            a.tobytes() for a in (numbers, page.mask, page.row, page.column, np.array(page.side))
        )

    def spectrum(self, sketch: Sketch, size: int) -> Spectrum:
        """(k, size, size // 2 + 1) that of its masks on a grid of ``size`` cells a side."""
        key = id(sketch), size
        if key in self._spectra:
            return self._spectra[key]
        spectrum = spectra_of(sketch.masks, size)
        if key[0] in self._kept:
            self._spectra[key] = spectrum
        return spectrum


@dataclass(frozen=True, eq=False)
class SketchGrid:
    """The grid of all sketches. cell: its side in uv units. grow: cells that outlines are grown by. cache: of
    the pages that were sketched."""

    cell: float
    grow: float
    cache: SketchCache = field(default_factory=SketchCache)

    def sketch(self, start: FloatArray, end: FloatArray) -> Sketch:
        """An outline of edges from start to end (e, 2) in uv units."""
        key = start.tobytes(), end.tobytes()
        if key not in self.cache.sketches:
            self.cache.sketches[key] = self._drawn(start, end)
        return self.cache.sketches[key]

    def _drawn(self, start: FloatArray, end: FloatArray) -> Sketch:
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
    """Sketches on a grid of ``side`` squared cells, with the cache of all pages; spectra: those in use."""

    sketches: Sequence[Sketch]
    cache: SketchCache
    side: int
    spectra: dict[int, Spectrum] = field(default_factory=dict)

    def spectrum(self, c: int) -> Spectrum:
        """Spectra of the masks of sketch c."""
        if c not in self.spectra:
            self.spectra[c] = self.cache.spectrum(self.sketches[c], self.side)
        return self.spectra[c]


def least_page(
    sketches: Sequence[Sketch],
    below: int,
    tries: int,
    budget: Budget,
    cache: SketchCache | None = None,
) -> SketchedPage | None:
    """The smallest page found that holds all sketches; None if none is under ``below`` cells wide.

    tries: orders without success after which the search ends; every success restarts the count. budget: of
    cells that are transformed. cache: of other pages.
    """
    least = max((s.least for s in sketches), default=1)
    least = max(least, int(np.sqrt(sum(s.area for s in sketches) / FULLEST)))
    side = below - 1
    if side < least:
        return None
    board = _Board(sketches, cache or SketchCache(), int(sf.good_size(side, True)))
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
    """Sketches placed one by one at the place of most contact, on a page of ``side`` cells; None if one finds
    no free place."""
    size = board.side
    at = np.zeros((3, len(order)), np.int64)
    grid = GridPages.empty(1, size, side, sigma)
    step = board.cache.first(size, side, sigma)
    for turn, c in enumerate(order.tolist()):
        sketch, pick = board.sketches[c], choice[c]
        masks = sketch.masks
        if masks.longest > side:
            pick = pick[masks.size[pick].max(1) <= side]
        if len(pick) == 0:
            return None
        budget.spend(len(pick) * float(size) ** 2)
        key = id(sketch), pick.tobytes()
        if key not in step.after:
            place: tuple[int, int, int, int] | None
            if turn == 0:
                place = *_corner(_empty(size, side, sigma), masks, pick, side), 0
            else:
                place = grid.find(masks, board.spectrum(c)[pick], pick, masks.area[pick])
            step.after[key] = _Step(sketch, place and place[:3])
        step = step.after[key]
        if step.place is None:
            return None
        at[:, c] = step.place
        grid.fill(masks, *step.place)
    return SketchedPage(side, *at)


@lru_cache(maxsize=128)
def _empty(size: int, side: int, sigma: float) -> tuple[FloatArray, FloatArray]:
    """An empty page of ``side`` cells, blurred; and (side,) how empty it is then along one axis."""
    page = np.ones((size, size), np.float32)
    page[:side, :side] = 0
    blur = blur_transfer(size, sigma)
    along = sf.irfft(sf.rfft(1.0 - page[0]) * blur[0], n=size)[:side]
    return sf.irfft2(sf.rfft2(page) * blur, s=(size, size)), along


def _corner(
    empty: tuple[FloatArray, FloatArray], masks: Masks, pick: IntArray, side: int
) -> tuple[int, int, int]:
    """The mask that touches most in a corner of an empty page, and its row and column there.

    A blurred empty page is the product of two equal, symmetric profiles along its axes. Profiles therefore rank
    the contacts, except quarter turns, which differ in the last bits.
    """
    blurred, along = empty
    size = masks.size[pick]
    high, wide = size.max(0).tolist()
    cells = masks.cells[pick, :high, :wide].astype(np.float32)
    down, right = (_from_ends(along, n) for n in size.T)
    inside = ((down @ cells)[:, :, None] * right[:, None]).sum(-1).reshape(-1, 4)
    # where a chart is grown, a cell may lie beyond the size of its mask
    own = masks.within[pick]
    contact = (own[:, None] - inside) / masks.area[pick, None]
    best, place = -1.0, (int(pick[0]), 0, 0)
    for n, corner in np.argwhere(contact >= contact.max() - EVEN).tolist():
        k, (h, w) = int(pick[n]), size[n].tolist()
        y, x = (side - h) * (corner // 2), (side - w) * (corner % 2)
        touched = blurred[y : y + h, x : x + w][masks.cells[k, :h, :w]]
        score = float(touched.sum()) / float(masks.area[k])
        if score > best:
            best, place = score, (k, y, x)
    return place


def _from_ends(along: FloatArray, count: IntArray) -> Single:
    """(k, 2, most) the first ``count`` (k,) numbers, forwards and backwards; 0 beyond."""
    n = np.arange(count.max())
    back = count[:, None] - 1 - n
    inside = back >= 0
    ends = np.empty((len(count), 2, len(n)), np.float32)
    ends[:, 0] = along[n] * inside
    ends[:, 1] = along[back] * inside
    return ends
