"""Rows let down on each other: everything that is promised of a layout, and more than plain rows hold."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.packing import pack
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import finish
from circparam.packing.rows import row_placement
from circparam.packing.shelf import shelf_placement
from circparam.packing.table import SKYLINE_CHARTS
from tests.support.packing import blobs, rectangles, triangles


@pytest.mark.parametrize("rotate", ["free", "90", "none"])
@pytest.mark.parametrize("padding", [0, 4, 9])
def test_a_layout_is_sound(rotate: str, padding: int) -> None:
    shapes = shapes_of(*blobs(300, padding, 0.4))
    options = PackOptions(1024, padding, rotate)
    placement = row_placement(shapes, options, Monitor())
    assert placement is not None
    packed, wrong = finish(shapes, placement, options)
    assert wrong is None
    assert packed.share[0] > 0.3


def test_ragged_charts_sink_into_each_other() -> None:
    """Triangles, upright or turned by half, lie on each other where boxes may not."""
    shapes = shapes_of(*triangles(2000, 3))
    options = PackOptions(2048, 1)
    rows, boxes = row_placement(shapes, options, Monitor()), shelf_placement(shapes, options)
    assert rows is not None
    assert boxes is not None
    assert rows.scale**2 > 1.08 * boxes.scale**2


def test_equal_squares_fill_their_rows() -> None:
    """144 squares of one size need 12 rows of 12, with their padding and no more."""
    shapes = rectangles(np.ones((144, 2)))
    options = PackOptions(1200, 4, "none")
    placement = row_placement(shapes, options, Monitor())
    assert placement is not None
    most = (1200 - 2 * options.border - 11 * options.gap) / 12
    assert 0.98 * most < placement.scale <= most * (1 + 1e-9)


def test_pages_fill_one_after_the_other() -> None:
    shapes = rectangles(np.ones((300, 2)))
    options = PackOptions(256, 2, pages=4)
    placement = row_placement(shapes, options, Monitor())
    assert placement is not None
    assert set(placement.page.tolist()) == {0, 1, 2, 3}
    assert finish(shapes, placement, options)[1] is None


def test_a_page_is_full_before_the_next_begins() -> None:
    """Of 16 squares to a page 40 need two full pages and half of the third."""
    shapes = rectangles(np.ones((40, 2)))
    options = PackOptions(256, 2, "none", pages=4, texel_density=58.0)
    placement = row_placement(shapes, options, Monitor())
    assert placement is not None
    assert np.bincount(placement.page).tolist() == [16, 16, 8]


def test_a_fixed_scale_is_kept_or_there_is_none() -> None:
    shapes = rectangles(np.ones((300, 2)))
    fits = row_placement(shapes, PackOptions(256, 2, texel_density=9.0), Monitor())
    assert fits is not None
    assert fits.scale == 9.0
    assert row_placement(shapes, PackOptions(256, 2, texel_density=14.0), Monitor()) is None
    assert row_placement(shapes, PackOptions(256, 2, texel_density=300.0), Monitor()) is None


def test_more_than_a_skyline_takes_are_packed() -> None:
    faces, uv, chart = triangles(SKYLINE_CHARTS + 1, 5)
    packed = pack(faces, uv, chart, PackOptions(2048, 1))
    assert packed.share[0] > 0.4


def test_charts_are_given_up_where_gaps_count_for_more_than_shapes() -> None:
    """12,000 charts on a page of 512 are gaps and little else, and gaps between boxes are narrower."""
    shapes = shapes_of(*triangles(12_000, 3))
    for options, fuller in ((PackOptions(512, 3), False), (PackOptions(4096, 1), True)):
        boxes = shelf_placement(shapes, options)
        assert boxes is not None
        found = row_placement(shapes, options, Monitor(), boxes.scale)
        assert (found is not None) == fuller
        assert found is None or found.scale > boxes.scale
