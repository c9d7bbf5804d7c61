"""The search on the grid: nothing overlaps, each layout beats the one before, and sketches need the same."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.budget import Budget
from circparam.packing.nest.masks import chart_masks
from circparam.packing.nest.places import spectra_of
from circparam.packing.nest.search import (
    Board,
    GridLayout,
    lay_out,
    search,
)
from circparam.packing.nest.sketch import Sketch, SketchGrid, least_page
from tests.support.packing import blobs, edges_of

GRID = SketchGrid(0.1, 0.0)


def endless() -> Budget:
    return Budget(1e12, lambda: False)


def box(width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Edges of a rectangle."""
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]], float) + 0.25
    return corner, np.roll(corner, -1, axis=0)


def boxes(*sizes: tuple[float, float], angles: tuple[float, ...] = (0.0,), side: int = 60) -> Board:
    """Rectangles of cells, less than their cells so that they touch no others."""
    masks = [chart_masks(*box(w - 0.5, h - 0.5), np.array(angles), 0.0) for w, h in sizes]
    return Board(masks, [spectra_of(m, side) for m in masks], side)


def stars(n: int, seed: int, side: int = 64) -> Board:
    faces, uv, chart = blobs(n, seed, 0.4)
    angles = np.arange(8) * np.pi / 4
    masks = [
        chart_masks(*(4 * e for e in edges_of(faces[chart == c], uv)), angles, 0.5)
        for c in range(n)
    ]
    return Board(masks, [spectra_of(m, side) for m in masks], side)


def sound(board: Board, found: GridLayout, pages: int = 1) -> None:
    """Every chart lies on its page, and no cell has two."""
    grid = np.zeros((pages, found.side, found.side), int)
    for c, masks in enumerate(board.masks):
        k, y, x = found.mask[c], found.row[c], found.column[c]
        h, w = masks.size[k]
        assert 0 <= y <= found.side - h
        assert 0 <= x <= found.side - w
        grid[found.page[c], y : y + h, x : x + w] += masks.cells[k, :h, :w]
    assert grid.max() == 1


@pytest.mark.parametrize("pages", [1, 2])
def test_layouts_do_not_overlap_and_pages_get_smaller(pages: int) -> None:
    board = stars(8, 4)
    budgets = [Budget(3e6, lambda: False) for _ in range(2)]
    found, again = (search(board, board.side, pages, budget) for budget in budgets)
    assert len(found) >= 2
    assert (np.diff([f.side for f in found]) > 0).all()  # best first
    for f, same in zip(found, again, strict=True):
        sound(board, f, pages)
        np.testing.assert_array_equal([f.mask, f.row, f.column], [same.mask, same.row, same.column])


def test_squares_of_whole_cells_fill_a_page_to_the_last_cell() -> None:
    """Four masks of k cells a side fit a page of 2k cells and none of 2k - 1."""
    board = boxes(*[(8, 8)] * 4)
    k = int(board.masks[0].size.max())
    order, choice = np.arange(4), [np.arange(1)] * 4
    full = lay_out(board, order, 2 * k, 2.0, 1, choice, endless())
    assert full is not None
    sound(board, full)
    assert lay_out(board, order, 2 * k - 1, 2.0, 1, choice, endless()) is None
    apart = lay_out(board, order, 2 * k - 1, 2.0, 4, choice, endless())
    assert apart is not None
    assert sorted(apart.page) == [0, 1, 2, 3]
    assert lay_out(board, order, k - 1, 2.0, 9, choice, endless()) is None
    cost = board.side**2
    for budget, fits in ((4 * cost + 1, True), (4 * cost, False)):
        found = lay_out(board, order, 2 * k, 2.0, 1, choice, Budget(budget, lambda: False))
        assert (found is not None) == fits


def sketches(*sizes: tuple[float, float]) -> list[Sketch]:
    return [GRID.sketch(*box(w, h)) for w, h in sizes]


def side_of(some: list[Sketch], below: int = 60, budget: Budget | None = None) -> int | None:
    """Side of the page that is found for some sketches, which is sound."""
    page = least_page(some, below, 4, budget or endless())
    if page is None:
        return None
    sound(Board([s.masks for s in some], [], page.side), page)
    return page.side


@pytest.mark.parametrize(("count", "across"), [(1, 1), (4, 2), (9, 3)])
def test_squares_lie_side_by_side(count: int, across: int) -> None:
    some = sketches(*[(0.8, 0.8)] * count)
    side = side_of(some)
    assert side is not None
    assert 8 * across <= side <= across * some[0].least


def test_two_squares_need_a_page_as_wide_as_both() -> None:
    """Whatever their angles (Erdos' squares: two in a unit square have sides of 1 together)."""
    some = sketches((1.6, 1.6), (1.6, 1.6))
    side = side_of(some)
    assert side is not None
    assert 2 * 16 <= side < 2 * some[0].least


def test_small_ones_lie_in_the_room_beside_large_ones() -> None:
    """Two strips of 24 by 8 cells leave a third of their square: smaller ones need no larger page."""
    strips = sketches((2.4, 0.8), (2.4, 0.8))
    assert side_of([*strips, *sketches((0.5, 0.5), (0.5, 0.5))]) == side_of(strips)


def test_pages_are_looked_for_below_a_side_and_within_a_budget() -> None:
    some = sketches(*[(0.8, 0.8)] * 4)
    side = side_of(some)
    assert side is not None
    assert side_of(some, side) is None
    assert side_of(some, side + 1) == side
    assert side_of(some, 60, Budget(1e12, lambda: True)) is None
    budget = Budget(3e5, lambda: False)
    assert side_of(some, 60, budget) is not None
    assert -1e6 < budget.left <= 0
