"""A sheet cut into triangular patches by arcs, every patch laid on one triangle by a convex combination map."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.maps.convex import combined, row_weights
from circparam.maps.tracing import Tracer, shares


def laid_in_patches(tracer: Tracer, regions: IntArray, weights: str) -> tuple[IntArray, FloatArray]:
    """(patch (m,) of each face, places (m, 3, 3): barycentric coordinates of its corners in the triangle).

    regions (r, 3): the arcs round each patch, which lies on their left; no patch has a landmark twice.
    Vertices on arcs lie by arc length; what lies inside is one linear system for all patches.
    """
    sheet = tracer.sheet
    n, flat = sheet.n, sheet.faces.ravel()
    patch = tracer.regions(regions.tolist())
    key, known = _on_arcs(tracer, regions)
    free = ~tracer.on
    ends = sheet.faces[:, [1, 2, 0]].ravel()

    def around(corner: IntArray, vertex: IntArray) -> FloatArray:
        return known[np.searchsorted(key, patch[corner // 3] * n + vertex)]

    w = row_weights(sheet, weights)
    inside = combined(sheet, free, w, lambda h: around(h, ends[h]))
    places = np.empty((len(flat), 3))
    use = free[flat]
    places[use] = inside[(np.cumsum(free) - 1)[flat[use]]]
    on = np.flatnonzero(~use)
    places[on] = around(on, flat[on])
    return patch, places.reshape(-1, 3, 3)


def _on_arcs(tracer: Tracer, regions: IntArray) -> tuple[IntArray, FloatArray]:
    """(keys patch · n + vertex ascending, (k, 3) places) of the vertices round every patch."""
    n = tracer.sheet.n
    keys, places = [], []
    corner = np.eye(3)
    for number, arcs in enumerate(regions.tolist()):
        for k, arc in enumerate(arcs):
            path = tracer.arcs[arc]
            t = shares(tracer, path)[:, None]
            keys.append(number * n + path)
            places.append((1 - t) * corner[k] + t * corner[(k + 1) % 3])
    key, index = np.unique(np.concatenate(keys), return_index=True)
    return key, np.concatenate(places)[index]
