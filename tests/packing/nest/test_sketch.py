"""Sketches of pages: how large a page some outlines need."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from circparam.core.arrays import FloatArray
from circparam.packing.budget import Budget
from circparam.packing.nest.sketch import (
    FULLEST,
    Sketch,
    SketchCache,
    SketchGrid,
    least_page,
)

GRID = SketchGrid(0.1, 0.0)


def box(width: float, height: float) -> tuple[FloatArray, FloatArray]:
    """Edges of a rectangle, four to a side."""
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    ahead = np.roll(corner, -1, axis=0)
    t = np.arange(4) / 4
    start = (corner[:, None] + t[None, :, None] * (ahead - corner)[:, None]).reshape(-1, 2)
    return start, np.roll(start, -1, axis=0)


def sketches(*sizes: tuple[float, float]) -> list[Sketch]:
    return [GRID.sketch(*box(w, h)) for w, h in sizes]


def never() -> bool:
    return False


def least_side(some: list[Sketch], below: int, tries: int, stop: Callable[[], bool]) -> int | None:
    """Side of the page that is found; every cell of it has one sketch at most, and none lies outside."""
    page = least_page(some, below, tries, Budget(1e12, stop))
    if page is None:
        return None
    taken = np.zeros((page.side, page.side), int)
    for sketch, k, y, x in zip(some, page.mask, page.row, page.column, strict=True):
        h, w = sketch.masks.size[k]
        assert y + h <= page.side
        assert x + w <= page.side
        taken[y : y + h, x : x + w] += sketch.masks.cells[k, :h, :w]
    assert taken.max() == 1
    return page.side


def test_a_sketch_knows_its_cells() -> None:
    """A rectangle of 8 by 4 cells: at least these, at most those that its outline touches."""
    (one,) = sketches((0.8, 0.4))
    assert one.masks.area.min() >= 32
    assert one.area <= (8 + 2 * np.sqrt(2)) * (4 + 2 * np.sqrt(2)) + 1
    assert 8 * np.sqrt(0.5) < one.least <= 10


def test_grown_outlines_have_more_cells() -> None:
    grown = SketchGrid(0.1, 1.5).sketch(*box(0.8, 0.4))
    (plain,) = sketches((0.8, 0.4))
    assert (grown.masks.size >= plain.masks.size + 2).all()


@pytest.mark.parametrize(("count", "across"), [(1, 1), (4, 2), (9, 3)])
def test_squares_lie_side_by_side(count: int, across: int) -> None:
    """The page holds them in rows and columns, and none is smaller than their cells."""
    some = sketches(*[(0.8, 0.8)] * count)
    side = least_side(some, 60, 6, never)
    assert side is not None
    assert np.sqrt(sum(float(s.masks.area.min()) for s in some)) <= side
    tried = int(np.sqrt(sum(s.area for s in some) / FULLEST))  # smaller pages are not
    assert side <= max(across * some[0].least, tried + 1)


def test_two_squares_need_a_page_as_wide_as_both() -> None:
    """Whatever their angles (Erdos' squares: two in a unit square have sides of 1 together), though their cells
    would fill but half of it."""
    some = sketches((1.6, 1.6), (1.6, 1.6))
    side = least_side(some, 60, 6, never)
    assert side is not None
    assert 2 * 16 <= side < 2 * some[0].least


def test_small_ones_lie_in_the_room_beside_large_ones() -> None:
    """Two strips of 24 by 8 cells leave a third of their square: smaller ones need no larger page."""
    strips = sketches((2.4, 0.8), (2.4, 0.8))
    more = [*strips, *sketches((0.5, 0.5), (0.5, 0.5))]
    assert least_side(more, 60, 6, never) == least_side(strips, 60, 6, never)


def test_it_looks_below_the_side_asked_for_alone() -> None:
    some = sketches(*[(0.8, 0.8)] * 4)
    side = least_side(some, 60, 6, never)
    assert side is not None
    assert least_side(some, side, 6, never) is None
    assert least_side(some, side + 1, 6, never) == side


def test_it_ends_where_there_is_no_time() -> None:
    assert least_side(sketches((0.8, 0.8)), 60, 6, lambda: True) is None


def test_the_same_outlines_need_the_same_page() -> None:
    some = sketches((1.6, 0.4), (0.8, 0.8), (0.3, 1.2), (0.5, 0.4))
    assert least_side(some, 60, 6, never) == least_side(some, 60, 6, never)


def test_a_search_ends_when_its_work_is_done() -> None:
    """Tries end where the budget does, which is not overdrawn by much; those before count."""
    some = sketches((2.0, 0.7), (1.5, 1.1), (1.3, 0.9), (1.0, 0.4), (0.8, 0.8))
    short, long = Budget(1e6, never), Budget(1e12, never)
    page, better = least_page(some, 80, 10_000, short), least_page(some, 80, 30, long)
    assert page is not None
    assert better is not None
    assert better.side <= page.side
    assert -1e6 < short.left <= 0
    assert least_page(some, 80, 4, Budget(0.0, never)) is None


def blob(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Edges of a star."""
    t = np.arange(30) * np.pi / 15
    r = rng.uniform(0.3, 1.2) * (1 + 0.4 * np.sin(rng.integers(1, 5) * t + rng.uniform(0, 6)))
    start = np.stack([r * np.cos(t), rng.uniform(0.4, 1) * r * np.sin(t)], 1)
    return start, np.roll(start, -1, axis=0)


def test_what_is_known_of_other_pages_changes_nothing() -> None:
    """Pages that share most of their charts: the same as by themselves, for the same work."""
    rng = np.random.default_rng(4)
    stay = [GRID.sketch(*blob(rng)) for _ in range(5)]
    known = SketchCache()
    known.keep(stay)
    for k in range(12):
        some = [*stay, *(GRID.sketch(*blob(rng)) for _ in range(k % 3))]
        shared, alone = Budget(1e12, never), Budget(1e12, never)
        a, b = least_page(some, 60 + k, 8, shared, known), least_page(some, 60 + k, 8, alone)
        assert a is not None
        assert b is not None
        assert a.side == b.side
        assert np.array_equal([a.mask, a.row, a.column], [b.mask, b.row, b.column])
        assert shared.left == alone.left
