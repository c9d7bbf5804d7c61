"""The search on the grid: nothing overlaps, each layout beats the one before, and grids become texels."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.budget import Budget
from circparam.packing.nest.search import (
    cell_size,
    chart_angles,
    first_layout,
    lay_out,
    make_board,
    search,
    to_placement,
)
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import finish
from tests.support.packing import blobs, rectangles


def board_of(shapes, options, cells=48, density=0.6, most=16):
    cell = cell_size(shapes, options, cells, density)
    return make_board(shapes, options, chart_angles(shapes, options, cell, most), cells, density)


def grid_of(board, found, pages):
    """How many charts are on each cell: (pages, side, side)."""
    grid = np.zeros((pages, found.side, found.side), int)
    for c, masks in enumerate(board.masks):
        k, y, x = found.mask[c], found.row[c], found.column[c]
        h, w = masks.size[k]
        assert min(y, x) >= 0
        assert y + h <= found.side
        assert x + w <= found.side
        grid[found.page[c], y : y + h, x : x + w] += masks.cells[k, :h, :w]
    return grid


def endless():
    return Budget(1e12, lambda: False)


@pytest.mark.parametrize("pages", [1, 2])
def test_layouts_do_not_overlap_and_become_sound_placements(pages):
    shapes = shapes_of(*blobs(8, 4, 0.4))
    options = PackOptions(resolution=512, padding=3, pages=pages)
    board = board_of(shapes, options)
    found = search(board, shapes, options, Budget(2e6, lambda: False))
    assert len(found) >= 2
    assert (np.diff([f.side for f in found]) > 0).all()  # best first
    for f in found[:3]:
        assert grid_of(board, f, pages).max() == 1
    placement = to_placement(board, found[0], options)
    assert finish(shapes, placement, options)[1] is None
    # a page of fewer cells is a larger scale
    assert to_placement(board, found[-1], options).scale < placement.scale


def test_the_same_search_finds_the_same():
    shapes = shapes_of(*blobs(6, 1, 0.4))
    options = PackOptions(resolution=256)
    board = board_of(shapes, options)
    runs = [search(board, shapes, options, Budget(2e6, lambda: False)) for _ in range(2)]
    for a, b in zip(*runs, strict=True):
        assert a.side == b.side
        for name in ("mask", "row", "column", "page"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_squares_of_whole_cells_fill_a_page_to_the_last_cell():
    """Four masks of k cells a side fit a page of 2k cells and none of 2k - 1."""
    shapes = rectangles(np.ones((4, 2)))
    options = PackOptions(resolution=512, padding=1, rotate="none")
    board = board_of(shapes, options)
    k = int(board.masks[0].size.max())
    order, choice = np.arange(4), [np.arange(1)] * 4
    full = lay_out(board, order, 2 * k, 2.0, 1, choice, endless())
    assert full is not None
    assert grid_of(board, full, 1).max() == 1
    assert sorted(zip(full.row, full.column, strict=True)) == [(0, 0), (0, k), (k, 0), (k, k)]
    assert lay_out(board, order, 2 * k - 1, 2.0, 1, choice, endless()) is None
    two = lay_out(board, order, 2 * k - 1, 2.0, 4, choice, endless())
    assert sorted(two.page) == [0, 1, 2, 3]
    assert lay_out(board, order, k - 1, 2.0, 9, choice, endless()) is None
    cost = board.side**2
    assert lay_out(board, order, 2 * k, 2.0, 1, choice, Budget(4 * cost + 1, lambda: False))
    assert lay_out(board, order, 2 * k, 2.0, 1, choice, Budget(4 * cost, lambda: False)) is None


def test_the_fewest_pages_come_first():
    shapes = rectangles(np.ones((8, 2)))
    options = PackOptions(resolution=512, padding=1, rotate="none", pages=4)
    board = board_of(shapes, options, density=0.12)
    k = int(board.masks[0].size.max())
    for side, pages in ((3 * k, 1), (2 * k, 2), (2 * k - 1, None)):
        found = first_layout(board, shapes, options, side, endless())
        assert (None if found is None else len(set(found.page))) == pages
    assert first_layout(board, shapes, options, 3 * k, Budget(0.0, lambda: False)) is None


def test_cells_and_angles():
    shapes = rectangles([[4.0, 1.0], [1.0, 1.0], [0.1, 0.1]])
    options = PackOptions(resolution=256, pages=2)
    cell = cell_size(shapes, options, 64, 0.5)
    assert shapes.area.sum() == pytest.approx(0.5 * 2 * (64 * cell) ** 2)
    counts = [len(a) for a in chart_angles(shapes, options, cell, 64)]
    assert counts[0] > counts[1] >= counts[2] == 8  # more for what reaches further
    assert max(counts) <= 64 + 4
    assert all(n % 4 == 0 for n in counts)
    for rotate, n in (("90", 4), ("none", 1)):
        plain = PackOptions(resolution=256, rotate=rotate)
        for angles in chart_angles(shapes, plain, cell, 64):
            np.testing.assert_allclose(angles, np.arange(n) * np.pi / 2)


def test_a_placement_uses_the_page_up_to_its_border():
    shapes = rectangles([[1.0, 1.0]])
    options = PackOptions(resolution=512, padding=8, rotate="none")
    board = board_of(shapes, options, 64, 0.9)
    side = int(board.masks[0].size.max())
    found = lay_out(board, np.zeros(1, int), side, 2.0, 1, [np.arange(1)], endless())
    placement = to_placement(board, found, options)
    box = shapes.boxes(placement.angle) * placement.scale + np.tile(placement.offset, 2)
    cell = placement.scale * board.cell
    assert box.min() >= options.border - 1e-9
    assert box.max() <= options.resolution - options.border + 1e-9
    assert box.min() <= options.border + cell * 2
    assert box.max() >= options.resolution - options.border - cell * 2


def test_no_layout_is_larger_than_asked_for():
    """Pages too large to be of use are not laid out, nor given: the best found without that is still found."""
    shapes = shapes_of(*blobs(8, 4, 0.4))
    options = PackOptions(resolution=512, padding=3)
    board = board_of(shapes, options)
    free = search(board, shapes, options, Budget(4e6, lambda: False))
    largest = free[-1].side - 1
    found = search(board, shapes, options, Budget(4e6, lambda: False), largest)
    assert found
    assert max(f.side for f in found) <= largest
    assert not search(board, shapes, options, Budget(4e6, lambda: False), free[0].side // 2)


def test_only_the_masks_allowed_are_used() -> None:
    shapes = shapes_of(*blobs(6, 4, 0.4))
    options = PackOptions(resolution=512, padding=3)
    board = board_of(shapes, options)
    allowed = [np.array([1, 3])] * 6
    found = search(board, shapes, options, Budget(2e6, lambda: False), allowed=allowed)
    assert found
    assert all(np.isin(f.mask, [1, 3]).all() for f in found)
