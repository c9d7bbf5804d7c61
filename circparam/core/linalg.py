"""Sparse linear systems: factor once, solve many; conjugate gradients. Only this module knows the solver."""

from collections.abc import Callable, Iterator
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import dot
from circparam.core.clock import tick
from circparam.core.compiled import gstrf
from circparam.core.types import BoolArray, ComplexArray, FloatArray, IntArray
from circparam.errors import NoResultError

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

SparseMatrix: TypeAlias = (
    "sps.csr_matrix | sps.csc_matrix | sps.bsr_matrix | sps.csr_array | sps.csc_array"
)
_Values = TypeVar("_Values", FloatArray, ComplexArray)


class Factor:
    """A sparse LU factorisation with a symmetric fill-reducing order and diagonal pivots.

    matrix: square, structurally symmetric, with a dominant or positive definite diagonal (M-matrices of convex
    maps, Laplacians, projected Hessians). Diagonal pivots are stable for these. Minimum degree on A + Aᵀ needs
    far less fill than SciPy's default column order. ordered: the rows are in an order that fills little
    already. Raises NoResultError if the matrix is singular, OutOfTimeError past the last moment
    (``core.clock``).
    """

    def __init__(self, matrix: SparseMatrix, ordered: bool = False) -> None:
        tick()
        columns = matrix if isinstance(matrix, sps.csc_matrix) else sps.csc_matrix(matrix)
        try:
            self._lu = _superlu(columns, "NATURAL" if ordered else "MMD_AT_PLUS_A")
        except (RuntimeError, MemoryError) as error:
            raise NoResultError(
                f"a linear system of {matrix.shape[0]} unknowns has no factorisation ({error})"
            ) from error

    @property
    def position(self) -> IntArray:
        """(n,) when each row was eliminated."""
        return np.asarray(self._lu.perm_c, np.int64)

    def solve(self, b: _Values) -> _Values:
        """x with matrix @ x = b; b is (n,) or (n, k), all columns solved with the one factorisation.

        Real or complex, as the matrix is.
        """
        b = np.asarray(b, np.complex128 if np.iscomplexobj(b) else np.float64)
        solved: Any = self._lu.solve(np.asfortranarray(b)) if b.size else b.copy()
        return solved


def _superlu(matrix: sps.csc_matrix, order: str) -> "SuperLU":
    """As ``scipy.sparse.linalg.splu`` with diagonal pivots, which would import 80 modules."""
    n = matrix.shape[0]
    panel = 1  # column by column: a quarter less time than in panels at 200 to 100,000 unknowns
    if gstrf is None:
        from scipy.sparse.linalg import splu

        columns: Any = order
        return splu(matrix, columns, 0.0, None, panel, {"SymmetricMode": True})
    matrix.sum_duplicates()
    arrays = matrix.data, matrix.indices.astype(np.intc), matrix.indptr.astype(np.intc)
    options = {"ColPerm": order, "DiagPivotThresh": 0.0, "PanelSize": panel, "Relax": None}
    known = {"csc_construct_func": sps.csc_matrix, "ilu": False}
    return gstrf(n, matrix.nnz, *arrays, **known, options={**options, "SymmetricMode": True})


class HeldFactor:
    """The factorisation of a system with some of the unknowns given.

    matrix: (n, n). held: those unknowns, (n,) bool or (k,) numbers.
    """

    def __init__(self, matrix: SparseMatrix, held: BoolArray | IntArray) -> None:
        self.held, self.free = held, np.ones(matrix.shape[0], bool)
        self.free[held] = False
        self._rows = sps.csr_matrix(matrix)[self.free]
        self._factor = Factor(self._rows[:, self.free])

    @cached_property
    def _from_held(self) -> sps.csr_matrix:
        return self._rows[:, self.held]

    def solve(self, b: _Values, given: _Values | None = None) -> _Values:
        """x (n, ...) with matrix @ x = b but for the rows of those ``given`` (k, ...); None: zeros."""
        x, right = np.zeros_like(b), b[self.free]
        if given is not None:
            x[self.held] = given
            right = right - self._from_held @ given
        x[self.free] = self._factor.solve(right)
        return x


class Iterate(NamedTuple):
    """One iterate of conjugate gradients: x, its residual b − A x, and rᵀ M⁻¹ r (positive until solved)."""

    x: FloatArray
    residual: FloatArray
    weight: float


def gradient_iterates(
    matrix: SparseMatrix,
    b: FloatArray,
    precondition: Callable[[FloatArray], FloatArray],
    start: FloatArray | None = None,
) -> Iterator[Iterate]:
    """The iterates of preconditioned conjugate gradients (Hestenes and Stiefel 1952), the start first.

    matrix: (n, n) symmetric. b: (n,). precondition: r → M⁻¹ r, symmetric positive definite. start: (n,), zero
    where None. Ends at a direction without positive curvature; the caller decides when an iterate is accurate
    enough. Inner products do not depend on the number of threads (``dot``).
    """
    x = np.zeros_like(b) if start is None else start
    r = b.copy() if start is None else b - matrix @ x
    z = precondition(r)
    p, weight = z, dot(r, z)
    yield Iterate(x, r, weight)
    while True:
        q = matrix @ p
        curvature = dot(p, q)
        if not curvature > 0:
            return
        alpha = weight / curvature
        x = x + alpha * p
        r = r - alpha * q
        z = precondition(r)
        weight, last = dot(r, z), weight
        yield Iterate(x, r, weight)
        p = z + (weight / last) * p


def conjugate_gradients(
    matrix: SparseMatrix,
    b: FloatArray,
    precondition: Callable[[FloatArray], FloatArray],
    tolerance: float,
    limit: int,
    start: FloatArray | None = None,
) -> FloatArray:
    """Approximate x with matrix @ x = b; from zero every iterate is a descent direction of ½ xᵀAx − bᵀx.

    tolerance: factor by which the residual shrinks, in the norm of the preconditioner. limit: most steps.
    start: see ``gradient_iterates``.
    """
    best, first = np.zeros_like(b), np.inf
    iterates = islice(gradient_iterates(matrix, b, precondition, start), limit + 1)
    for k, (x, _, weight) in enumerate(iterates):
        best = x
        if k == 0:
            first = weight
        elif not weight > tolerance**2 * first:
            break
    return best
