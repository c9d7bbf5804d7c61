"""Layouts from the Jacobians that faces should have; the direct solve judges the iterative one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.arrays import group_count, group_sum
from circparam.geometry.intrinsic import jacobians
from circparam.solvers import dirichlet
from circparam.solvers.cell_poisson import CellPoisson
from circparam.solvers.poisson import clamp_stretch, from_jacobians
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of


def test_a_poisson_layout_returns_the_layout_its_jacobians_came_from() -> None:
    cut_mesh, _ = patches_of(shapes.cone(slit=True))
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jac = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
    again, fine = from_jacobians(cut_mesh, jac)
    assert fine.all()
    assert np.allclose(again - again[0], uv - uv[0], atol=1e-9)


@given(st.integers(0, 1000), st.floats(0.1, 0.9))
@settings(max_examples=30)
def test_clamped_jacobians_are_never_flipped(seed: int, low: float) -> None:
    j = np.random.default_rng(seed).normal(size=(2, 2, 50))
    clamped = clamp_stretch(j, low)
    s = np.linalg.svd(clamped.transpose(2, 0, 1), compute_uv=False)
    assert (dirichlet.determinants(clamped) > 0).all()
    assert s.min() >= low * (1 - 1e-9)
    assert s.max() <= (1 + 1e-9) / low
    large, small = np.linalg.svd(j.transpose(2, 0, 1), compute_uv=False).T
    kept = (dirichlet.determinants(j) > 0) & (small > low) & (large < 1 / low)
    np.testing.assert_allclose(clamped[..., kept], j[..., kept], atol=1e-12)


def test_flips_are_cleared_in_their_charts_only() -> None:
    cut_mesh, points = patches_of(shapes.row_of(shapes.delaunay_disk(80), 2))
    targets = np.ascontiguousarray(jacobians(cut_mesh, points[:, :2]).transpose(1, 2, 0))
    inner = np.flatnonzero(cut_mesh.chart == 1)[10:14]
    targets[:, :, inner] *= np.array([[1.0], [-3.0]])[:, :, None]
    plain, fine = from_jacobians(cut_mesh, targets)
    assert fine.tolist() == [True, False]
    cleared, fine = from_jacobians(cut_mesh, targets, untangle=30)
    assert fine.all()
    np.testing.assert_allclose(
        cleared[cut_mesh.vertex_chart == 0], plain[cut_mesh.vertex_chart == 0], atol=1e-12
    )


def cells_of(cut_mesh, uv, side: float) -> np.ndarray:
    """Squares of the plane, chart by chart."""
    square = np.floor(uv / side).astype(np.int64)
    square -= square.min(0)
    key = (cut_mesh.vertex_chart * 1000 + square[:, 0]) * 1000 + square[:, 1]
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def centred(cut_mesh, uv):
    n = cut_mesh.n_charts
    count = group_count(cut_mesh.vertex_chart, n)
    mean = np.stack([group_sum(uv[:, d], cut_mesh.vertex_chart, n) / count for d in range(2)], 1)
    return uv - mean[cut_mesh.vertex_chart]


@pytest.mark.parametrize("far", [0.0, 0.4])
def test_the_direct_solve_and_conjugate_gradients_agree(far: float) -> None:
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(1500, 0.6), 2))
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    rng = np.random.default_rng(0)
    targets = np.moveaxis(jacobians(cut_mesh, uv), 0, -1)
    targets = targets + 0.2 * rng.normal(size=targets.shape)
    wanted, _ = from_jacobians(cut_mesh, targets)
    # wrong by noise on every vertex, and by a wave that is as long as a chart
    start = wanted + 0.05 * rng.normal(size=wanted.shape) + far * np.sin(wanted)
    system = CellPoisson(cut_mesh, cells_of(cut_mesh, uv, 0.2))
    found = centred(cut_mesh, system.towards(targets, start))
    size = np.ptp(wanted, axis=0).max()
    assert np.abs(found - centred(cut_mesh, wanted)).max() < 1e-2 * size
    assert np.abs(centred(cut_mesh, start) - centred(cut_mesh, wanted)).max() > 5e-2 * size
