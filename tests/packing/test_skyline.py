"""Charts on the skyline of those below."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.packing import pack
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.pack import finish
from circparam.packing.skyline import profiles, skyline_placement
from tests.support.packing import blobs, covered, rectangles, shelf, triangles


def test_two_thousand_single_triangles():
    faces, uv, chart = triangles(2000, 1)
    options = PackOptions(1024, 2)
    packed = pack(faces, uv, chart, options)
    owner, twice = covered(faces, packed.uv, chart, 1024)
    assert twice == 0
    assert packed.share[0] > 1.1 * shelf(faces, uv, chart, options).share[0]
    centres = np.argwhere(owner >= 0)
    who = owner[owner >= 0]
    from scipy.spatial import cKDTree

    pairs = cKDTree(centres).query_pairs(2.99, output_type="ndarray")
    assert (who[pairs[:, 0]] == who[pairs[:, 1]]).all()


@pytest.mark.parametrize("grow", [0.0, 1.0, 3.7])
@pytest.mark.parametrize("cell", [0.5, 2.0])
def test_column_bounds_hold_the_grown_chart_and_hardly_more(grow, cell):
    """Points of the outline grown by a disc lie between the bounds of their column, close to them somewhere."""
    shapes = shapes_of(*blobs(4, 7, 0.3))
    angle = np.random.default_rng(1).uniform(0, 6, (4, 2))
    scale = 12.0
    found = profiles(shapes, angle, scale, grow, cell)
    circle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    disc = grow * np.stack([np.cos(circle), np.sin(circle)], 1)
    t = np.linspace(0, 1, 60)[:, None, None]
    for c in range(4):
        a, b = shapes.outline(c)
        outline = (a * (1 - t) + b * t).reshape(-1, 2) * scale
        for j in range(2):
            e = 2 * c + j
            part = slice(found.start[e], found.start[e + 1])
            lower, upper = found.lower[part], found.upper[part]
            assert (lower <= upper).all()
            k, s = np.cos(angle[c, j]), np.sin(angle[c, j])
            p = outline @ np.array([[k, s], [-s, k]])
            p = (p[:, None] + disc).reshape(-1, 2)
            # and no bound is further out than the chart itself
            assert p[:, 1].min() == pytest.approx(lower.min(), abs=0.05)
            assert p[:, 1].max() == pytest.approx(upper.max(), abs=0.05)
            assert len(lower) * cell <= np.ptp(p[:, 0]) + 4 * cell
            x = (p[:, 0] - found.left[e]) / cell
            assert x.min() > -1e-6
            assert x.max() < len(lower) + 1e-6
            p = p[
                np.abs(x - np.round(x)) > 1e-6
            ]  # on the line between two columns either may hold it
            x = x[np.abs(x - np.round(x)) > 1e-6]
            column = np.floor(x).astype(int)
            assert (p[:, 1] >= lower[column] - 1e-3).all()
            assert (p[:, 1] <= upper[column] + 1e-3).all()


def test_a_chart_in_parts_is_bounded_where_it_is():
    """Nothing lies between two far parts of one chart; their columns are bounded as their parts are."""
    p = np.array([[0.0, 0], [1, 0], [0, 1], [8, 4], [9, 4], [8, 5]])
    shapes = shapes_of(np.array([[0, 1, 2], [3, 4, 5]]), p, np.zeros(2, int))
    found = profiles(shapes, np.zeros((1, 1)), 1.0, 0.0, 0.25)
    between = slice(6, 30)
    assert (found.lower[between] > found.upper[between]).all()  # empty: it rests on nothing
    assert found.lower[0] == pytest.approx(-2.5)
    assert found.upper[-1] == pytest.approx(1.5, abs=0.3)


@pytest.mark.parametrize(("n", "pages"), [(9, 1), (8, 2)])
def test_equal_squares_come_to_rest_in_a_grid(n, pages):
    options = PackOptions(resolution=512, padding=2, rotate="none", pages=pages)
    shapes = rectangles(np.ones((n, 2)))
    placed = skyline_placement(shapes, options, Monitor())
    side = int(np.sqrt(n // pages))
    room = (512 - 2 * options.border - (side - 1) * options.gap) / side
    assert 0.65 * room < placed.scale <= room * 1.001
    assert np.bincount(placed.page).tolist() == [n // pages] * pages
    assert finish(shapes, placed, options)[1] is None


def test_a_fixed_scale_is_kept_or_refused():
    shapes = rectangles(np.ones((4, 2)))
    for density, fits in ((220.0, True), (260.0, False)):
        options = PackOptions(resolution=512, padding=2, rotate="none", texel_density=density)
        placed = skyline_placement(shapes, options, Monitor())
        assert (placed is not None) == fits
        if fits:
            assert placed.scale == density
            assert finish(shapes, placed, options)[1] is None


@pytest.mark.parametrize("padding", [0, 1, 4, 9])
@pytest.mark.parametrize("rotate", ["free", "90", "none"])
def test_charts_on_the_skyline_pass_the_check(padding, rotate):
    shapes = shapes_of(*blobs(50, padding, 0.5))
    options = PackOptions(resolution=512, padding=padding, rotate=rotate)
    placed = skyline_placement(shapes, options, Monitor())
    assert finish(shapes, placed, options)[1] is None
    steps = placed.angle / (np.pi / 2)
    if rotate != "free":
        np.testing.assert_allclose(steps, np.round(steps))
    if rotate == "none":
        assert not placed.angle.any()
