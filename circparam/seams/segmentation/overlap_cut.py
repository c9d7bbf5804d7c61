"""Split charts that overlap themselves: a shortest cut between the two layers that lie on each other."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import SLICE_ROWS, cross2, first_of_groups, group_max, group_sum
from circparam.core.compiled import breadth_first_order, maximum_flow
from circparam.core.graph import components, distances, matching, nearest, undirected
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.boundary import boundary_in
from circparam.geometry.intersect import windings
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.segmentation.layout import ChartLayouts

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
    """Cut charts along the cheapest seam between their largest doubled part and what lies on it.

    which: (n,) bool charts. cost: (e,) of every edge. Returns (n,) bool, the charts that were cut: the others
    have no two parts that lie on each other without touching.
    """
    done = np.zeros(len(which), bool)
    if not which.any():
        return done
    chart = layouts.cut_mesh.chart
    left = atlas.surface.sides[0]
    inner = ~atlas.cut & which[chart[left]]
    faces = np.flatnonzero(which[chart])
    point, twice = _doubled(layouts, faces)
    pairs = _sides(graph, inner, layouts, faces[twice], point[twice])
    if not pairs:
        return done
    links = undirected(graph.n, graph.tail[inner], graph.head[inner], graph.step[inner])
    area = group_sum(layouts.cut_mesh.areas, graph.cell, graph.n)
    off = np.zeros(graph.n, bool)  # cells that were cut off
    for source, sink in pairs:
        if off[source].any() or off[sink].any():
            continue
        # what lies far from the smaller part stays with the larger one
        reach = NEAR * np.sqrt(area[source].sum())
        close = np.isfinite(distances(links, source, reach))
        close &= ~off
        close[sink] = False
        side = minimum_cut(graph, inner, cost, source, close)
        off |= side
        new = inner & (side[graph.tail] != side[graph.head])
        atlas.cut |= new
        done[chart[left[new]]] = True
    return done


def _doubled(layouts: ChartLayouts, faces: IntArray) -> tuple[FloatArray, BoolArray]:
    """((k, 2) a point of each face, (k,) bool: its chart covers that point more than once)."""
    p = layouts.cut_mesh
    boundary = boundary_in(p, layouts.uv)
    corners = layouts.uv[p.faces[faces]]
    middle = corners.mean(1)
    points = np.concatenate(
        [middle[:, None], middle[:, None] + 0.95 * (corners - middle[:, None])], 1
    )
    layers = windings(boundary, points.reshape(-1, 2), np.repeat(p.chart[faces], 4)).reshape(-1, 4)
    best = layers.argmax(1)
    rows = np.arange(len(faces))
    return points[rows, best], layers[rows, best] > 1


def _sides(
    graph: DualGraph, inner: BoolArray, layouts: ChartLayouts, faces: IntArray, point: FloatArray
) -> list[tuple[IntArray, IntArray]]:
    """Cells of doubled parts of charts, and cells of what lies on them: disjoint pairs.

    inner: (e,) bool edges inside charts. faces, point: doubled faces and a doubled point of each. Where both
    are one part (a sheet that comes back on itself), those near either end of it.
    """
    p = layouts.cut_mesh
    if len(faces) == 0:
        return []
    inside = np.zeros(graph.n, bool)
    inside[graph.cell[faces]] = True
    use = inner & inside[graph.tail] & inside[graph.head]
    _, part = components(graph.n, graph.tail[use], graph.head[use])
    _, sheet = np.unique(part[graph.cell[faces]], return_inverse=True)
    sheet = sheet.reshape(-1)
    area = group_sum(p.areas[faces], sheet, int(sheet.max()) + 1)
    probe, cover = _covers(p.chart[faces], sheet, p.areas[faces], layouts.uv[p.faces[faces]], point)
    # disjoint pairs of parts, the largest first; of each the smaller part is cut off
    pick = matching(
        np.minimum(area[sheet[probe]], area[sheet[cover]]), sheet[probe], sheet[cover], len(area)
    )
    probe, cover = probe[pick], cover[pick]
    swap = area[sheet[probe]] > area[sheet[cover]]
    probe, cover = np.where(swap, cover, probe), np.where(swap, probe, cover)
    ends = graph.cell[faces[np.r_[probe, cover]]]
    distinct = ends[: len(probe)] != ends[len(probe) :]
    probe, cover = probe[distinct], cover[distinct]
    order = np.lexsort((-area[sheet[probe]], p.chart[faces[probe]]))
    probe, cover = probe[order], cover[order]
    if len(probe) == 0:
        return []
    first, second = graph.cell[faces[probe]], graph.cell[faces[cover]]
    links = undirected(graph.n, graph.tail[use], graph.head[use], graph.step[use])
    distance, _, owner = nearest(links, np.unique(np.r_[first, second]))
    same = sheet[probe] == sheet[cover]
    reach = np.full(graph.n, np.inf)
    found = owner >= 0
    span = group_max(distance[found], owner[found], graph.n)
    half = SHARE * np.maximum(span[first[same]], span[second[same]])
    reach[first[same]] = reach[second[same]] = half
    near = found & (distance <= reach[np.where(found, owner, 0)])
    pairs = []
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        sink = np.flatnonzero(near & (owner == b))
        pairs.append((_widened(graph, inner, np.flatnonzero(near & (owner == a)), sink), sink))
    return pairs


def _covers(
    chart: IntArray, sheet: IntArray, area: FloatArray, corners: FloatArray, point: FloatArray
) -> tuple[IntArray, IntArray]:
    """The largest face of every part, and the largest other face of its chart that covers its doubled point.

    All arrays are over the doubled faces; parts whose point no other doubled face covers are left out.
    """
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


def _widened(graph: DualGraph, inner: BoolArray, cells: IntArray, apart: IntArray) -> IntArray:
    """The cells and their neighbours, but for those ``apart`` and theirs: what overlaps by a corner goes."""
    out, far = np.zeros(graph.n, bool), np.zeros(graph.n, bool)
    out[cells], far[apart] = True, True
    a, b = graph.tail[inner], graph.head[inner]
    ring, close = out.copy(), far.copy()
    ring[a[out[b]]] = ring[b[out[a]]] = True
    close[a[far[b]]] = close[b[far[a]]] = True
    return np.flatnonzero(out | (ring & ~close))


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
