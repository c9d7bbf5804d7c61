"""Descent on many independent problems at once."""

from __future__ import annotations

import numpy as np

from circparam.solvers.lbfgs import DescentOptions, Groups, descend


def test_descent_finds_the_minimum_of_quadratics_of_different_size_together():
    scale = np.repeat([1.0, 1e6], 5)
    group = np.repeat([0, 1], 5)
    target = np.random.default_rng(0).normal(size=(10, 2))
    weight = scale[:, None] * np.linspace(1, 20, 10)[:, None]

    def energy(x):
        d = x - target
        return np.bincount(group, (weight * d * d).sum(1)) / 2, weight * d

    found = descend(
        energy,
        np.zeros((10, 2)),
        Groups(group, 2),
        lambda g: g / scale[:, None],
        DescentOptions(1e-14, 200),
    )
    np.testing.assert_allclose(found.x, target, atol=1e-5)
    assert (found.steps > 1).all()
    assert set(found.reasons) <= {"converged", "no lower step"}
