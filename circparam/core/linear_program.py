"""Linear programs, by the HiGHS that SciPy holds (Huangfu and Hall 2018).

``scipy.optimize.linprog`` imports 120 modules and adds 3 ms to the time of the solver for each program.
"""

from typing import Any

import numpy as np
import scipy.sparse as sps

from circparam.core import clock
from circparam.core.imports import private
from circparam.core.types import FloatArray

INTERIOR, CHOOSE = "ipm", "choose"


def least(
    cost: FloatArray,
    matrix: sps.csc_matrix,
    most: FloatArray,
    reach: float | tuple[FloatArray, FloatArray],
    solver: str,
) -> FloatArray | None:
    """The x (n,) of least cost · x where matrix (m, n) @ x ≤ most (m,) and x lies within its bounds.

    reach: |x| ≤ reach, or the lower and the upper bounds (n,) of x. solver: INTERIOR, a point inside the set of
    all optimal ones, without presolving; what HiGHS chooses (CHOOSE), with it. None if nothing optimal was
    found, or not in the time that is left (``clock.bounded``).
    """
    seconds = clock.left()
    if seconds is not None and seconds <= 0:  # HiGHS takes 0 for no limit
        return None
    (m, n), highs = matrix.shape, private("scipy.optimize._highspy._core")
    lower, upper = reach if isinstance(reach, tuple) else (np.full(n, -reach), np.full(n, reach))
    if highs is None:
        from scipy.optimize import linprog

        method: Any = {INTERIOR: "highs-ipm", CHOOSE: "highs"}[solver]
        limits: Any = {"presolve": solver != INTERIOR}
        bounds = np.stack([lower, upper], 1)
        answer: Any = linprog(  # type: ignore[call-overload]
            cost, A_ub=matrix, b_ub=most, bounds=bounds, method=method, options=limits
        )
        x: FloatArray | None = answer.x if answer.status == 0 else None
        return x
    program: Any = highs.HighsLp()
    program.num_col_ = program.a_matrix_.num_col_ = n
    program.num_row_ = program.a_matrix_.num_row_ = m
    program.col_cost_ = cost
    program.col_lower_, program.col_upper_ = lower, upper
    program.row_lower_, program.row_upper_ = np.full(m, -highs.kHighsInf), most
    program.a_matrix_.format_ = highs.MatrixFormat.kColwise
    program.a_matrix_.start_ = matrix.indptr
    program.a_matrix_.index_ = matrix.indices
    program.a_matrix_.value_ = matrix.data
    options: Any = highs.HighsOptions()
    options.output_flag = options.log_to_console = False
    options.solver = solver
    if seconds is not None:
        options.time_limit = seconds
    if solver == INTERIOR:
        options.presolve = options.run_crossover = "off"
    run: Any = highs._Highs()
    run.passOptions(options)
    run.passModel(program)
    run.run()
    found = run.getModelStatus() == highs.HighsModelStatus.kOptimal
    return np.array(run.getSolution().col_value) if found else None
