"""Linear programs against SciPy's own interface."""

import numpy as np
import pytest
import scipy.sparse as sps
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from circparam.core.linear_program import CHOOSE, SIMPLEX, least


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 12),
    m=st.integers(1, 30),
    reach=st.floats(0.1, 10),
)
@pytest.mark.parametrize("solver", [SIMPLEX, CHOOSE])
def test_the_least_cost_is_that_of_scipy(solver, seed, n, m, reach):
    random = np.random.default_rng(seed)
    matrix = sps.csc_matrix(np.round(random.normal(size=(m, n)), 2) * (random.random((m, n)) < 0.5))
    most, cost = random.normal(size=m) + 0.5, random.normal(size=n)
    found = least(cost, matrix, most, reach, solver, 10_000)
    expected = linprog(cost, A_ub=matrix, b_ub=most, bounds=(-reach, reach))
    assert (found is None) == (expected.x is None)
    if found is not None:
        assert cost @ found == pytest.approx(expected.fun, abs=1e-6)
        assert (matrix @ found <= most + 1e-6).all()
        assert np.abs(found).max() <= reach + 1e-9


def test_without_iterations_nothing_is_found() -> None:
    random = np.random.default_rng(1)
    matrix = sps.csc_matrix(random.normal(size=(60, 30)))
    assert least(random.normal(size=30), matrix, np.ones(60), 1.0, SIMPLEX, 1) is None
