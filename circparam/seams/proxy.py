"""Decide seams on a decimated mesh and carry them, and the layout, back to the fine one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    group_count,
    group_sum,
    ranges,
)
from circparam.graphs import components, nearest, undirected
from circparam.mesh import plane_frames
from circparam.seams.chains import Chains, chains_of, route
from circparam.seams.cutting import Cutting
from circparam.seams.shorten import (
    bands,
    edge_costs,
    space_gradients,
    spread,
    targets_from,
    turn_gradients,
)
from circparam.topology import Surface

SMALL_COMPONENT = 300  # faces; smaller components are taken over as they are
CARRY_RINGS = 0  # cells beside a seam's own that its path may use
LEAST_AREA = 1e-10  # coarse faces below this share of their longest edge squared are left out


@dataclass(frozen=True, eq=False)
class Proxy:
    """A coarse surface and the cell of every fine vertex.

    surface: the decimated surface. cell: (fine vertices,) vertex of the coarse surface's *points*; each cell
    is connected. apart: (k, 2) points of coarse edges that are no inner edges of the coarse surface although
    several faces meet there: seams, not borders.
    """

    surface: Surface
    cell: IntArray
    apart: IntArray


def pair_edges(points: FloatArray, faces: IntArray) -> tuple[Surface, IntArray]:
    """A surface from triangles that need not be manifold: only edges of two opposite half-edges are paired.

    Returns (surface, (k, 2) points of the edges with several faces that are not paired).
    """
    a, b = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    low, high = np.minimum(a, b), np.maximum(a, b)
    order = np.lexsort((high, low))
    key = low[order] * len(points) + high[order]
    run = first_of_runs(key)
    count = np.diff(np.r_[run, len(key)])
    two = run[count == 2]
    i, j = order[two], order[two + 1]
    opposite = a[i] == b[j]
    edges = np.sort(np.stack([i, j], 1)[opposite], axis=1)
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    many = np.r_[order[run[count > 2]], i[~opposite]]
    surface = Surface(
        points,
        faces,
        np.arange(len(faces)),
        np.zeros(len(faces), bool),
        edges,
        np.zeros(len(edges), bool),
    )
    return surface, np.stack([low[many], high[many]], 1)


def decimate(surface: Surface, target: int) -> Proxy:
    """A proxy of about ``target`` faces by quadric error (Garland and Heckbert 1997).

    The record of the collapses of fast-simplification tells which coarse vertex every fine vertex went into.
    Components of few faces are taken over unchanged.
    """
    import fast_simplification

    points, faces = surface.vertex_points, surface.corner_vertex
    n, m = len(points), len(faces)
    _, component = components(m, surface.edges[:, 0] // 3, surface.edges[:, 1] // 3)
    large = np.bincount(component)[component] > SMALL_COMPONENT
    root = np.arange(n)
    position = points.copy()
    if large.any():
        used = np.unique(faces[large])
        local = np.full(n, -1)
        local[used] = np.arange(len(used))
        centre = points[used].mean(0)
        size = float(np.abs(points[used] - centre).max())
        unit = (points[used] - centre) / size
        share = max(int(target * large.mean()), 4 * len(np.unique(component[large])))
        simple = local[faces[large]].astype(np.int32)
        _, _, collapses = fast_simplification.simplify(
            unit, simple, target_count=min(share, int(large.sum())), return_collapses=True
        )
        moved, _, into = fast_simplification.replay_simplification(unit, simple, collapses)
        # each coarse vertex is named by the first fine vertex that went into it
        into = np.asarray(into, np.int64)
        order = np.argsort(into, kind="stable")
        first = used[order[first_of_runs(into[order])]]
        root[used] = first[np.unique(into, return_inverse=True)[1]]
        position[first] = moved[into[order[first_of_runs(into[order])]]] * size + centre
    coarse = root[faces]
    alive = (
        (coarse[:, 0] != coarse[:, 1])
        & (coarse[:, 1] != coarse[:, 2])
        & (coarse[:, 0] != coarse[:, 2])
    )
    frames = plane_frames(position[coarse])
    longest = np.maximum(frames[:, 1, 0] ** 2, (frames[:, 2] ** 2).sum(1))
    with np.errstate(invalid="ignore"):
        alive &= frames[:, 1, 0] * frames[:, 2, 1] > LEAST_AREA * longest
    coarse = coarse[alive]
    kept = np.unique(coarse)
    number = np.full(n, -1)
    number[kept] = np.arange(len(kept))
    proxy, apart = pair_edges(position[kept], number[coarse])
    return Proxy(proxy, _settle(surface, number[root]), apart)


def _settle(surface: Surface, cell: IntArray) -> IntArray:
    """Give fine vertices whose coarse vertex lost its faces to the nearest cell of their component."""
    lost = cell < 0
    if not lost.any():
        return cell
    flat = surface.corner_vertex
    a, b = flat.ravel(), flat[:, [1, 2, 0]].ravel()
    n = len(cell)
    touch = np.unique(np.r_[a[~lost[a] & lost[b]], b[~lost[b] & lost[a]]])
    if len(touch) == 0:
        return cell
    _, _, source = nearest(undirected(n, a, b, np.ones(len(a))), touch)
    fill = lost & (source >= 0)
    out = cell.copy()
    out[fill] = cell[source[fill]]
    return out


def carry_seams(coarse: Cutting, proxy: Proxy, fine: Cutting, forced: BoolArray) -> int:
    """Cut the fine surface along shortest paths inside the cells of the coarse seams; returns paths not found.

    forced: (e,) bool, edges of the fine surface that are seams already.
    """
    surface = coarse.surface
    n = len(surface.points)
    flat = surface.faces.ravel()
    h = surface.edges[coarse.cut, 0]
    along = surface.faces[:, [1, 2, 0]].ravel()
    a, b = np.r_[flat[h], proxy.apart[:, 0]], np.r_[along[h], proxy.apart[:, 1]]
    if len(a) == 0:
        fine.cut = forced.copy()
        return 0
    border = np.zeros(n, bool)
    border[flat[surface.border]] = border[along[surface.border]] = True
    border[proxy.apart.ravel()] = False
    rim_only = border.copy()
    chains = chains_of(a, b, n, border)
    owner, value = bands((flat, along), n, chains, rim_only, CARRY_RINGS)
    cost = edge_costs(fine)
    usable = np.flatnonzero(np.isfinite(cost))
    ends = fine.ends[0][usable], fine.ends[1][usable]
    at_end = np.zeros(n, bool)
    at_end[chains.start] = at_end[chains.end] = True
    cell = proxy.cell
    has = cell >= 0
    junction = has & at_end[cell]
    fine_owner, fine_value = _share_out(
        ends,
        np.where(has, owner[cell], -1),
        np.where(has, value[cell], 0.0),
        junction,
        fine.on_border,
    )
    stand = _representatives(fine, proxy, surface.points, border, chains, fine_owner)
    start, end = stand[chains.start], stand[chains.end]
    taken = np.r_[start, end]
    fine_owner[taken[taken >= 0]] = -1
    routes = route(ends, cost[usable], fine_owner, fine_value, start, end)
    fine.cut = forced.copy()
    fine.cut[usable[routes.edges]] = True
    missing = 0
    for k in routes.failed:
        band = _wide_band(chains, int(k), (flat, along), n)
        missing += not _find_way(fine, usable, cost, int(start[k]), int(end[k]), has & band[cell])
    return missing


def _wide_band(
    chains: Chains, k: int, edges: tuple[IntArray, IntArray], n: int, rings: int = 2
) -> BoolArray:
    """(n,) coarse vertices within so many edges of chain k."""
    band = np.zeros(n, bool)
    band[chains.vertex[chains.chain == k]] = True
    band[[chains.start[k], chains.end[k]]] = True
    for _ in range(rings):
        band[edges[1][band[edges[0]]]] = True
        band[edges[0][band[edges[1]]]] = True
    return band


def _find_way(
    fine: Cutting, usable: IntArray, cost: FloatArray, start: int, end: int, band: BoolArray
) -> bool:
    """Cut a shortest path through free vertices of a wider band, for a chain whose own is too narrow."""
    if start < 0 or end < 0 or start == end:
        return False
    a, b = fine.ends
    n = fine.n_vertices
    free = band & ~fine.on_border
    free[a[fine.cut]] = free[b[fine.cut]] = False
    free[[start, end]] = True
    use = usable[free[a[usable]] & free[b[usable]] & ~fine.cut[usable]]
    distance, before, _ = nearest(undirected(n, a[use], b[use], cost[use]), np.array([start]))
    if not np.isfinite(distance[end]):
        return False
    path = [end]
    while path[-1] != start:
        path.append(int(before[path[-1]]))
    low, high = np.minimum(path[:-1], path[1:]), np.maximum(path[:-1], path[1:])
    key = np.minimum(a[use], b[use]) * n + np.maximum(a[use], b[use])
    order = np.lexsort((cost[use], key))
    fine.cut[use[order[np.searchsorted(key[order], low * n + high)]]] = True
    return True


def _representatives(
    fine: Cutting,
    proxy: Proxy,
    points: FloatArray,
    border: BoolArray,
    chains: Chains,
    owner: IntArray,
) -> IntArray:
    """(coarse points,) fine vertex that stands for each.

    At a junction the vertex beside which the most chains begin; then one on the border where the coarse point
    is on it; then the nearest.
    """
    cell = proxy.cell
    a = np.r_[fine.ends[0], fine.ends[1], np.arange(len(cell))]
    b = np.r_[fine.ends[1], fine.ends[0], np.arange(len(cell))]
    k = owner[b]
    here = (k >= 0) & (cell[a] >= 0)
    a, k = a[here], k[here]
    own = (chains.start[k] == cell[a]) | (chains.end[k] == cell[a])
    pairs = np.unique(a[own] * (len(chains.start) + 1) + k[own])
    beside = np.bincount(pairs // (len(chains.start) + 1), minlength=len(cell))
    member = np.flatnonzero(cell >= 0)
    c = cell[member]
    distance = np.linalg.norm(fine.surface.vertex_points[member] - points[c], axis=1)
    inside = border[c] & ~fine.on_border[member]
    order = np.lexsort((distance, -beside[member], inside, c))
    first = first_of_runs(c[order])
    out = np.full(len(points), -1)
    out[c[order][first]] = member[order][first]
    return out


def _share_out(
    ends: tuple[IntArray, IntArray],
    owner: IntArray,
    value: FloatArray,
    junction: BoolArray,
    closed: BoolArray,
) -> tuple[IntArray, FloatArray]:
    """Give the vertices of junction cells to the nearest chain; borders and ends of chains to none."""
    n = len(owner)
    owner = np.where(closed, -1, owner)
    fill = junction & ~closed
    a, b = ends
    use = (fill[a] | fill[b]) & (fill[a] | (owner[a] >= 0)) & (fill[b] | (owner[b] >= 0))
    a, b = a[use], b[use]
    seeds = np.unique(np.r_[a[~fill[a]], b[~fill[b]]])
    if len(seeds):
        _, _, source = nearest(undirected(n, a, b, np.ones(len(a))), seeds)
        got = fill & (source >= 0)
        owner, value = owner.copy(), value.copy()
        owner[got] = owner[source[got]]
        value[got] = value[source[got]]
    return owner, value


def nearest_coarse_face(fine: Surface, proxy: Proxy) -> IntArray:
    """(m,) a coarse face near every fine face, facing alike: among those round the cell of its first corner."""
    coarse = proxy.surface
    order = np.argsort(coarse.faces.ravel(), kind="stable")
    degree = group_count(coarse.faces.ravel(), len(coarse.points))
    first = np.cumsum(degree) - degree
    cell = proxy.cell[fine.corner_vertex[:, 0]]
    out = np.full(len(fine.faces), -1)
    face = np.flatnonzero(cell >= 0)
    centre = coarse.points[coarse.faces].mean(1)
    size = float(np.sqrt(coarse.areas.mean()))
    for part in np.array_split(face, max(1, len(face) // 300_000)):
        k = degree[cell[part]]
        f = np.repeat(part, k)
        candidate = order[np.repeat(first[cell[part]], k) + ranges(k)] // 3
        here = fine.points[fine.faces[f]].mean(1)
        apart = np.linalg.norm(centre[candidate] - here, axis=1) / size
        turn = 1 - (coarse.normals[candidate] * fine.normals[f]).sum(1)
        best = np.lexsort((apart + 0.5 * turn, f))
        start = first_of_runs(f[best])
        out[f[best][start]] = candidate[best][start]
    return out


@dataclass(frozen=True, eq=False)
class Carried:
    """Fine charts matched to coarse ones. main: (n,) coarse chart of each fine chart; real: (n,) bool, it is
    the largest of its coarse chart (the others are slivers between paths)."""

    chart: IntArray
    main: IntArray
    real: BoolArray


def match_charts(fine: Cutting, coarse_chart: IntArray, near: IntArray) -> Carried:
    """Which coarse chart each fine chart stands for, by the area they share."""
    n, chart = fine.charts()
    label = np.where(near >= 0, coarse_chart[near], -1)
    ok = label >= 0
    nc = int(coarse_chart.max()) + 1
    shared = group_sum(fine.surface.areas[ok], chart[ok] * nc + label[ok], n * nc).reshape(n, nc)
    main = shared.argmax(1)
    area = shared.max(1)
    order = np.lexsort((-area, main))
    real = np.zeros(n, bool)
    real[order[first_of_runs(main[order])]] = True
    # a chart without any coarse face (a component too small for the proxy) stands for itself
    real |= area == 0
    return Carried(chart, main, real)


def drop_slivers(
    fine: Cutting, coarse_chart: IntArray, near: IntArray, forced: BoolArray
) -> Carried:
    """Glue charts that stand for no coarse chart to the neighbour with the longest common seam."""
    for _ in range(6):
        found = match_charts(fine, coarse_chart, near)
        if found.real.all():
            return found
        arcs = fine.arcs(found.chart)
        held = np.zeros(len(arcs.left), bool)
        held[arcs.arc[forced[arcs.edge]]] = True
        sliver = ~found.real
        may = (arcs.left != arcs.right) & (sliver[arcs.left] | sliver[arcs.right]) & ~held
        if not may.any():
            return found
        which = np.flatnonzero(may)
        side = np.where(sliver[arcs.left[which]], arcs.left[which], arcs.right[which])
        order = np.lexsort((-arcs.length[which], side))
        glue = which[order[first_of_runs(side[order])]]
        chosen = np.zeros(len(arcs.left), bool)
        chosen[glue] = True
        fine.cut[arcs.edge[chosen[arcs.arc]]] = False
    return match_charts(fine, coarse_chart, near)


def fine_targets(
    coarse: Cutting, fine: Cutting, coarse_chart: IntArray, near: IntArray, carried: Carried
) -> tuple[FloatArray, BoolArray]:
    """(2, 2, m) Jacobians that the coarse layout asks of the fine faces, and which charts have any."""
    gradients = space_gradients(coarse)
    surface, chart = fine.surface, carried.chart
    on_seam = np.zeros(int(coarse.surface.corner_vertex.max()) + 1, bool)
    on_seam[coarse.ends[0][coarse.cut]] = on_seam[coarse.ends[1][coarse.cut]] = True
    clear = ~on_seam[coarse.surface.corner_vertex].any(1)
    own = (near >= 0) & (np.where(near >= 0, coarse_chart[near], -1) == carried.main[chart])
    known = own & clear[near]
    # small charts may have no face clear of seams: there every face of its own counts
    none_clear = np.bincount(chart, known, int(chart.max()) + 1) == 0
    known |= own & none_clear[chart]
    source = np.where(known, near, 0)
    turned = turn_gradients(gradients[source], coarse.surface.normals[source], surface.normals)
    turned[~known] = 0
    filled, have = spread(fine, turned, known)
    whole = np.ones(int(chart.max()) + 1, bool)
    whole[chart[np.flatnonzero(~have)]] = False
    return targets_from(fine, filled), whole
