"""The search on the grid: nothing overlaps, each layout beats the one before; masks cover what charts cover."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.budget import Budget
from circparam.packing.nest.masks import chart_masks
from circparam.packing.nest.places import spectra_of
from circparam.packing.nest.search import Board, GridLayout, search
from tests.support.packing import blobs, boxes, edges_of


def board_of(charts: tuple[np.ndarray, ...], reach: float = 0.0) -> Board:
    """Charts in units of cells, at eight angles, on a grid of 64 cells."""
    faces, uv, chart = charts
    angles = np.arange(8) * np.pi / 4
    own = [edges_of(faces[chart == c], uv) for c in range(chart.max() + 1)]
    masks = [chart_masks(*edges, angles, reach) for edges in own]
    return Board(masks, [spectra_of(m, 64) for m in masks], 64)


def rectangles(*sizes: tuple[float, float]) -> Board:
    """Rectangles of widths and heights in cells, their corners in the middle of cells."""
    faces, uv, chart = boxes(sizes)
    return board_of((faces, uv + 0.5, chart))


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
    faces, uv, chart = blobs(8, 4, 0.4)
    board = board_of((faces, 4 * uv, chart), 0.5)
    budgets = [Budget(3e6, lambda: False) for _ in range(2)]
    found, again = (search(board, board.side, pages, budget) for budget in budgets)
    assert len(found) >= 2
    assert (np.diff([f.side for f in found]) > 0).all()  # best first
    for f, same in zip(found, again, strict=True):
        sound(board, f, pages)
        np.testing.assert_array_equal([f.mask, f.row, f.column], [same.mask, same.row, same.column])


def side_of(board: Board) -> int:
    """Side of the page that is found, which is sound."""
    found = search(board, 60, 1, Budget(3e6, lambda: False))[0]
    sound(board, found)
    return found.side


@pytest.mark.parametrize(("count", "side", "across"), [(1, 8, 1), (2, 16, 2), (4, 8, 2), (9, 8, 3)])
def test_squares_lie_side_by_side(count: int, side: int, across: int) -> None:
    """Whatever their angles (Erdos' squares: two in a unit square have sides of 1 together)."""
    board = rectangles(*[(side, side)] * count)
    alone = int(board.masks[0].size.max(1).min())
    assert side * across <= side_of(board) <= across * alone


def test_small_ones_lie_in_the_room_beside_large_ones() -> None:
    """Two strips of 24 by 8 cells leave a third of their square: smaller ones need no larger page."""
    strips = (24.0, 8.0), (24.0, 8.0)
    assert side_of(rectangles(*strips, (5, 5), (5, 5))) == side_of(rectangles(*strips))


def test_holes_stay_free_and_overlapping_layers_are_full():
    outer = np.array([[-8.0, -8], [8, -8], [8, 8], [-8, 8]])
    hole = outer[::-1] / 2
    start = np.concatenate([outer, hole])
    end = np.concatenate([np.roll(outer, -1, 0), np.roll(hole, -1, 0)])
    found = chart_masks(start, end, np.zeros(1), 0.0)
    middle = np.array(found.cells.shape[1:]) // 2
    assert not found.cells[0][middle[0], middle[1]]
    same_way = np.concatenate([outer, outer / 2])
    ends = np.concatenate([np.roll(outer, -1, 0), np.roll(outer / 2, -1, 0)])
    assert chart_masks(same_way, ends, np.zeros(1), 0.0).cells[0][2:-2, 2:-2].all()


@pytest.mark.parametrize("turn", [0, 1])
def test_a_sliver_is_covered_all_along(turn):
    """40 cells long, nowhere near a cell wide: it covers no centre, but touches every column."""
    sliver = np.array([[0.0, 0.1], [40.0, 0.2], [40.0, 0.4]])[:, :: 1 - 2 * turn]
    found = chart_masks(sliver, np.roll(sliver, -1, 0), np.zeros(1), 0.0)
    y, x = np.nonzero(found.cells[0])
    along = (y if turn else x) + int(found.low[0, turn])
    assert set(range(40)) <= set(along.tolist())
