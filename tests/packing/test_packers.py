"""Each packer by itself: what is promised holds for its layouts, and they are as full as they should be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from circparam.packing import pack
from circparam.packing.nest.strategy import nested
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, shapes_of
from circparam.packing.pack import finish
from circparam.packing.placement import PackTask, Placement
from circparam.packing.rows import row_placement
from circparam.packing.shelf import shelf_placement
from circparam.packing.skyline import skyline_placement
from circparam.packing.table import SKYLINE_CHARTS
from tests.support.packing import QUICK, blobs, rectangles, triangles


def nest(shapes: Shapes, options: PackOptions) -> Placement | None:
    options = replace(options, effort=QUICK)
    sound = lambda placed: finish(shapes, placed, options)[1] is None  # noqa: E731
    return nested(PackTask(shapes, options, sound=sound))


PACKERS: dict[str, Callable[[Shapes, PackOptions], Placement | None]] = {
    "shelf": lambda *given: shelf_placement(PackTask(*given)),
    "rows": lambda *given: row_placement(PackTask(*given)),
    "skyline": lambda *given: skyline_placement(PackTask(*given)),
    "nest": nest,
}
# of the largest scale at which equal squares fit side by side with the gap of the packer
FILLED = {"shelf": 0.9999, "rows": 0.998, "skyline": 0.69, "nest": 0.998}


def placed(packer: str, shapes: Shapes, options: PackOptions) -> Placement:
    """A layout, which is sound."""
    found = PACKERS[packer](shapes, options)
    assert found is not None
    assert finish(shapes, found, options)[1] is None
    return found


@pytest.mark.parametrize("packer", PACKERS)
@pytest.mark.parametrize(("rotate", "padding"), [("free", 0), ("free", 9), ("90", 4), ("none", 1)])
def test_a_layout_is_sound_and_turned_as_allowed(packer: str, rotate: str, padding: int) -> None:
    shapes = shapes_of(*blobs(10 if packer == "nest" else 40, padding, 0.5))
    quarters = placed(packer, shapes, PackOptions(512, padding, rotate)).angle / (np.pi / 2)
    if rotate != "free":
        np.testing.assert_allclose(quarters, np.round(quarters), atol=1e-12)
    if rotate == "none":
        assert not quarters.any()


@pytest.mark.parametrize("packer", PACKERS)
@pytest.mark.parametrize(("n", "pages", "side"), [(9, 1, 3), (8, 2, 2)])
def test_equal_squares_fill_the_pages(packer: str, n: int, pages: int, side: int) -> None:
    options = PackOptions(resolution=512, padding=3, pages=pages, rotate="none")
    found = placed(packer, rectangles(np.ones((n, 2))), options)
    room = 512 - 2 * options.border
    gap = options.box_gap if packer in ("shelf", "nest") else options.gap
    most = (room - (side - 1) * gap) / side
    assert FILLED[packer] * most < found.scale <= most * (1 + 1e-3)
    assert np.bincount(found.page).tolist() == [side**2] * pages


@pytest.mark.parametrize("packer", PACKERS)
def test_a_fixed_scale_is_kept_or_there_is_none(packer: str) -> None:
    """Five squares: four lie on a page of 200 up to a scale of 93, two pages hold all of them."""
    shapes = rectangles(np.ones((5, 2)))
    asked = PackOptions(resolution=200, padding=3, rotate="none", texel_density=75.0)
    assert PACKERS[packer](shapes, asked) is None
    found = placed(packer, shapes, replace(asked, pages=3))
    assert found.scale == pytest.approx(75.0)
    assert set(found.page.tolist()) == {0, 1}
    assert PACKERS[packer](shapes, replace(asked, pages=3, texel_density=250.0)) is None


@pytest.mark.parametrize(("packer", "gain"), [("rows", 1.08), ("skyline", 1.3)])
def test_ragged_charts_sink_into_each_other(packer: str, gain: float) -> None:
    """Triangles lie on each other where boxes may not."""
    shapes = shapes_of(*triangles(400, 3))
    options = PackOptions(1024, 1)
    tight, boxes = placed(packer, shapes, options), placed("shelf", shapes, options)
    assert tight.scale**2 > gain * boxes.scale**2


def test_boxes_without_extent_have_places_of_their_own_or_none() -> None:
    points = rectangles(np.full((9, 2), 1e-200))
    for resolution, fits in ((9, True), (5, False)):
        found = PACKERS["shelf"](points, PackOptions(resolution=resolution, padding=2))
        assert (found is not None) == fits


def test_at_a_fixed_scale_a_chart_is_turned_where_its_box_is_longer_than_the_page() -> None:
    """A bar of 11 x 1 fits a page of 10 askew alone: its least box is 11 long."""
    shapes = rectangles(np.array([[11.0, 1.0], [4.0, 1.0]]))
    options = PackOptions(resolution=100, padding=1, texel_density=9.0, pages=2)
    assert placed("shelf", shapes, options).scale == 9.0
    assert PACKERS["shelf"](shapes, replace(options, rotate="90")) is None


def test_more_charts_than_a_skyline_takes_go_into_rows_where_these_are_fuller() -> None:
    """On a small page gaps between boxes are narrower, and count for more than shapes."""
    shapes = shapes_of(*triangles(3000, 3))
    for options, fuller in ((PackOptions(256, 3), False), (PackOptions(2048, 1), True)):
        boxes = PACKERS["shelf"](shapes, options)
        found = row_placement(PackTask(shapes, options, least=boxes.scale))
        assert (found is not None) == fuller
    assert pack(*triangles(SKYLINE_CHARTS + 1, 5), PackOptions(1024, 1)).share[0] > 0.25
