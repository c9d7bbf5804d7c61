"""Closest points of triangles, beside all points of a fine grid on them; near places, by comparing all."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from circparam.geometry.closest import centres, closest_on_triangles, within

N = 40
GRID = np.array([(i, j, N - i - j) for i in range(N + 1) for j in range(N + 1 - i)]) / N


@pytest.mark.parametrize("kind", ["any", "needle", "line", "point"])
def test_no_point_of_the_triangle_is_nearer(kind: str) -> None:
    rng = np.random.default_rng(0)
    corners, p = rng.normal(size=(60, 3, 3)), rng.normal(size=(60, 3)) * 2
    if kind == "needle":
        corners[:, 2] = 0.5 * corners[:, 0] + 0.5 * corners[:, 1] + 1e-4 * corners[:, 2]
    elif kind == "line":
        corners[:, 2] = corners[:, 0] + 1.5 * (corners[:, 1] - corners[:, 0])
    elif kind == "point":
        corners[:] = corners[:, :1]
    bary, square = closest_on_triangles(p, corners)
    assert (bary >= 0).all()
    assert np.allclose(bary.sum(1), 1)
    place = np.einsum("kc,kcd->kd", bary, corners)
    np.testing.assert_allclose(square, ((p - place) ** 2).sum(1), rtol=1e-9, atol=1e-12)
    points = np.einsum("gc,kcd->kgd", GRID, corners)
    nearest = np.sqrt(((points - p[:, None]) ** 2).sum(2).min(1))
    longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(1)
    assert (np.sqrt(square) <= nearest + 1e-9).all()
    assert (np.sqrt(square) >= nearest - longest / N).all()


@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.tuples(st.integers(1, 60), st.integers(1, 20), st.integers(1, 4)),
)
@example(seed=0, sizes=(2500, 1800, 3))
def test_near_means_a_place_of_the_own_group_within_its_reach(seed, sizes):
    random = np.random.default_rng(seed)
    m, k, n = sizes
    at, to = random.random((m, 2)), random.random((k, 2))
    group, of = random.integers(0, n, m), random.integers(0, n, k)
    reach = random.random(n) / np.sqrt(k)
    reach[random.integers(0, n)] = random.choice([0.0, 0.3, np.inf])
    distance = np.linalg.norm(at[:, None] - to, axis=2)
    distance[group[:, None] != of] = np.inf
    expected = distance.min(1) < reach[group]
    assert np.array_equal(within((at, group), (to, of), reach), expected)


def test_a_centre_is_the_mean_of_the_corners() -> None:
    uv = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 6.0], [9.0, 9.0]])
    assert np.allclose(centres(uv, np.array([[0, 1, 2], [1, 3, 2]])), [[1, 2], [4, 5]])
