"""The search on the grid: nothing overlaps, each layout beats the one before, and sketches need the same."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.budget import Budget
from circparam.packing.nest.masks import chart_masks
from circparam.packing.nest.places import spectra_of
from circparam.packing.nest.search import Board, GridLayout, search
from circparam.packing.nest.sketch import Sketch, SketchGrid, least_page
from tests.support.packing import blobs, edges_of

GRID = SketchGrid(0.1, 0.0)


def box(width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Edges of a rectangle."""
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]], float) + 0.25
    return corner, np.roll(corner, -1, axis=0)


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


def sketches(*sizes: tuple[float, float]) -> list[Sketch]:
    return [GRID.sketch(*box(w, h)) for w, h in sizes]


def side_of(some: list[Sketch], below: int = 60, budget: Budget | None = None) -> int | None:
    """Side of the page that is found for some sketches, which is sound."""
    page = least_page(some, below, 4, budget or Budget(1e12, lambda: False))
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
