"""Convex combination maps: every free vertex is a weighted mean of its neighbours (Tutte, Floater)."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import FloatArray, IntArray, group_sum
from circparam.core.linalg import Factor
from circparam.maps.tracing import Tracer
from circparam.solvers.tutte.weights import WEIGHTS, half_edge_weights


def laid_in_polygons(
    tracer: Tracer, polygon: IntArray, arcs: list[list[int]], corners: FloatArray, weights: str
) -> FloatArray:
    """(m, 3, d) places of the corners of faces in flat convex polygons with corners (c, d).

    polygon (m,): that of each face, −1 if it lies in none and has no places. arcs: those round each polygon,
    laid along its sides by arc length; no polygon has a landmark twice. Inner vertices are one linear system.
    weights: row of WEIGHTS.
    """
    mesh = tracer.mesh
    flat, ends = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    key, known = _on_sides(tracer, arcs, corners)

    def around(corner: IntArray, vertex: IntArray) -> FloatArray:
        return known[np.searchsorted(key, polygon[corner // 3] * mesh.n + vertex)]

    of = np.repeat(polygon, 3)
    low, high = np.full(mesh.n, len(arcs)), np.full(mesh.n, -1)
    np.minimum.at(low, flat, of)
    np.maximum.at(high, flat, of)
    free = (low == high) & (high >= 0)
    free[tracer.marks] = False
    w = half_edge_weights(mesh.cut_mesh, WEIGHTS[weights].function)
    w = w / group_sum(w, flat, mesh.n)[flat]  # of sum 1 at each vertex
    inner, edge = (np.flatnonzero(free[flat] & (free[ends] == beside)) for beside in (True, False))
    number, n = np.cumsum(free) - 1, int(free.sum())
    rows, columns = number[flat[inner]], number[ends[inner]]
    means = sps.csr_matrix((w[inner], (rows, columns)), shape=(n, n))
    known_ends = around(edge, ends[edge]) * w[edge][:, None]
    pull = np.stack([group_sum(column, number[flat[edge]], n) for column in known_ends.T], 1)
    inside = Factor(sps.identity(n, format="csr") - means).solve(pull)
    places = np.zeros((len(flat), corners.shape[1]))
    use = free[flat]
    places[use] = inside[number[flat[use]]]
    on = np.flatnonzero(~use & (of >= 0))
    places[on] = around(on, flat[on])
    return places.reshape(-1, 3, corners.shape[1])


def _on_sides(
    tracer: Tracer, polygons: list[list[int]], corners: FloatArray
) -> tuple[IntArray, FloatArray]:
    """(keys polygon · n + vertex ascending, (k, d) places) of the vertices round polygons of arcs."""
    keys, places = [], []
    for number, arcs in enumerate(polygons):
        for arc, start, end in zip(arcs, corners, np.roll(corners, -1, 0), strict=True):
            path = tracer.arcs[arc]
            t = tracer.mesh.shares(path)[:, None]
            keys.append(number * tracer.mesh.n + path)
            places.append((1 - t) * start + t * end)
    key, first = np.unique(np.concatenate(keys), return_index=True)
    return key, np.concatenate(places)[first]
