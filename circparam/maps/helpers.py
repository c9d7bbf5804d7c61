"""Helpers: pairs of vertices far from all landmarks, so that no patch of a layout is much larger than the
others.

What lies far from every arc is crushed by a convex map. The vertex of a patch that is farthest from all
landmarks goes with the one on the other surface that is farthest among those in about the same place of the
patch. Helpers shape the layout only: relaxation moves them like any other vertex.
"""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.maps.embedding import embed
from circparam.maps.landmarks import Landmarks
from circparam.maps.layout import Layout
from circparam.maps.sides import Side
from circparam.maps.tracing import Tracer

FAR = 0.35  # distance from all landmarks, in roots of the area, from which on a patch gets a helper
SAME_PLACE = 0.15  # barycentric coordinates that differ by less are about the same place of a patch
ROUNDS = 3  # of layouts with more and more helpers
# Landmarks and helpers: the convex polyhedron of many is uneven, which costs more than large patches do.
MOST = 8


def add_helpers(layout: Layout, marks: Landmarks, a: Side, b: Side, method: str) -> bool:
    """Add a helper to every patch that is large (to all where there are three landmarks only); whether one
    was added.
    """
    needed = layout.k == 3
    if layout.k >= MOST:
        return False
    far = [tracer.from_landmarks() for tracer in layout.tracers]
    own = [tracer.regions(layout.regions()) for tracer in layout.tracers]
    scale = np.sqrt(a.area), np.sqrt(b.area)
    places: list[FloatArray] | None = None
    found = []
    for n, region in enumerate(layout.regions()):
        inside = [
            _inside(t, o == n, side.n)
            for t, o, side in zip(layout.tracers, own, (a, b), strict=True)
        ]
        if not len(inside[0]) or not len(inside[1]):
            continue
        most = max(float(far[k][inside[k]].max()) / scale[k] for k in (0, 1))
        if most < FAR and not needed:
            continue
        if places is None:
            places = [embed(t, layout.ends, np.eye(layout.k), method) for t in layout.tracers]
        corners = [layout.ends[arc][0] for arc in region]
        w = [places[k][inside[k]][:, corners] for k in (0, 1)]
        pair = _pair(w, [far[k][inside[k]] for k in (0, 1)])
        found.append((int(inside[0][pair[0]]), int(inside[1][pair[1]])))
    for u, v in found[: MOST - layout.k]:
        marks.add(u, v, False)
    return bool(found)


def _inside(tracer: Tracer, faces: IntArray, n: int) -> IntArray:
    """Vertices of the surface inside a patch without what closes a boundary."""
    sheet = tracer.sheet
    if (sheet.parent[faces] < 0).any():
        return np.zeros(0, np.int64)
    vertices = np.unique(sheet.faces[faces])
    out: IntArray = vertices[~tracer.on[vertices] & (vertices < n)]
    return out


def _pair(w: list[FloatArray], far: list[FloatArray]) -> tuple[int, int]:
    """Which vertices of a patch go together; w: their places in it, far: their distances from all landmarks."""
    first = int(far[0].argmax())
    near = np.abs(w[1] - w[0][first]).max(1) < SAME_PLACE
    if near.any():
        return first, int(np.where(near, far[1], -1).argmax())
    return int(w[0].min(1).argmax()), int(w[1].min(1).argmax())
