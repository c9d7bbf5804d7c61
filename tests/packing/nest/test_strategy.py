"""Nesting from end to end."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing import pack
from circparam.packing.nest.strategy import nested
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import finish
from circparam.packing.placement import PackTask
from circparam.packing.shelf import shelf_placement
from tests.support.packing import blobs, boxes, rectangles


def test_nesting_beats_rows_of_boxes():
    faces, uv, chart = blobs(9, 5)
    options = PackOptions(512, effort=0.2)
    boxes = shelf_placement(PackTask(shapes_of(faces, uv, chart), options))
    assert (512 * pack(faces, uv, chart, options).scale) ** 2 > 1.15 * boxes.scale**2


def test_one_chart_is_turned_to_fill_the_page():
    """A square on its tip fills the page up to the border when turned by 45 degrees."""
    packed = pack(*boxes([[1, 1]], np.pi / 4), PackOptions(256, 4))
    assert packed.share[0] == pytest.approx((248 / 256) ** 2, abs=1e-3)


@pytest.mark.parametrize(("density", "pages"), [(40.0, 1), (60.0, 2), (100.0, 4)])
def test_a_fixed_scale_takes_the_fewest_pages(density, pages):
    """Nine unit squares at that many texels a side of a page of 256: 5 x 5, 4 x 4 and 2 x 2 fit a page."""
    n = {1: 16, 2: 18, 4: 15}[pages]
    shapes = rectangles(np.ones((n, 2)))
    options = PackOptions(resolution=256, padding=2, rotate="none", texel_density=density, pages=6)
    task = PackTask(shapes, options)
    placement = nested(task)
    assert placement.scale == pytest.approx(density)
    assert len(set(placement.page)) == pages
    assert finish(shapes, placement, options)[1] is None


def test_what_the_check_refuses_is_not_taken():
    """Where no compacted layout is sound, the layout of the grid is returned as it is; the caller checks it."""
    shapes = shapes_of(*blobs(6, 3))
    options = PackOptions(resolution=256, effort=0.05)
    asked = []

    def refuse(placement):
        asked.append(placement.scale)
        return False

    loose = nested(PackTask(shapes, options, sound=refuse))
    tight = nested(PackTask(shapes, options))
    assert loose.scale < min(asked)
    assert tight.scale == asked[0]
    assert finish(shapes, loose, options)[1] is None
