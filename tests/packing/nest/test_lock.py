"""Sketched pages grown until their outlines lock."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.arrays import FloatArray
from circparam.packing.budget import Budget
from circparam.packing.nest.lock import locked
from circparam.packing.nest.sketch import Sketch, SketchGrid, least_page
from circparam.packing.options import PackOptions
from circparam.packing.placement import Placement

CELL = 0.1
PAGE = PackOptions(resolution=512, padding=1)


def rectangle(
    width: float, height: float, low: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Edges of a rectangle, sixteen to a side."""
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]], float) + low
    t = np.arange(16)[None, :, None] / 16
    start = (corner[:, None] + t * (np.roll(corner, -1, axis=0) - corner)[:, None]).reshape(-1, 2)
    return start, np.roll(start, -1, axis=0)


def page_of(edges: list[tuple[FloatArray, FloatArray]]) -> tuple[list[Sketch], int, Placement]:
    """The sketches, the side of their page in cells, and where the outlines lock."""
    grid = SketchGrid(CELL, 0.1)
    some = [grid.sketch(*e) for e in edges]
    page = least_page(some, 80, 4, Budget(1e12, lambda: False))
    assert page is not None
    return some, page.side, locked(some, page, CELL, PAGE, lambda: False)


def corners(edges: list[tuple[FloatArray, FloatArray]], placed: Placement) -> list[FloatArray]:
    """The outlines on the page: what their own uv come to."""
    out = []
    for (start, _), t, at in zip(edges, placed.angle, placed.offset, strict=True):
        turn = np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])
        out.append(start @ turn * placed.scale + at)
    return out


@pytest.mark.parametrize("low", [(0.0, 0.0), (5.0, -3.0)])
def test_squares_lock_where_they_fill_the_page(low: tuple[float, float]) -> None:
    """Four equal squares, wherever their uv lie: cells waste a tenth of the side, outlines half of that."""
    edges = [rectangle(0.83, 0.83, low)] * 4
    _, side, placed = page_of(edges)
    inner = PAGE.resolution - 2 * PAGE.border
    assert placed.scale * CELL > 1.05 * inner / side
    assert 0.85 * inner < 2 * 0.83 * placed.scale < inner - PAGE.gap + 1


def test_outlines_lie_on_the_page_and_apart() -> None:
    """With the offsets of the origin of their uv, whatever these are."""
    sizes = [(1.6, 0.7), (0.9, 0.9), (0.4, 1.3), (0.5, 0.5)]
    edges = [rectangle(*s, (float(k), 2.0 * k)) for k, s in enumerate(sizes)]
    *_, placed = page_of(edges)
    world = corners(edges, placed)
    border = PAGE.border - 0.5
    for k, p in enumerate(world):
        assert p.min() >= border
        assert p.max() <= PAGE.resolution - border
        for q in world[:k]:
            d = np.sqrt(((p[:, None] - q[None]) ** 2).sum(2)).min()
            assert d >= 0.8 * PAGE.gap


def test_it_ends_where_there_is_no_time() -> None:
    some = [SketchGrid(CELL, 0.1).sketch(*rectangle(1.0, 1.0, (0.0, 0.0)))] * 2
    page = least_page(some, 80, 4, Budget(1e12, lambda: False))
    assert page is not None
    grown = locked(some, page, CELL, PAGE, lambda: False)
    late = locked(some, page, CELL, PAGE, lambda: True)
    assert late.scale <= grown.scale
