"""Split charts that overlap themselves: shortest cuts between layers that lie on each other, or are flipped."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    SLICE_ROWS,
    cross2,
    first_of_groups,
    group_max,
    group_sum,
    mask_of,
    positions_in,
    sorted_distinct,
)
from circparam.core.compiled import breadth_first_order, maximum_flow
from circparam.core.graph import components, matching, nearest, undirected
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.boundary import boundary_in
from circparam.geometry.intersect import windings
from circparam.geometry.overlap import crossings
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.layout import ChartLayouts
from circparam.solvers.untangle import flipped

SHARE = 0.5  # of the way to the far end of a doubled part that comes back on itself
NEAR = 4.0  # times the root of a part's area: how far from it its cut may run
# capacity of an edge that must not be cut: residuals, at most twice that, are whole numbers of 32 bits
WALL = float(np.iinfo(np.int32).max // 2)
CAPACITY = float(np.sqrt(WALL))  # of an edge of mean cost: shares are as fine as sums are large


def split_layers(
    atlas: Atlas,
    graph: DualGraph,
    layouts: ChartLayouts,
    which: BoolArray,
    cost: FloatArray,
) -> BoolArray:
    """Cut charts along the cheapest seams round their flipped parts, or between parts that lie on each other.

    which: (n,) bool charts. cost: (e,) of every edge. Returns (n,) bool, the charts that were cut: the others
    have no two parts that lie on each other without touching.
    """
    done = np.zeros(len(which), bool)
    if not which.any():
        return done
    chart, left = layouts.cut_mesh.chart, atlas.surface.sides[0]
    inner = ~atlas.cut & which[chart[left]]
    upright = np.isfinite(layouts.energy)
    part, sink = _layers(graph, inner, layouts, which & upright)
    wrong = mask_of(graph.n, graph.cell[_flipped(layouts, which & ~upright)])
    use = inner & wrong[graph.tail] & wrong[graph.head]
    _, apart = components(graph.n, graph.tail[use], graph.head[use])
    part = _widened(graph, inner, np.where(wrong, 1 + part.max() + apart, part), sink)
    source = np.flatnonzero(part >= 0)
    if len(source) == 0:
        return done
    # what lies far from a part stays with the rest
    area = group_sum(layouts.cut_mesh.areas, graph.cell, graph.n)[source]
    reach = NEAR * np.sqrt(group_sum(area, part[source], 1 + int(part.max())))
    links = undirected(graph.n, graph.tail[inner], graph.head[inner], graph.step[inner])
    distance, _, owner = nearest(links, source, float(reach.max()))
    near = (owner >= 0) & (distance <= reach[part[np.maximum(owner, 0)]]) & ~sink
    side = minimum_cut(graph, inner, cost, source, near)
    new = inner & (side[graph.tail] != side[graph.head])
    atlas.cut |= new
    done[chart[left[new]]] = True
    return done


def _flipped(layouts: ChartLayouts, which: BoolArray) -> IntArray:
    """Flipped faces of charts ((n,) bool)."""
    p = layouts.cut_mesh
    faces = np.flatnonzero(which[p.chart])
    return faces[flipped(p.faces[faces], layouts.uv)]


def _doubled(layouts: ChartLayouts, which: BoolArray) -> tuple[IntArray, FloatArray]:
    """(faces (k,) of charts ((n,) bool), a point (k, 2) of each that its chart covers more than once)."""
    p = layouts.cut_mesh
    faces = np.flatnonzero(which[p.chart])
    boundary = boundary_in(p, layouts.uv)
    corners = layouts.uv[p.faces[faces]]
    middle = corners.mean(1)
    points = np.concatenate(
        [middle[:, None], middle[:, None] + 0.95 * (corners - middle[:, None])], 1
    )
    layers = windings(boundary, points.reshape(-1, 2), np.repeat(p.chart[faces], 4)).reshape(-1, 4)
    best = layers.argmax(1)
    rows = np.arange(len(faces))
    twice = layers[rows, best] > 1
    return faces[twice], points[rows, best][twice]


def _layers(
    graph: DualGraph, inner: BoolArray, layouts: ChartLayouts, which: BoolArray
) -> tuple[IntArray, BoolArray]:
    """((cells,) number of the doubled part of a chart that each is in, −1 for none; (cells,) bool: it is in
    what lies on such a part).

    inner: (e,) bool edges inside charts. which: (n,) bool charts. Of two parts that lie on each other the
    smaller is numbered. Where both are one (a sheet that comes back on itself), they are near its ends.
    """
    p, none = layouts.cut_mesh, (np.full(graph.n, -1), np.zeros(graph.n, bool))
    doubled, point = _doubled(layouts, which)
    crossing = _crossings(layouts, which)
    faces = np.r_[doubled, np.setdiff1d(crossing, doubled)]
    if len(faces) == 0:
        return none
    inside = mask_of(graph.n, graph.cell[faces])
    use = inner & inside[graph.tail] & inside[graph.head]
    _, part = components(graph.n, graph.tail[use], graph.head[use])
    _, sheet = np.unique(part[graph.cell[faces]], return_inverse=True)
    sheet = sheet.reshape(-1)
    area = group_sum(p.areas[faces], sheet, int(sheet.max()) + 1)
    probe, cover = _covers(layouts, doubled, sheet[: len(doubled)], point)
    place = positions_in(len(p.faces), faces)[crossing]
    probe, cover = np.r_[probe, place[:, 0]], np.r_[cover, place[:, 1]]
    # disjoint pairs of parts, the largest first
    pick = matching(
        np.minimum(area[sheet[probe]], area[sheet[cover]]), sheet[probe], sheet[cover], len(area)
    )
    probe, cover = probe[pick], cover[pick]
    swap = area[sheet[probe]] > area[sheet[cover]]
    probe, cover = np.where(swap, cover, probe), np.where(swap, probe, cover)
    first, second = graph.cell[faces[probe]], graph.cell[faces[cover]]
    distinct = first != second
    first, second, probe, cover = (x[distinct] for x in (first, second, probe, cover))
    if len(first) == 0:
        return none
    links = undirected(graph.n, graph.tail[use], graph.head[use], graph.step[use])
    distance, _, owner = nearest(links, sorted_distinct(np.r_[first, second]))
    same = sheet[probe] == sheet[cover]
    reach = np.full(graph.n, np.inf)
    found = owner >= 0
    span = group_max(distance[found], owner[found], graph.n)
    half = SHARE * np.maximum(span[first[same]], span[second[same]])
    reach[first[same]] = reach[second[same]] = half
    owner = np.where(found & (distance <= reach[np.maximum(owner, 0)]), owner, -1)
    sink = (owner >= 0) & mask_of(graph.n, second)[owner]
    number = np.r_[positions_in(graph.n, first), -1][owner]
    return np.where(sink, -1, number), sink


def _crossings(layouts: ChartLayouts, which: BoolArray) -> IntArray:
    """(k, 2) faces of charts ((n,) bool) whose sides cross: they may share too little for a point of either."""
    found = crossings(layouts.uv, layouts.cut_mesh, which) // 3
    return found[found[:, 0] != found[:, 1]]


def _covers(
    layouts: ChartLayouts, faces: IntArray, sheet: IntArray, point: FloatArray
) -> tuple[IntArray, IntArray]:
    """The largest face of every part, and the largest other face of its chart that covers its doubled point.

    faces, sheet, point: (k,) doubled faces, their part, a doubled point of each. Returns places in these; parts
    whose point no other doubled face covers are left out.
    """
    p = layouts.cut_mesh
    chart, area, corners = p.chart[faces], p.areas[faces], layouts.uv[p.faces[faces]]
    probe = first_of_groups(sheet, -area)
    low, high = corners.min(1), corners.max(1)
    pairs = []
    for part in np.array_split(probe, 1 + len(probe) * len(sheet) // SLICE_ROWS):
        x = point[part][:, None]
        hit = (low <= x).all(2) & (x <= high).all(2) & (chart[part][:, None] == chart)
        row, f = np.nonzero(hit)
        row = part[row]
        inside = row != f
        for a, b in ((0, 1), (1, 2), (2, 0)):
            inside &= cross2(corners[f, b] - corners[f, a], point[row] - corners[f, a]) >= 0
        pairs.append(np.stack([row[inside], f[inside]], 1))
    row, f = np.concatenate(pairs).T
    best = first_of_groups(row, -area[f], f)
    return row[best], f[best]


def _widened(graph: DualGraph, inner: BoolArray, part: IntArray, sink: BoolArray) -> IntArray:
    """Parts ((cells,), −1 for none) with their neighbours, but for sinks and theirs.

    So what overlaps by a corner goes, and no needle is left alone, whose width might be lost in the file.
    """
    out = part.copy()
    a, b = graph.tail[inner], graph.head[inner]
    close = sink.copy()
    close[a[sink[b]]] = close[b[sink[a]]] = True
    for one, other in ((a, b), (b, a)):
        grows = (part[other] >= 0) & (part[one] < 0) & ~close[one]
        out[one[grows]] = part[other[grows]]
    return out


def minimum_cut(
    graph: DualGraph, use: BoolArray, cost: FloatArray, source: IntArray, near: BoolArray
) -> BoolArray:
    """(cells,) bool: on the side of the sources when the cheapest edges between both are cut.

    use: (e,) bool edges that join cells. cost: (e,) of every edge. source: cells. near: (cells,) bool, all
    others but the sources are sinks. Maximum flow by Dinic's algorithm (SciPy); capacities are
    costs in whole numbers.
    """
    near = near.copy()
    near[source] = True
    count = int(near.sum())
    number = np.full(graph.n, count)  # all sinks are one
    number[near] = np.arange(count)
    use = use & (near[graph.tail] | near[graph.head]) & (graph.tail != graph.head)
    known = use & np.isfinite(cost)
    mean = float(cost[known].mean()) if known.any() else 1.0
    whole = np.where(known, np.maximum(cost / max(mean, 1e-300) * CAPACITY, 1), WALL)
    a, b, w = number[graph.tail[use]], number[graph.head[use]], whole[use]
    rows = np.concatenate([a, b, np.full(len(source), count + 1)])
    columns = np.concatenate([b, a, number[source]])
    w = np.concatenate([w, w, np.full(len(source), WALL)])
    capacity = sps.csr_array(sps.coo_array((w, (rows, columns)), shape=(count + 2, count + 2)))
    capacity.data = np.minimum(capacity.data, WALL).astype(np.int32)
    flow = maximum_flow(capacity, count + 1, count).flow
    residual = sps.csr_array(capacity - flow)
    residual.data = np.maximum(residual.data, 0)
    residual.eliminate_zeros()
    reached = breadth_first_order(residual, count + 1, return_predecessors=False)
    out = np.zeros(count + 2, bool)
    out[reached] = True
    result: BoolArray = near & out[number]
    return result
