"""Sketches of pages: the page that some outlines need, found in milliseconds on a coarse grid.

For whoever weighs many changes of the charts against each other: sketches rank them. Packing continues from
other layouts and covers a tenth more.
"""

from functools import lru_cache, partial

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.packing.budget import Budget
from circparam.packing.nest.masks import Masks, chart_masks
from circparam.packing.nest.places import sf, spectra_of
from circparam.packing.nest.search import Board, GridLayout, search, tried_angles
from circparam.packing.outlines import extents


class Sketch:
    """One outline as masks at several angles. Their spectra are kept for the grid that was used last."""

    def __init__(self, masks: Masks) -> None:
        self.masks = masks
        self.least = int(masks.size.max(1).min())  # side of the smallest page for it alone
        self.spectra = lru_cache(maxsize=1)(partial(spectra_of, masks))


class SketchGrid:
    """The grid of all sketches. cell: its side in uv units. grow: cells that outlines are grown by."""

    def __init__(self, cell: float, grow: float) -> None:
        self.cell, self.grow = cell, grow
        self._drawn = lru_cache(maxsize=64)(self._draw)  # pages share most of their charts

    def sketch(self, start: FloatArray, end: FloatArray) -> Sketch:
        """An outline of edges from start to end (e, 2) in uv units."""
        return self._drawn(start.tobytes(), end.tobytes())

    def _draw(self, start: bytes, end: bytes) -> Sketch:
        a, b = (np.frombuffer(p).reshape(-1, 2) / self.cell for p in (start, end))
        turns = np.linspace(0, np.pi / 2, 24, endpoint=False)
        size = extents(a, turns)
        box, square = turns[size.prod(1).argmin()], turns[size.max(1).argmin()]
        middle = (a.min(0) + a.max(0)) / 2
        return Sketch(chart_masks(a - middle, b - middle, tried_angles(box, square), self.grow))


def least_page(sketches: list[Sketch], below: int, tries: int, budget: Budget) -> GridLayout | None:
    """The smallest page found that holds all sketches; None if none is under ``below`` cells wide.

    tries: orders on end without success after which the search ends. budget: of cells that are transformed.
    """
    size = int(sf.good_size(below, True))
    board = Board([s.masks for s in sketches], [s.spectra(size) for s in sketches], size)
    found = search(board, below - 1, 1, budget, patience=tries)
    return found[0] if found else None
