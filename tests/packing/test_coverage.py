"""What charts cover, told from their outlines and from their faces."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.geometry.coverage import painted
from circparam.geometry.raster import shared_texels
from circparam.packing.outlines import shapes_of
from tests.support.packing import blobs, owner_raster, triangles
from tests.support.shapes import areas, flat_ring

SIDE = 64


def by_outline(faces, uv, chart):
    """The grid by the outlines of all charts, and how many texels outlines share."""
    shapes = shapes_of(faces, uv, chart)
    start, end, own = shapes.start, shapes.end, shapes.owner[shapes.start]
    grid = painted(uv[start], uv[end], own, SIDE)
    return grid, shared_texels(grid, uv[start], uv[end], own)


def agrees(faces, uv, chart):
    """The outlines of charts enclose what their faces cover, one by one."""
    grid, shared = by_outline(faces, uv, chart)
    alone = np.array(
        [
            owner_raster(uv[faces[chart == c]], chart[chart == c], SIDE)
            for c in range(chart.max() + 1)
        ]
    )
    layers = (alone >= 0).sum(0)
    assert shared or (layers < 2).all()
    np.testing.assert_array_equal(grid >= 0, layers > 0)
    np.testing.assert_array_equal(grid[layers < 2], alone.max(0)[layers < 2])


@settings(max_examples=40)
@given(
    n=st.integers(1, 8),
    seed=st.integers(0, 10**6),
    zoom=st.floats(0.5, 4.0),
    grid=st.sampled_from([0.0, 0.25, 0.5]),
    kind=st.sampled_from([blobs, triangles]),
)
def test_outlines_tell_what_faces_cover(n, seed, zoom, grid, kind):
    """Also off the page, where charts overlap, and with vertices and edges just on the centres of texels."""
    faces, uv, chart = kind(n, seed)
    uv = uv * zoom + SIDE / 2
    if grid:
        uv = np.round((uv - SIDE / 2) * 5 / grid) * grid + SIDE / 2
        assume((areas(uv[faces]) > 0).all())  # charts that rounding leaves none of cover nothing
    agrees(faces, uv, chart)


def test_a_chart_with_a_hole_stays_empty_there():
    uv, faces = flat_ring(7.0, 21.0, 4)
    uv = uv + 25.3
    agrees(faces, uv, np.zeros(8, int))
    assert by_outline(faces, uv, np.zeros(8, int))[0][25, 25] == -1


def test_faces_without_area_cover_the_centres_that_they_run_through():
    """A spike as thin as a line through the centres of texels counts as covered."""
    uv = np.array([[10.0, 10], [30, 10], [20, 30], [40.5, 20.5], [50.5, 20.5]])
    faces = np.array([[0, 1, 2], [2, 3, 4], [3, 4, 3]])
    agrees(faces[:2], uv, np.zeros(2, int))
    flat = np.array([[10.5, 10.5], [20.5, 20.5], [15.5, 15.5], [30, 30], [40, 30], [30, 40]])
    agrees(np.array([[0, 1, 2], [3, 4, 5]]), flat, np.array([0, 1]))
