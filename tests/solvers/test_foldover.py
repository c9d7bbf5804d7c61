"""The foldover-free energy and its descent."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.solvers.foldover import FoldoverEnergy
from circparam.solvers.region import moving_region
from tests.support import shapes
from tests.support.charts import patches_of, rim


def tangled(n=400, seed=0, share=0.05):
    """A flat disk with some inner vertices thrown about."""
    cut_mesh, points = patches_of(shapes.delaunay_disk(n, seed))
    uv = points[:, :2].copy()
    generator = np.random.default_rng(seed)
    inner = np.flatnonzero(~rim(cut_mesh))
    chosen = generator.choice(inner, max(1, int(share * len(inner))), replace=False)
    uv[chosen] += generator.normal(0, 0.15, (len(chosen), 2))
    return cut_mesh, uv


@pytest.mark.parametrize("epsilon", [1.0, 1e-3])
def test_the_gradient_is_that_of_the_energy(epsilon):
    cut_mesh, uv = tangled(60)
    part = moving_region(cut_mesh, np.ones(len(cut_mesh.faces), bool), np.zeros(len(uv), bool), uv)
    problem = FoldoverEnergy(part, np.full(part.n_groups, epsilon))
    x = uv[part.source]
    _, gradient = problem.energy(x)
    direction = np.random.default_rng(1).normal(size=x.shape)
    h = 1e-7 * epsilon
    up, down = problem.energy(x + h * direction)[0], problem.energy(x - h * direction)[0]
    assert (gradient * direction).sum() == pytest.approx(((up - down) / (2 * h)).sum(), rel=1e-4)
