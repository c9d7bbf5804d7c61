"""Straighter arcs: two patches at a time are mapped onto a square, and its diagonal becomes the arc between
them.

A shortest path along edges zigzags, and a patch whose boundary zigzags is sheared where it is laid straight.
The diagonal of a convex map runs over the surface as smoothly as the map is; edges are split where it crosses
them.
"""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import IntArray, next_half_edge
from circparam.maps.convex import laid_in_polygons
from circparam.maps.layout import Layout
from circparam.maps.tracing import Tracer

SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
LEAST_SHARE = 0.05  # of an edge: how near to its ends it is split
BESIDE = 1e-6  # sides of the square that an arc runs beside the diagonal: on it lie vertices of regular meshes


def straighten(layout: Layout, weights: str, first: int) -> None:
    """Replace the arcs from number ``first`` on by diagonals, on both meshs, in place."""
    for arcs in _rounds(layout, first):
        for tracer in layout.tracers:
            _lay_diagonals(tracer, layout, arcs, weights)
            tracer.split_chords()


def _rounds(layout: Layout, first: int) -> list[list[int]]:
    """Arcs to replace together: of each region one at most, and only between regions that make a
    quadrilateral.
    """
    region_of = {arc: n for n, r in enumerate(layout.regions()) for arc in r}
    corners = {
        arc: {layout.ends[side][0] for side in _sides(layout, arc)}
        for arc in range(first, len(layout.ends), 2)
    }
    left = [arc for arc, own in corners.items() if len(own) == 4]
    out = []
    while left:
        taken: set[int] = set()
        now = []
        for arc in left:
            pair = {region_of[arc], region_of[arc ^ 1]}
            if not pair & taken:
                taken |= pair
                now.append(arc)
        out.append(now)
        left = [arc for arc in left if arc not in now]
    return out


def _lay_diagonals(tracer: Tracer, layout: Layout, arcs: list[int], weights: str) -> None:
    """Replace some arcs of one mesh, whose pairs of patches do not touch each other."""
    mesh, n = tracer.mesh, tracer.mesh.n
    regions = layout.regions()
    region_of = {arc: k for k, r in enumerate(regions) for arc in r}
    name = np.full(len(regions), -1)
    for number, arc in enumerate(arcs):
        name[[region_of[arc], region_of[arc ^ 1]]] = number
    of_face = name[tracer.regions(regions)]
    sides = [_sides(layout, arc) for arc in arcs]
    uv = laid_in_polygons(tracer, of_face, sides, SQUARE, weights).reshape(-1, 2)
    h = np.flatnonzero((of_face >= 0).repeat(3))
    h = h[(h < mesh.twin[h]) & (of_face[mesh.twin[h] // 3] == of_face[h // 3])]
    ahead = next_half_edge(h)
    a, b = mesh.faces.ravel()[h], mesh.faces.ravel()[ahead]
    side_a, side_b = (uv[k, 0] - uv[k, 1] - BESIDE for k in (h, ahead))
    ends = tracer.marks[np.array([layout.ends[arc] for arc in arcs])][of_face[h // 3]]
    cross = (
        ((side_a > 0) != (side_b > 0)) & (a[:, None] != ends).all(1) & (b[:, None] != ends).all(1)
    )
    t = (side_a / np.where(cross, side_a - side_b, 1.0))[cross]
    h, ahead, low, high = h[cross], ahead[cross], np.minimum(a, b)[cross], np.maximum(a, b)[cross]
    along = ((1 - t)[:, None] * uv[h] + t[:, None] * uv[ahead]).sum(1)
    marked, share = np.zeros(len(uv), bool), np.full(len(uv), 0.5)
    marked[h] = marked[mesh.twin[h]] = True
    share[h] = np.clip(t, LEAST_SHARE, 1 - LEAST_SHARE)
    share[mesh.twin[h]] = 1 - share[h]
    new, middle = mesh.split(marked, share)
    tracer.renew(new)
    vertex = middle[np.searchsorted(middle[:, 0], low * n + high), 1]
    order = np.lexsort((along, of_face[h // 3]))
    for number, arc in enumerate(arcs):
        own = order[of_face[h[order] // 3] == number]
        i, j = tracer.marks[list(layout.ends[arc])]
        path = np.concatenate([[i], vertex[own], [j]])
        if (new.half_edges(path[:-1], path[1:]) < 0).any():
            path = _with_middles(tracer.arcs[arc], middle, n)
        tracer.replace(arc, path, *layout.ends[arc])
    tracer.mark_arcs()


def _sides(layout: Layout, arc: int) -> list[int]:
    """The arcs round the two regions of an arc, counter-clockwise from its start, the right one first."""
    right, left = layout.after(arc ^ 1), layout.after(arc)
    return [right, layout.after(right), left, layout.after(left)]


def _with_middles(path: IntArray, middle: IntArray, n: int) -> IntArray:
    """A path after some of its edges were split; middle: as ``ClosedMesh.split`` returns it."""
    low, high = np.minimum(path[:-1], path[1:]), np.maximum(path[:-1], path[1:])
    out = np.full(2 * len(path) - 1, -1)
    out[::2] = path
    if len(middle):
        at = np.minimum(np.searchsorted(middle[:, 0], low * n + high), len(middle) - 1)
        found = middle[at, 0] == low * n + high
        out[1::2][found] = middle[at[found], 1]
    result: IntArray = out[out >= 0]
    return result
