"""The symmetric Dirichlet energy face by face: its derivatives and the largest step without a collapse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.arrays import FloatArray
from circparam.solvers import dirichlet
from tests.support.shapes import areas


def _jacobians(seed: int, count: int = 60) -> FloatArray:
    """Random Jacobians (2, 2, count) with a positive determinant, some of them nearly collapsed."""
    rng = np.random.default_rng(seed)
    j = rng.normal(size=(2, 2, 4 * count))
    j[:, 1, : count // 4] *= 0.05
    return j[:, :, dirichlet.determinants(j) > 1e-2][:, :, :count]


@pytest.mark.parametrize("blend", [0.0, 0.4, 1.0])
def test_the_gradient_is_that_of_the_energy(blend: float) -> None:
    j = _jacobians(1)
    g = dirichlet.gradient(j, blend)
    for d in range(2):
        for c in range(2):
            step = np.zeros_like(j)
            step[d, c] = 1e-6
            slope = (dirichlet.energy(j + step, blend) - dirichlet.energy(j - step, blend)) / 2e-6
            assert np.abs(slope - g[d, c]).max() <= 1e-5 * np.abs(g).max()


@given(st.integers(0, 10_000))
@settings(max_examples=40)
def test_the_largest_step_is_where_a_face_first_collapses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array([[0.0, 1.0, 0.2], [0.0, 0.1, 1.0]])[:, :, None] + rng.normal(
        scale=0.1, size=(2, 3, 30)
    )
    direction = rng.normal(size=(2, 3, 30))
    t = dirichlet.largest_step(corners, direction)

    def area(s: FloatArray) -> FloatArray:
        return 2 * areas((corners + s * direction).transpose(2, 1, 0))

    hit = np.isfinite(t)
    reached = np.where(hit, t, 0.0)
    assert (np.abs(area(reached)) <= 1e-9 * (1 + reached**2))[hit].all()  # rounding of far corners
    for share in (0.1, 0.5, 0.9, 0.99):
        assert (area(np.where(hit, share * t, share * 50.0)) > 0).all()


def test_an_isometry_has_energy_one_and_no_other_map_less() -> None:
    t = np.linspace(0, 6, 30)
    rotations = np.stack([np.stack([np.cos(t), -np.sin(t)]), np.stack([np.sin(t), np.cos(t)])])
    for blend in (0.0, 0.5, 1.0):
        np.testing.assert_allclose(dirichlet.energy(rotations, blend), 1.0)
        assert np.abs(dirichlet.gradient(rotations, blend)).max() < 1e-12
        assert (dirichlet.energy(_jacobians(5), blend) >= 1 - 1e-12).all()
    j = np.array([[3.0, 0.0], [0.0, 0.5]])[:, :, None]
    assert dirichlet.energy(j)[0] == pytest.approx((9 + 1 / 9 + 0.25 + 4) / 4)
    assert dirichlet.energy(j, 1.0)[0] == pytest.approx((6 + 1 / 6) / 2)


@pytest.mark.parametrize("bad", [[[1, 0], [0, -1]], [[1, 1], [1, 1]], [[0, 0], [0, 0]]])
def test_flipped_and_collapsed_faces_have_infinite_energy(bad: list[list[float]]) -> None:
    j = np.array(bad, float)[:, :, None]
    for blend in (0.0, 0.5, 1.0):
        assert dirichlet.energy(j, blend)[0] == np.inf
