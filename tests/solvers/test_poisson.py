"""Layouts from the Jacobians that faces should have."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.solvers import dirichlet
from circparam.solvers.poisson import clamp_stretch, from_jacobians
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support.charts import developable


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
