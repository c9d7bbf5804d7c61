"""Rows of bounding boxes: apart, on the page, and as large as rows can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.packing.options import PackOptions
from circparam.packing.pack import finish
from circparam.packing.shelf import shelf_placement
from tests.support.packing import rectangles


def boxes(shapes, placed):
    return shapes.boxes(placed.angle) * placed.scale + np.tile(placed.offset, 2)


@settings(max_examples=60)
@given(
    n=st.integers(1, 30),
    seed=st.integers(0, 10**6),
    padding=st.integers(0, 6),
    pages=st.integers(1, 3),
)
def test_boxes_keep_their_distance(n, seed, padding, pages):
    sizes = np.random.default_rng(seed).uniform(0.05, 1, (n, 2))
    shapes = rectangles(sizes)
    options = PackOptions(resolution=256, padding=padding, rotate="90", pages=pages)
    placed = shelf_placement(shapes, options)
    box = boxes(shapes, placed)
    assert box.min() >= options.border - 1e-6
    assert box.max() <= options.resolution - options.border + 1e-6
    apart = np.maximum(box[:, None, :2] - box[None, :, 2:], box[None, :, :2] - box[:, None, 2:])
    same_page = placed.page[:, None] == placed.page[None]
    near = same_page & ~np.eye(n, dtype=bool) & (apart.max(2) < options.box_gap - 1e-6)
    assert not near.any()
    assert set(placed.page) <= set(range(pages))
    width, height = box[:, 2] - box[:, 0], box[:, 3] - box[:, 1]
    assert (width >= height - 1e-9).all()  # the long side along u
    assert finish(shapes, placed, options)[1] is None


@pytest.mark.parametrize(("n", "pages", "side"), [(1, 1, 1), (4, 1, 2), (9, 1, 3), (8, 2, 2)])
def test_equal_squares_fill_the_page(n, pages, side):
    options = PackOptions(resolution=200, padding=3, pages=pages, rotate="none")
    placed = shelf_placement(rectangles(np.ones((n, 2))), options)
    room = 200 - 2 * options.border - (side - 1) * options.box_gap
    assert placed.scale == pytest.approx(room / side, rel=2e-5)
    assert placed.scale <= room / side * (1 + 1e-9)
    assert np.bincount(placed.page).tolist() == [side**2] * pages


def test_one_more_square_does_not_fit():
    options = PackOptions(resolution=200, padding=3, rotate="none")
    squares = rectangles(np.ones((5, 2)))
    largest = (200 - 2 * options.border - options.box_gap) / 2
    assert shelf_placement(squares, options).scale < 0.7 * largest
    fixed = PackOptions(resolution=200, padding=3, rotate="none", texel_density=largest)
    assert shelf_placement(rectangles(np.ones((4, 2))), fixed).scale == largest
    assert shelf_placement(squares, fixed) is None
    wide = PackOptions(resolution=200, padding=3, texel_density=2 * largest + 3.1)
    assert shelf_placement(rectangles(np.ones((1, 2))), wide) is None


def test_charts_without_extent_have_places_of_their_own_or_none():
    points = rectangles(np.full((9, 2), 1e-200))
    assert shelf_placement(points, PackOptions(resolution=9, padding=2)) is not None
    assert shelf_placement(points, PackOptions(resolution=5, padding=2)) is None


def test_at_a_fixed_scale_a_chart_is_turned_where_its_box_is_longer_than_the_page():
    """A bar of 11 x 1 fits a page of 10 askew alone: its least box is 11 long."""
    shapes = rectangles(np.array([[11.0, 1.0], [4.0, 1.0]]))
    options = PackOptions(resolution=100, padding=1, texel_density=9.0, pages=2)
    room = (options.resolution - 2 * options.border) / 9.0
    assert 12 / np.sqrt(2) < room < 11
    placed = shelf_placement(shapes, options)
    assert placed.scale == 9.0
    assert finish(shapes, placed, options)[1] is None
    assert shelf_placement(shapes, replace(options, rotate="90")) is None
