"""The raster of what a check needs: conservative runs, crossings of boundaries, gaps and free borders."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.geometry import raster
from circparam.geometry.raster import (
    covered_runs,
    free_border,
    owner_raster,
    row_crossings,
    smallest_gap,
)


def inside_or_on(corners: np.ndarray, size: int, slack: float) -> np.ndarray:
    """(size, size) centres at most ``slack`` outside a triangle's edge lines (either winding)."""
    x, y = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    a, b, c = corners
    turn = np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    out = np.ones((size, size), bool)
    for p, q in ((a, b), (b, c), (c, a)):
        side = (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
        out &= turn * side >= -slack * np.hypot(*(q - p))
    return out


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_runs_cover_centres_inside_and_on_edges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # corners on quarters of texels: centres on edges and corners are frequent
    corners = rng.integers(-8, 56, (3, 2)) / 4
    d = corners[1:] - corners[0]
    assume(d[0, 0] * d[1, 1] != d[0, 1] * d[1, 0])
    page, clashes = owner_raster(corners[None], np.array([5]), 12)
    assert clashes == 0
    assert set(np.unique(page)) <= {-1, 5}
    assert np.array_equal(page == 5, inside_or_on(corners, 12, 1e-9))


def test_a_centre_just_off_an_edge_is_covered_and_no_further() -> None:
    square = np.array([[0.0, 0.0], [3.5, 0.0], [3.5, 3.5], [0.0, 3.5]])
    for off, width in ((0.5e-6, 4), (2e-6, 3)):
        corners = (square - [off, off])[[[0, 1, 2], [0, 2, 3]]]
        page, _ = owner_raster(corners, np.zeros(2, np.int64), 8)
        assert (page >= 0).sum() == width * width


def test_two_owners_of_a_centre_clash() -> None:
    corners = np.array([[[0, 0], [4, 0], [0, 4.0]], [[4, 4], [0, 4.0], [4, 0]]])
    # the shared edge runs through four centres
    assert owner_raster(corners, np.array([0, 1]), 4)[1] == 4
    assert owner_raster(corners, np.array([3, 3]), 4)[1] == 0


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    corners = np.random.default_rng(0).uniform(-3, 33, (60, 3, 2))
    whole = owner_raster(corners, np.arange(60), 30)
    monkeypatch.setattr(raster, "ROWS_AT_ONCE", 50)
    assert len(list(covered_runs(corners, 30))) > 5
    parts = owner_raster(corners, np.arange(60), 30)
    assert whole[1] > 0
    assert parts[1] > 0
    assert np.array_equal(whole[0] >= 0, parts[0] >= 0)
    assert not list(covered_runs(np.zeros((0, 3, 2)), 30))


@pytest.mark.parametrize("centre", [0.0, 0.5])
def test_crossings_of_a_square(centre: float) -> None:
    p = np.array([[1.0, 2.0], [4.0, 2.0], [5.0, 6.0], [1.0, 6.0]]) + centre
    edge, row, x = row_crossings(p, np.roll(p, -1, axis=0), 20, centre)
    assert edge.tolist() == [1] * 4 + [3] * 4, "rows of the lower end, not of the upper"
    assert row.tolist() == [2, 3, 4, 5] * 2
    assert np.allclose(x, [*(np.array([4, 4.25, 4.5, 4.75]) + centre), *[1 + centre] * 4])
    assert row_crossings(p, np.roll(p, -1, axis=0), 4, centre)[1].tolist() == [2, 3] * 2
    lower = p - [0, 4]
    assert row_crossings(lower, np.roll(lower, -1, axis=0), 9, centre)[1].tolist() == [0, 1] * 2


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.5]))
def test_each_row_is_crossed_where_an_edge_passes_its_centre(seed: int, centre: float) -> None:
    p = np.random.default_rng(seed).uniform(-3, 13, (6, 2))
    q = np.roll(p, -1, axis=0)
    edge, row, x = row_crossings(p, q, 10, centre)
    y = np.arange(10) + centre
    above = p[:, 1, None] > y
    assert np.array_equal(np.argwhere(above != np.roll(above, -1, axis=0)), np.c_[edge, row])
    assert (np.bincount(row, minlength=10) % 2 == 0).all()
    d, e = q[edge] - p[edge], np.c_[x, row + centre] - p[edge]
    assert np.allclose(d[:, 0] * e[:, 1], d[:, 1] * e[:, 0], atol=1e-9)


def test_a_gap_as_wide_as_the_search_is_found() -> None:
    grid = np.full((9, 9), -1, np.int32)
    grid[1, 1], grid[4, 5] = 2, 1
    assert smallest_gap(grid, 5) == (5.0, (1, 2))
    assert smallest_gap(grid, 4) == (np.inf, None)


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 7))
def test_smallest_gap_is_that_of_all_pairs(seed: int, search: int) -> None:
    rng = np.random.default_rng(seed)
    grid = np.full(rng.integers(1, 24, 2), -1, np.int32)
    for label in range(3):
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
    grid[free, 10] = 0
    assert free_border(np.rot90(grid, side)) == free


def test_an_empty_page_is_free_all_over() -> None:
    assert free_border(np.full((7, 7), -1, np.int32)) == 7
