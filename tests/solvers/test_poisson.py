"""Layouts from the Jacobians that faces should have."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.intrinsic import jacobians
from circparam.solvers import dirichlet
from circparam.solvers.poisson import clamp_stretch, from_jacobians
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import developable, patches_of


def test_a_poisson_layout_returns_the_layout_its_jacobians_came_from() -> None:
    cut_mesh = developable("cone")
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
