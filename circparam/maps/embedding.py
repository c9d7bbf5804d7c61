"""A sheet on the sphere: its landmarks on a polyhedron, arcs along its edges, what lies between by Tutte's
theorem.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import FloatArray
from circparam.core.linalg import Factor
from circparam.maps.convex import row_weights
from circparam.maps.tracing import Tracer, shares


def embed(
    tracer: Tracer, ends: list[tuple[int, int]], corners: FloatArray, weights: str
) -> FloatArray:
    """(n, d) places of the vertices of a sheet, whose arcs cut it into triangles, on the polyhedron.

    corners (k, d): the landmarks (the unit vectors of k dimensions give barycentric coordinates). Each patch is
    a convex combination map onto a flat triangle, with its boundary by arc length: one system with three
    right-hand sides for all, since a patch is flat where its boundary is.
    """
    sheet = tracer.sheet
    out = np.zeros((sheet.n, corners.shape[1]))
    fixed = np.zeros(sheet.n, bool)
    for arc in range(0, len(ends), 2):
        path, t = tracer.arcs[arc], shares(tracer, tracer.arcs[arc])[:, None]
        begin, end = corners[list(ends[arc])]
        out[path] = (1 - t) * begin + t * end
        fixed[path] = True
    out[tracer.marks] = corners
    w = row_weights(sheet, weights)
    i, j = sheet.faces.ravel(), sheet.faces[:, [1, 2, 0]].ravel()
    free = ~fixed
    number = np.where(free, np.cumsum(free), np.cumsum(fixed)) - 1
    rows, inner = free[i], free[i] & free[j]
    n = int(free.sum())
    matrix = sps.identity(n, format="csr") - sps.csr_matrix(
        (w[inner], (number[i[inner]], number[j[inner]])), shape=(n, n)
    )
    border = rows & fixed[j]
    to_fixed = sps.csr_matrix(
        (w[border], (number[i[border]], number[j[border]])), shape=(n, int(fixed.sum()))
    )
    out[free] = Factor(matrix).solve(np.asarray(to_fixed @ out[fixed]))
    return out
