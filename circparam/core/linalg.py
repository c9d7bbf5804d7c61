"""Sparse linear systems: factor once, solve many. The only place that knows which solver runs."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import scipy.sparse as sps
import scipy.sparse.linalg as sla

from circparam.core.arrays import ComplexArray, FloatArray
from circparam.errors import NoResultError

SparseMatrix: TypeAlias = (
    "sps.csr_matrix | sps.csc_matrix | sps.bsr_matrix | sps.csr_array | sps.csc_array"
)


class Factor:
    """A sparse LU factorisation with a symmetric fill-reducing order and diagonal pivots.

    matrix: square, structurally symmetric, with a dominant or positive definite diagonal (M-matrices of convex
    maps, Laplacians, projected Hessians): for these diagonal pivots are stable, and minimum degree on
    A + Aᵀ needs far less fill than the column order that SciPy takes by default.
    Raises NoResultError where the matrix is singular.
    """

    def __init__(self, matrix: SparseMatrix) -> None:
        try:
            self._lu = sla.splu(
                sps.csc_matrix(matrix),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except (RuntimeError, MemoryError) as error:
            raise NoResultError(
                f"a linear system of {matrix.shape[0]} unknowns has no factorisation ({error})"
            ) from error

    def solve(self, b: FloatArray) -> FloatArray:
        """x with matrix @ x = b; b is (n,) or (n, k), all columns solved with the one factorisation."""
        b = np.asarray(b, np.float64)
        if b.size == 0:
            return b.copy()
        result: FloatArray = self._lu.solve(np.asfortranarray(b))
        return result


class ComplexFactor(Factor):
    """The same factorisation of a Hermitian matrix: the plane as complex numbers, at half the size."""

    def solve_complex(self, b: ComplexArray) -> ComplexArray:
        """x with matrix @ x = b; b is (n,) or (n, k), complex."""
        if b.size == 0:
            return b.copy()
        x = self._lu.solve(np.asfortranarray(b, np.complex128))
        return np.asarray(x, np.complex128)


def solve(matrix: SparseMatrix, b: FloatArray) -> FloatArray:
    """Factor and solve once."""
    return Factor(matrix).solve(b)
