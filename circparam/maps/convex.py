"""Convex combination maps: every free vertex is a weighted mean of its neighbours (Tutte, Floater)."""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.linalg import Factor
from circparam.maps.closed_mesh import ClosedMesh
from circparam.maps.tracing import Tracer
from circparam.solvers.tutte.weights import WEIGHTS, half_edge_weights


def row_weights(mesh: ClosedMesh, weights: str) -> FloatArray:
    """(3m,) weights of all half-edges by a row of WEIGHTS, normalised to sum 1 at each vertex."""
    w = half_edge_weights(mesh.cut_mesh, WEIGHTS[weights].function)
    start = mesh.faces.ravel()
    result: FloatArray = w / group_sum(w, start, mesh.n)[start]
    return result


def combined(
    mesh: ClosedMesh, free: BoolArray, weights: FloatArray, known: Callable[[IntArray], FloatArray]
) -> FloatArray:
    """(k, d) places of the free vertices (n,) of a mesh, in their order.

    weights: (3m,) of the half-edges, see ``row_weights``. known: half-edges that leave free vertices → (h, d)
    the places of their ends, which are not free.
    """
    i, j = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    inner, edge = np.flatnonzero(free[i] & free[j]), np.flatnonzero(free[i] & ~free[j])
    number, n = np.cumsum(free) - 1, int(free.sum())
    matrix = sps.identity(n, format="csr") - sps.csr_matrix(
        (weights[inner], (number[i[inner]], number[j[inner]])), shape=(n, n)
    )
    value = known(edge) * weights[edge][:, None]
    b = np.stack([group_sum(column, number[i[edge]], n) for column in value.T], 1)
    return Factor(matrix).solve(b)


def laid_in_polygons(
    tracer: Tracer, polygon: IntArray, arcs: list[list[int]], corners: FloatArray, weights: str
) -> FloatArray:
    """(m, 3, d) places of the corners of faces in flat convex polygons with corners (c, d).

    polygon (m,): that of each face, −1 if it lies in none and has no places. arcs: those round each polygon,
    laid along its sides by arc length; no polygon has a landmark twice. Inner vertices are one linear system.
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
    inside = combined(mesh, free, row_weights(mesh, weights), lambda h: around(h, ends[h]))
    places = np.zeros((len(flat), corners.shape[1]))
    use = free[flat]
    places[use] = inside[(np.cumsum(free) - 1)[flat[use]]]
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
