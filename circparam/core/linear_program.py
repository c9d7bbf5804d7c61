"""Linear programs, by the HiGHS that SciPy holds (Huangfu and Hall 2018).

``scipy.optimize.linprog`` imports 120 modules for it and takes 3 ms a program besides what the solver takes.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import FloatArray
from circparam.core.imports import alone
from circparam.core.records import dataclass

SIMPLEX, INTERIOR = "simplex", "ipm"


@dataclass(frozen=True, eq=False)
class Solved:
    """x: (n,), None if nothing optimal was found. stalled: all iterations were used up."""

    x: FloatArray | None
    stalled: bool


def least(
    cost: FloatArray,
    matrix: sps.csc_matrix,
    most: FloatArray,
    reach: float,
    solver: str,
    iterations: int,
) -> Solved:
    """Minimise cost · x (n,) where matrix (m, n) @ x ≤ most (m,) and |x| ≤ reach.

    solver: SIMPLEX, without presolving, or INTERIOR points, with it. iterations: of the solver at most.
    """
    highs = _highs()
    if highs is None:
        return _by_scipy(cost, matrix, most, reach, solver, iterations)
    (m, n), free = matrix.shape, highs.kHighsInf
    program: Any = highs.HighsLp()
    program.num_col_ = program.a_matrix_.num_col_ = n
    program.num_row_ = program.a_matrix_.num_row_ = m
    program.col_cost_ = cost
    program.col_lower_, program.col_upper_ = np.full(n, -reach), np.full(n, reach)
    program.row_lower_, program.row_upper_ = np.full(m, -free), most
    program.a_matrix_.format_ = highs.MatrixFormat.kColwise
    program.a_matrix_.start_ = matrix.indptr
    program.a_matrix_.index_ = matrix.indices
    program.a_matrix_.value_ = matrix.data
    options: Any = highs.HighsOptions()
    options.output_flag = options.log_to_console = False
    options.solver, options.presolve = solver, "on" if solver == INTERIOR else "off"
    options.simplex_iteration_limit = options.ipm_iteration_limit = iterations
    run: Any = highs._Highs()
    run.passOptions(options)
    run.passModel(program)
    run.run()
    status = run.getModelStatus()
    found = status == highs.HighsModelStatus.kOptimal
    x = np.array(run.getSolution().col_value) if found else None
    return Solved(x, status == highs.HighsModelStatus.kIterationLimit)


@cache
def _highs() -> Any:
    """The module of the solver; None before SciPy 1.15, which has another one."""
    try:
        with alone("scipy.optimize"):
            from scipy.optimize._highspy import _core  # type: ignore[import-not-found]
    except ImportError:
        return None
    return _core


def _by_scipy(
    cost: FloatArray,
    matrix: sps.csc_matrix,
    most: FloatArray,
    reach: float,
    solver: str,
    iterations: int,
) -> Solved:
    """As ``least``, with all versions of SciPy."""
    from scipy.optimize import linprog

    method: Any = "highs-ds" if solver == SIMPLEX else "highs-ipm"
    options: Any = {"presolve": solver == INTERIOR, "maxiter": iterations}
    answer: Any = linprog(  # type: ignore[call-overload]
        cost, A_ub=matrix, b_ub=most, bounds=(-reach, reach), method=method, options=options
    )
    return Solved(answer.x, answer.status == 1)
