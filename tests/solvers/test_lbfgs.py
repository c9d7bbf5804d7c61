"""Descent on many independent problems at once."""

import numpy as np

from circparam.core.monitor import Monitor
from circparam.solvers.lbfgs import DescentOptions, Groups, descend


def bowls(weight, target, group):
    """Σ w (x − target)² / 2 of every group, as an energy for ``descend``."""

    def energy(x):
        d = x - target
        return np.bincount(group, (weight * d * d).sum(1)) / 2, weight * d

    return energy


def descended(count, weight, target, group, options):
    energy = bowls(weight, target, group)
    return descend(energy, np.zeros_like(target), Groups(group, count), lambda g: g, options)


def test_groups_are_independent_to_the_last_bit():
    generator = np.random.default_rng(3)
    target = generator.normal(size=(12, 2))
    weight = generator.uniform(1, 30, (12, 1))
    group = np.repeat([0, 1, 2], 4)
    options = DescentOptions(1e-13, 100)
    together = descended(3, weight, target, group, options)
    for k in range(3):
        own = group == k
        alone = descended(1, weight[own], target[own], np.zeros(4, int), options)
        np.testing.assert_array_equal(together.x[own], alone.x)
        assert together.steps[k] == alone.steps[0]
        assert together.reasons[k] == alone.reasons[0]


def test_a_start_in_the_minimum_stays_there_while_others_descend():
    target = np.zeros((4, 2))
    target[2:] = 1.0
    found = descended(2, np.ones((4, 1)), target, np.array([0, 0, 1, 1]), DescentOptions(1e-12, 50))
    np.testing.assert_allclose(found.x, target, atol=1e-9)
    assert found.steps[0] == 0
    assert found.reasons[0] == "no lower step"


def test_every_accepted_step_lowers_the_energy_of_its_group_and_time_ends_it():
    seen = []
    target = np.random.default_rng(2).normal(size=(8, 2))
    weight = np.linspace(1, 50, 8)[:, None]
    group = np.repeat([0, 1], 4)

    class Watch(Monitor):
        def update(self, fraction, detail=""):
            seen.append(float(detail.split()[-1]))

        @property
        def expired(self):
            return len(seen) == 4

    energy, groups = bowls(weight, target, group), Groups(group, 2)
    options = DescentOptions(1e-15, 100)
    found = descend(energy, np.zeros((8, 2)), groups, lambda g: g, options, Watch())
    assert len(seen) == 4
    assert (np.diff(seen) < 0).all()
    assert found.reasons == ["out of time"] * 2
    assert found.steps.tolist() == [4, 4]
