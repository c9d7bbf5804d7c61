"""Closest points of triangles, beside all points of a fine grid on them."""

import numpy as np
import pytest

from circparam.geometry.closest import closest_on_triangles

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
