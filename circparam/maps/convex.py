"""Convex combination maps: every free vertex is a weighted mean of its neighbours (Tutte, Floater)."""

import numpy as np

from circparam.core.linalg import Factor
from circparam.core.types import FloatArray, IntArray
from circparam.maps.tracing import Tracer
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.tutte.embed import assemble
from circparam.solvers.tutte.weights import WEIGHTS, half_edge_weights


def laid_in_polygons(
    tracer: Tracer, polygon: IntArray, arcs: list[list[int]], corners: FloatArray, weights: str
) -> FloatArray:
    """(m, 3, d) places of the corners of faces in flat convex polygons with corners (c, d).

    polygon (m,): that of each face, −1 if it lies in none and has no places. arcs: those round each polygon,
    laid along its sides by arc length; no polygon has a landmark twice. Inner vertices are one linear system.
    weights: row of WEIGHTS.
    """
    mesh, own = tracer.mesh, np.flatnonzero(polygon >= 0)
    # a vertex between two polygons has a place in each
    labels = polygon[own][:, None] * mesh.n + mesh.faces[own]
    key, faces = np.unique(labels, return_inverse=True)
    part = CutMesh(
        faces.reshape(-1, 3),
        mesh.cut_mesh.rest_triangles[own],
        polygon[own],
        np.zeros((0, 2), np.int64),
    )
    w = half_edge_weights(mesh.cut_mesh, WEIGHTS[weights].function).reshape(-1, 3)[own]
    side, along = _on_sides(tracer, arcs, corners)
    places = np.zeros((len(key), corners.shape[1]))
    free = np.ones(len(key), bool)
    at = np.searchsorted(key, side)
    places[at], free[at] = along, False
    matrix, to_fixed = assemble(part, w.ravel(), free)
    places[free] = Factor(matrix).solve(to_fixed @ places[~free])
    out = np.zeros((len(mesh.faces), 3, corners.shape[1]))
    out[own] = places[part.faces]
    return out


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
