"""Scan conversion: every pixel belongs to the face it should; runs, crossings, gaps and free borders."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.geometry.coverage import cover, label_grid, pages_of
from circparam.geometry.raster import (
    NEAR_TEXELS,
    fragments,
    free_border,
    rasterise,
    row_crossings,
    shared_texels,
    smallest_gap,
)
from circparam.mesh.cut_mesh import CutMesh
from tests.support import shapes
from tests.support.charts import flat_of
from tests.support.packing import covered, owner_raster


def test_faces_that_are_drawn_in_chunks_cover_what_each_covers_alone():
    """Nine triangles of a page of 1400 pixels a side are more than are drawn at once."""
    size = 1400
    xy = np.random.default_rng(1).uniform(-0.2, 1.2, (9, 3, 2)) * size
    parts = list(fragments(xy, size, size))
    assert len(parts) > 1
    face = np.concatenate([p.face for p in parts])
    pixel = np.concatenate([p.pixel for p in parts])
    for k in range(len(xy)):
        alone = np.concatenate([p.pixel for p in fragments(xy[k : k + 1], size, size)])
        assert np.array_equal(pixel[face == k], alone)


def test_broken_triangles_cover_nothing():
    xy = np.array(
        [
            [[np.nan, 0], [5, 0], [0, 5]],
            [[1, 1], [1, 1], [1, 1.0]],
            [[0, 0], [9, 0], [4, 0]],
            [[-9, -9], [-5, -9], [-9, -5]],
        ]
    )
    face, z, layers = rasterise(xy, 8, 8, np.zeros((4, 3)))
    assert (face == -1).all()
    assert np.isinf(z).all()
    assert not layers.any()


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_runs_cover_centres_inside_and_on_edges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # corners on quarters of texels: centres on edges and corners are frequent
    corners = rng.integers(-8, 56, (3, 2)) / 4
    d = corners[1:] - corners[0]
    assume(d[0, 0] * d[1, 1] != d[0, 1] * d[1, 0])
    page = owner_raster(corners[None], np.array([5]), 12)
    alone, _ = covered(np.array([[0, 1, 2]]), corners / 12, np.array([5]), 12)
    assert np.array_equal(page, alone)


def test_a_centre_just_off_an_edge_is_covered_and_no_further() -> None:
    square = np.array([[0.0, 0.0], [3.5, 0.0], [3.5, 3.5], [0.0, 3.5]])
    for off, width in ((0.5e-6, 4), (2e-6, 3)):
        corners = (square - [off, off])[[[0, 1, 2], [0, 2, 3]]]
        page = owner_raster(corners, np.zeros(2, np.int64), 8)
        assert (page >= 0).sum() == width * width


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_each_row_is_crossed_where_an_edge_passes_its_centre(seed: int) -> None:
    p = np.random.default_rng(seed).uniform(-3, 13, (6, 2))
    q = np.roll(p, -1, axis=0)
    edge, row, x = row_crossings(p, q, 10)
    y = np.arange(10) + 0.5
    above = p[:, 1, None] > y
    assert np.array_equal(np.argwhere(above != np.roll(above, -1, axis=0)), np.c_[edge, row])
    assert (np.bincount(row, minlength=10) % 2 == 0).all()
    d, e = q[edge] - p[edge], np.c_[x, row + 0.5] - p[edge]
    assert np.allclose(d[:, 0] * e[:, 1], d[:, 1] * e[:, 0], atol=1e-9)


@pytest.mark.parametrize("search", [4, NEAR_TEXELS + 1])
def test_a_gap_is_found_in_every_direction(search: int) -> None:
    """One texel beside another, at every offset within the search."""
    reach = np.arange(-search, search + 1)
    for dy, dx in np.stack(np.meshgrid(reach, reach), 2).reshape(-1, 2).tolist():
        if not 0 < np.hypot(dy, dx) <= search:
            continue
        grid = np.full((2 * search + 1, 2 * search + 1), -1, np.int32)
        grid[search, search], grid[search + dy, search + dx] = 3, 1
        assert smallest_gap(grid, search) == (np.hypot(dy, dx), (1, 3))


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 7) | st.integers(NEAR_TEXELS + 1, NEAR_TEXELS + 9))
def test_smallest_gap_is_that_of_all_pairs(seed: int, search: int) -> None:
    rng = np.random.default_rng(seed)
    grid = np.full(rng.integers(1, 24, 2), -1, np.int32)
    for label in range(int(rng.integers(0, 7))):
        y, x = rng.integers(0, 20, 2)
        h, w = rng.integers(1, 5, 2)
        block = grid[y : y + h, x : x + w]
        block[block < 0] = label
    at = np.argwhere(grid >= 0)
    label = grid[tuple(at.T)]
    distance = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    distance[label[:, None] == label[None]] = np.inf
    best = distance.min(initial=np.inf)
    found, pair = smallest_gap(grid, search)
    assert found == (best if best <= search else np.inf)
    if pair is None:
        assert found == np.inf
    else:
        k = np.argwhere(distance == best)
        pairs = {tuple(sorted((int(label[i]), int(label[j])))) for i, j in k}
        assert pair in pairs


@pytest.mark.parametrize("side", range(4))
@pytest.mark.parametrize("free", [0, 1, 3])
def test_the_free_border_is_that_of_the_nearest_side(side: int, free: int) -> None:
    grid = np.full((20, 20), -1, np.int32)
    assert free_border(grid) == 20, "all of an empty page"
    grid[free, 10] = 0
    assert free_border(np.rot90(grid, side)) == free


def test_the_nearer_face_is_seen_at_its_depth() -> None:
    """Two right triangles over each other, one sloping through the other: depths at pixel centres."""
    flat = [[0.0, 0.0], [8.0, 0.0], [0.0, 8.0]]
    xy = np.array([flat, flat])
    depth = np.array([[4.0, 4.0, 4.0], [0.0, 8.0, 0.0]])  # the second is at x
    face, z, layers = rasterise(xy, 8, 8, depth)
    assert layers.max() == 2
    assert layers[0].tolist() == [2] * 7 + [0], "the centre on the slanted side belongs to the next"
    assert face[0].tolist() == [1] * 4 + [0] * 3 + [-1]
    np.testing.assert_allclose(z[0, :7], [0.5, 1.5, 2.5, 3.5, 4, 4, 4], atol=1e-6)
    assert np.isinf(z[0, 7])
    face, z, _ = rasterise(xy, 8, 8)
    assert set(face[layers > 0].tolist()) == {0}, "without depths the lowest face wins"
    assert set(z[layers > 0].tolist()) == {0.0}
    # one depth everywhere, and depths of which none is a number
    assert rasterise(xy, 8, 8, np.full((2, 3), 5.0))[1][0, 0] == pytest.approx(5)


def test_outlines_through_one_texel_share_it() -> None:
    page = np.full((8, 8), -1, np.int32)
    start, end = np.array([[0.5, 1.5], [0.5, 1.5]]), np.array([[6.5, 1.5], [0.5, 5.5]])
    assert shared_texels(page, start, end, np.array([0, 1])) == 1, "the texel both begin in"
    assert shared_texels(page, start, end, np.array([3, 3])) == 0
    # another chart covers what the outlines run through: each texel once
    page[1, 4:7] = 7
    assert shared_texels(page, start, end, np.array([0, 0])) == 3
    assert shared_texels(page, start, end, np.array([7, 7])) == 0
    page[:] = 0
    assert shared_texels(page, start, end, np.array([0, 0])) == 0
    assert shared_texels(page, start, end, np.array([1, 1])) == 11, "7 to the right, 4 more below"
    assert shared_texels(page, start[:0], end[:0], np.zeros(0, np.int64)) == 0


def squares(corners: list[tuple[float, float]], size: float) -> tuple[CutMesh, np.ndarray]:
    """Axis-aligned squares of one size in the unit square, one chart each."""
    base, f = shapes.grid(3, 3)
    parts = [(base * size + [x, y, 0], f) for x, y in corners]
    return flat_of(shapes.join(*parts))


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.integers(8, 60), st.booleans())
def test_the_boundary_alone_tells_what_faces_cover(seed: int, resolution: int, fold: bool) -> None:
    """And the edges along which a chart is folded over itself."""
    p, f = shapes.delaunay_disk(40, seed % 1000)
    rng = np.random.default_rng(seed)
    p = p * 0.3 + [0.5, 0.5, 0] + [*rng.uniform(-0.1, 0.1, 2), 0]
    cut_mesh, uv = flat_of((p, f))
    if fold:
        uv[:, 0] = np.abs(uv[:, 0] - 0.5) + 0.3
    got = label_grid(cut_mesh, uv, resolution) >= 0
    # centres that lie on a boundary to the last digit may fall on either side
    assert (got != (covered(cut_mesh.faces, uv, cut_mesh.chart, resolution)[0] >= 0)).sum() <= 2


def test_pages_are_tiles() -> None:
    cut_mesh, uv = squares([(0.1, 0.1), (1.1, 0.1), (2.5, 0.5)], 0.2)
    assert pages_of(cut_mesh, uv).tolist() == [0, 1, 2]
    found = cover(cut_mesh, uv, 50, 4)
    assert found.share == pytest.approx(0.04, abs=0.005)
    assert found.border == 5
