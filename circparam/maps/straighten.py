"""Straighter arcs: two patches at a time are mapped onto a square, and its diagonal becomes the arc between
them.

A shortest path along edges zigzags, and a patch whose boundary zigzags is sheared where it is laid straight.
The diagonal of a convex map runs over the surface as smoothly as the map is; edges are split where it crosses
them.
"""

import numpy as np

from circparam.core.arrays import next_half_edge
from circparam.maps.convex import laid_in_polygons
from circparam.maps.layout import Layout
from circparam.maps.tracing import Tracer

SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
LEAST_SPLIT_SHARE = 0.05  # of an edge, that a split keeps from its ends
DIAGONAL_OFFSET = 1e-6  # of the square: vertices of regular meshes lie on the diagonal


def straighten(layout: Layout, weights: str, first: int) -> None:
    """Replace the arcs from number ``first`` on by diagonals, on both meshes, in place."""
    for arcs in _rounds(layout, first):
        for tracer in layout.tracers:
            _lay_diagonals(tracer, layout, arcs, weights)
            tracer.split_chords()


def _rounds(layout: Layout, first: int) -> list[list[int]]:
    """Arcs to replace together: of each region one at most, and only between regions that make a
    quadrilateral."""
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
    mesh = tracer.mesh
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
    following = next_half_edge(h)
    a, b = mesh.faces.ravel()[h], mesh.faces.ravel()[following]
    side_a, side_b = (uv[k, 0] - uv[k, 1] - DIAGONAL_OFFSET for k in (h, following))
    ends = tracer.marks[np.array([layout.ends[arc] for arc in arcs])][of_face[h // 3]]
    cross = (
        ((side_a > 0) != (side_b > 0)) & (a[:, None] != ends).all(1) & (b[:, None] != ends).all(1)
    )
    t = (side_a / np.where(cross, side_a - side_b, 1.0))[cross]
    h, following = h[cross], following[cross]
    along = ((1 - t)[:, None] * uv[h] + t[:, None] * uv[following]).sum(1)
    new, middle = mesh.split(h, np.clip(t, LEAST_SPLIT_SHARE, 1 - LEAST_SPLIT_SHARE))
    tracer.renew(new)
    split_by = np.full(len(uv), -1)
    split_by[h] = split_by[mesh.twin[h]] = middle
    order = np.lexsort((along, of_face[h // 3]))
    for number, arc in enumerate(arcs):
        own = order[of_face[h[order] // 3] == number]
        i, j = tracer.marks[list(layout.ends[arc])]
        path = np.concatenate([[i], middle[own], [j]])
        # the old path, with the vertices that split it
        if (new.half_edges(path[:-1], path[1:]) < 0).any():
            old = tracer.arcs[arc]
            between = split_by[mesh.half_edges(old[:-1], old[1:])]
            path = np.stack([old, np.r_[between, -1]], 1).ravel()
            path = path[path >= 0]
        tracer.lay(arc, path)


def _sides(layout: Layout, arc: int) -> list[int]:
    """The arcs round the two regions of an arc, counter-clockwise from its start, the right one first."""
    right, left = layout.after(arc ^ 1), layout.after(arc)
    return [right, layout.after(right), left, layout.after(left)]
