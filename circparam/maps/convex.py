"""Convex combinations over a sheet: every free vertex a weighted mean of its neighbours, one sparse system."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.linalg import Factor
from circparam.errors import NoResultError
from circparam.maps.sheet import Sheet
from circparam.solvers.tutte.weights import WEIGHTS, half_edge_weights


def row_weights(sheet: Sheet, weights: str) -> FloatArray:
    """(3m,) weights of all half-edges of a row of WEIGHTS, those that leave a vertex of sum 1."""
    w = half_edge_weights(sheet.cut_mesh, WEIGHTS[weights].function)
    start = sheet.faces.ravel()
    result: FloatArray = w / group_sum(w, start, sheet.n)[start]
    return result


def combined(
    sheet: Sheet, free: BoolArray, weights: FloatArray, known: Callable[[IntArray], FloatArray]
) -> FloatArray:
    """(k, d) places of the free vertices (n,) of a sheet, in their order.

    weights: (3m,) of the half-edges, see ``row_weights``. known: half-edges that leave free vertices → (h, d)
    the places of their ends, which are not free.
    """
    i, j = sheet.faces.ravel(), sheet.faces[:, [1, 2, 0]].ravel()
    inner, edge = np.flatnonzero(free[i] & free[j]), np.flatnonzero(free[i] & ~free[j])
    number, n = np.cumsum(free) - 1, int(free.sum())
    matrix = sps.identity(n, format="csr") - sps.csr_matrix(
        (weights[inner], (number[i[inner]], number[j[inner]])), shape=(n, n)
    )
    value = known(edge) * weights[edge][:, None]
    b = np.stack([group_sum(column, number[i[edge]], n) for column in value.T], 1)
    return Factor(matrix).solve(b)


def refuse_crushed(faces: int) -> None:
    """Raise NoResultError where faces of a convex map are turned over all the same: crushed by rounding."""
    if faces:
        raise NoResultError(
            f"{faces} faces are crushed between landmarks beyond double precision: "
            "give a landmark at the end of every long thin part"
        )
