"""Places that a layout stretches too much, cut out along the shortest loop: a finger tip, a spire, a dent."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.graph import components, nearest, undirected
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.overlap_cut import minimum_cut
from circparam.seams.segmentation.shorten import edge_costs

GAP = 0.5  # of the side of a square that holds the share allowed: faces nearer than that are one place
REACH = 1.0  # root of its stretched area beyond which the loop round a place does not lie
REST = 1.5  # times the share allowed: what weights are left with
PLACES = 8  # more than that are no tips, but a surface that is curved all over
LARGEST = 0.1  # share of the surface beyond which a place is no tip


def cut_tips(atlas: Atlas, graph: DualGraph, far: BoolArray, allowed: float) -> BoolArray:
    """Cut out the places where faces are stretched too much ((m,) bool); returns the faces within ((m,) bool).

    allowed: share of the surface that may stay so. Faces near each other are one place; the smallest places are
    left, as many as REST times the share holds. Where still more than PLACES are left, nothing is cut. The loop
    round a place is the cheapest one between its faces and what lies some way from it: one minimum cut for all.
    """
    surface = atlas.surface
    total = float(surface.areas.sum())
    side = float(np.sqrt(allowed * total))
    inner = ~atlas.cut
    links = undirected(graph.n, graph.tail[inner], graph.head[inner], graph.step[inner])
    place, size = _places(graph, inner, links, far, surface.areas, GAP * side)
    none = np.zeros(len(far), bool)
    share = size / total
    order = np.argsort(share, kind="stable")
    chosen = order[np.cumsum(share[order]) > REST * allowed]
    if not 0 < len(chosen) <= PLACES:
        return none
    taken = np.zeros(len(size), bool)
    taken[chosen] = True
    core = (place >= 0) & taken[np.maximum(place, 0)]
    reach = GAP * side + REACH * np.sqrt(size)
    distance, _, source = nearest(links, np.flatnonzero(core), float(reach[taken].max()))
    near = (source >= 0) & np.isfinite(distance)
    near[near] = distance[near] <= reach[place[source[near]]]
    cells = minimum_cut(graph, inner, edge_costs(atlas), np.flatnonzero(core), near)
    within: BoolArray = cells[graph.cell]
    if surface.areas[within].sum() > LARGEST * total:
        return none
    atlas.cut |= inner & (cells[graph.tail] != cells[graph.head])
    return within


def _places(
    graph: DualGraph,
    inner: BoolArray,
    links: object,
    far: BoolArray,
    areas: FloatArray,
    gap: float,
) -> tuple[IntArray, FloatArray]:
    """((cells,) place of each cell that holds a stretched face, else −1; (places,) their stretched area)."""
    cell = np.unique(graph.cell[far])
    distance, _, source = nearest(links, cell, gap / 2)  # type: ignore[arg-type]
    a, b = graph.tail[inner], graph.head[inner]
    met = (source[a] >= 0) & (source[b] >= 0)
    met[met] = (distance[a] + graph.step[inner] + distance[b])[met] <= gap
    _, label = components(graph.n, source[a[met]], source[b[met]])
    place = np.full(graph.n, -1)
    _, place[cell] = np.unique(label[cell], return_inverse=True)
    size = group_sum(areas[far], place[graph.cell[far]], int(place.max()) + 1)
    return place, size
