"""Linear systems against dense solves, and where they stop; linear programs against those of SciPy."""

import time
from itertools import islice

import numpy as np
import pytest
import scipy.sparse as sps
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from circparam.core import clock
from circparam.core.arrays import FloatArray
from circparam.core.linalg import Factor, conjugate_gradients, gradient_iterates
from circparam.core.linear_program import CHOOSE, INTERIOR, least
from circparam.errors import NoResultError


def system(n: int, seed: int) -> tuple[sps.csr_matrix, FloatArray]:
    """A symmetric positive definite matrix and a right-hand side."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    return sps.csr_matrix(a @ a.T + np.eye(n)), rng.normal(size=n)


@pytest.mark.parametrize("seed", range(5))
def test_factors_solve(seed: int) -> None:
    matrix, b = system(12, seed)
    dense = matrix.toarray()
    assert np.allclose(dense @ Factor(matrix).solve(b), b)
    both = np.stack([b, 2 * b[::-1]], 1)
    assert np.allclose(dense @ Factor(matrix).solve(both), both)
    hermitian = sps.csc_matrix(dense + 1j * (np.triu(dense, 1) - np.triu(dense, 1).T))
    x = Factor(hermitian + 100 * sps.eye(12)).solve(b + 1j * b[::-1])
    assert np.allclose((hermitian + 100 * sps.eye(12)) @ x, b + 1j * b[::-1])


def test_no_unknowns_and_no_factorisation() -> None:
    matrix, _ = system(3, 0)
    assert Factor(matrix).solve(np.zeros((3, 0))).shape == (3, 0)
    with pytest.raises(NoResultError, match="2 unknowns"):
        Factor(sps.csc_matrix((2, 2)))


def test_it_stops_at_the_tolerance_or_the_limit() -> None:
    matrix, b = system(30, 4)
    iterates = list(islice(gradient_iterates(matrix, b, np.copy), 31))
    small = [k for k, i in enumerate(iterates) if not i.weight > 1e-2**2 * iterates[0].weight]
    got = conjugate_gradients(matrix, b, np.copy, 1e-2, 30)
    assert np.array_equal(got, iterates[small[0]].x), "the first iterate below the tolerance"
    assert small[0] > 3
    assert np.array_equal(conjugate_gradients(matrix, b, np.copy, 0.0, 3), iterates[3].x)
    assert np.array_equal(conjugate_gradients(matrix, b, np.copy, 0.0, 0), np.zeros(30))


def test_it_ends_where_the_curvature_is_not_positive() -> None:
    indefinite = sps.csr_matrix(np.diag([1.0, -1.0]))
    assert len(list(gradient_iterates(indefinite, np.array([0.0, 1.0]), np.copy))) == 1
    assert not conjugate_gradients(indefinite, np.array([0.0, 1.0]), np.copy, 1e-9, 5).any()
    flat = sps.csr_matrix((2, 2))
    assert len(list(gradient_iterates(flat, np.ones(2), np.copy))) == 1


@pytest.mark.parametrize("seed", range(3))
def test_conjugate_gradients_solve_from_any_start(seed: int) -> None:
    matrix, b = system(12, seed)
    start = np.random.default_rng(seed).normal(size=12)
    first = next(gradient_iterates(matrix, b, np.copy, start))
    np.testing.assert_allclose(first.residual, b - matrix @ start)
    x = conjugate_gradients(matrix, b, np.copy, 1e-12, 100, start)
    np.testing.assert_allclose(matrix @ x, b, atol=1e-8)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 12),
    m=st.integers(1, 30),
    reach=st.floats(0.1, 10),
)
@pytest.mark.parametrize("solver", [INTERIOR, CHOOSE])
def test_the_least_cost_is_that_of_scipy(solver, seed, n, m, reach):
    random = np.random.default_rng(seed)
    matrix = sps.csc_matrix(np.round(random.normal(size=(m, n)), 2) * (random.random((m, n)) < 0.5))
    most, cost = random.normal(size=m) + 0.5, random.normal(size=n)
    found = least(cost, matrix, most, reach, solver)
    expected = linprog(cost, A_ub=matrix, b_ub=most, bounds=(-reach, reach))
    assert (found is None) == (expected.x is None)
    if found is not None:
        assert cost @ found == pytest.approx(expected.fun, abs=1e-6)
        assert (matrix @ found <= most + 1e-6).all()
        assert np.abs(found).max() <= reach + 1e-6


@pytest.mark.parametrize("solver", [INTERIOR, CHOOSE])
def test_a_program_ends_with_the_time(solver) -> None:
    random = np.random.default_rng(1)
    matrix = sps.csc_matrix(random.normal(size=(60, 30)))
    program = random.normal(size=30), matrix, np.ones(60), 1.0, solver
    with clock.bounded(time.monotonic()):
        assert least(*program) is None
    assert least(*program) is not None


def test_an_interior_point_lies_inside_the_set_of_all_that_are_optimal() -> None:
    """Largest x with 0 ≤ y ≤ 1 whatever x is: y is at neither wall."""
    matrix = sps.csc_matrix([[0.0, 1.0], [0.0, -1.0]])
    x, y = least(np.array([-1.0, 0.0]), matrix, np.array([1.0, 0.0]), 3.0, INTERIOR)
    assert x == pytest.approx(3, abs=1e-6)
    assert 0.1 < y < 0.9
