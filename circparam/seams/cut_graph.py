"""Seams that only open the surface: none at all, or one disk for each component."""

import numpy as np

from circparam.core.arrays import ends_of, first_of_groups, group_count, mask_of
from circparam.core.graph import Graph, chains, spanning_forest
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import TopologyError
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import corner_classes
from circparam.mesh.surface import Surface
from circparam.seams.constraints import constrain
from circparam.seams.options import SeamOptions, Seams

SLIT = 1e-9  # a boundary whose vector area is below this share of its length² encloses nothing
SLIT_EDGES = 6  # and only if it has at most so many edges: the opening of a pocket is flat as well
# faces looked at while loops are shortened, all of the surface in a round: in 16 rounds loops of four handles
# stay 1.15 times as long
SHORTENED_FACES = 1_500_000


def none(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    """No seams. Raises TopologyError unless every component is a disk.

    Slits that set-aside faces without area have left do not count as boundaries.
    """
    cut = np.zeros(len(surface.edges), bool)
    cut_mesh = surface.cut_mesh(cut)
    loops = cut_mesh.loops
    open_loops = group_count(loops.chart[~_slits(surface, cut_mesh)], cut_mesh.n_charts)
    genus = genus_of(cut_mesh)
    bad = np.flatnonzero((open_loops != 1) | (genus > 0))
    if len(bad):
        c = int(bad[0])
        faces = int((cut_mesh.chart == c).sum())
        boundaries, handles = int(open_loops[c]), int(genus[c])
        raise TopologyError(
            f"component {c} ({faces} faces, the first is face "
            f"{surface.source[cut_mesh.chart == c].min()}) has {boundaries} "
            f"{'boundary' if boundaries == 1 else 'boundaries'} and genus {handles}; "
            "a map without seams needs 1 and 0"
            + (f" ({len(bad)} components in all)" if len(bad) > 1 else "")
            + ". Cut it: --cut disk"
        )
    return Seams(cut)


def disk(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    """One disk for each component, but for inner holes: Euler characteristic 1 once these are closed.

    Closed surfaces without handles open along the shortest path between two far ends. Handles are cut along
    the 2g loops that a tree-cotree pair leaves (Erickson, Whittlesey 2005; Dey's and Eppstein's trees),
    boundaries taken as points, and each loop is then replaced by the shortest cut that does the same. Seams
    that the options demand are kept, and every part they leave becomes a disk of its own.
    """
    surface, cut, notes = constrain(surface, options)
    before = int(cut.sum())
    cut_mesh = surface.cut_mesh(cut)
    genus = genus_of(cut_mesh)
    if genus.any():
        cut = cut | cut_handles(surface, cut, genus > 0, monitor)
        cut_mesh = surface.cut_mesh(cut)
    boundaries = cut_mesh.loops.chart[~_slits(surface, cut_mesh)]
    closed = group_count(boundaries, cut_mesh.n_charts) == 0
    if closed.any():
        cut = cut | _open(surface, cut, cut_mesh, closed)
    handles = int(genus.sum())
    if handles:
        notes.append(f"{handles} handles cut along {int(cut.sum()) - before} edges")
    crossed = int((cut & surface.locked).sum())
    if crossed:
        notes.append(
            f"{crossed} edges inside polygons are cut, since no disk is reached without them"
        )
    return Seams(cut, None, notes)


def genus_of(cut_mesh: CutMesh) -> IntArray:
    """(n_charts,) genus of each chart: χ = 2 − 2·genus − boundaries."""
    boundaries = group_count(cut_mesh.loops.chart, cut_mesh.n_charts)
    return (2 - cut_mesh.euler() - boundaries) // 2


def _slits(surface: Surface, cut_mesh: CutMesh) -> BoolArray:
    """(loops,) boundaries of a few edges that enclose no area, as a set-aside face without area leaves them."""
    loops = cut_mesh.loops
    first = loops.start[:-1]
    if len(first) == 0:
        return np.zeros(0, bool)
    p, q = (surface.points[end] for end in ends_of(surface.faces, loops.half_edges))
    origin = p[first][loops.loop_of]
    p, q = p - origin, q - origin
    area = np.linalg.norm(np.add.reduceat(np.cross(p, q), first, axis=0), axis=1)
    return (area <= SLIT * loops.length**2) & (np.diff(loops.start) <= SLIT_EDGES)


@dataclass(frozen=True, eq=False)
class _Part:
    """The charts being cut: cut mesh of them, the edges of the surface in cut mesh.edges, and their weights."""

    cut_mesh: CutMesh
    edge: IntArray
    weight: FloatArray
    locked: BoolArray


def _part(surface: Surface, cut: BoolArray, faces: BoolArray) -> _Part:
    _, chart = surface.charts(cut)
    label = np.cumsum(np.bincount(chart[faces], minlength=int(chart.max()) + 1) > 0) - 1
    cut_mesh, _ = surface.part_cut_mesh(cut, faces, label[chart])
    edge = np.flatnonzero(~cut & faces[surface.sides[0]])
    locked = surface.locked[edge]
    weight = np.maximum(surface.edge_lengths[edge], 1e-9 * surface.edge_lengths.max(initial=0.0))
    # a locked edge is longer than all others together: taken only where there is no other way
    weight = np.where(locked, weight + weight.sum(), weight)
    return _Part(cut_mesh, edge, weight, locked)


def _nodes(cut_mesh: CutMesh) -> tuple[int, IntArray, IntArray, IntArray]:
    """Vertices with every boundary loop drawn together to one node: (number, (n_vertices,) node, both nodes of
    each edge)."""
    node = np.arange(cut_mesh.n_vertices)
    loops = cut_mesh.loops
    node[cut_mesh.faces.ravel()[loops.half_edges]] = cut_mesh.n_vertices + loops.loop_of
    a, b = ends_of(cut_mesh.faces, cut_mesh.edges[:, 0])
    return cut_mesh.n_vertices + len(loops.chart), node, node[a], node[b]


def cut_handles(surface: Surface, cut: BoolArray, charts: BoolArray, monitor: Monitor) -> BoolArray:
    """(e,) bool: edges along which some charts (bool over the charts of ``cut``) lose their handles."""
    _, chart = surface.charts(cut)
    part = _part(surface, cut, charts[chart])
    seam = _shorten(part, _tree_cotree(part), monitor)
    return mask_of(len(surface.edges), part.edge[seam])


def _tree_cotree(part: _Part) -> BoolArray:
    """(e,) edges of the part along which every chart becomes a sphere with holes: 2g loops from one point.

    The tree is that of shortest paths from the longest boundary (else from one vertex), with boundaries drawn
    together to points; the cotree joins faces across the other edges, those on the longest loops first, so the
    2g edges that are left close the shortest loops.
    """
    cut_mesh = part.cut_mesh
    n, node, a, b = _nodes(cut_mesh)
    roots = np.empty(cut_mesh.n_charts, np.int64)
    roots[cut_mesh.vertex_chart[::-1]] = node[::-1]
    outer = np.flatnonzero(cut_mesh.loops.outer)
    roots[cut_mesh.loops.chart[outer]] = cut_mesh.n_vertices + outer
    graph = Graph(n, a, b, part.weight)
    distance, parent = graph.paths(roots)
    left = np.ones(len(a), bool)
    child = np.flatnonzero(parent >= 0)
    left[graph.edge(child, parent[child])] = False
    # locked edges join their faces first of all: no seam runs there
    length = np.where(part.locked, np.inf, distance[a] + part.weight + distance[b])
    free = np.flatnonzero(left)
    f, g = cut_mesh.edges[free].T // 3
    left[free[spanning_forest(len(cut_mesh.faces), f, g, -length[free])]] = False
    seam = left.copy()
    seam[graph.trace(parent, np.r_[a[left], b[left]])] = True
    return _prune(seam, a, b, n)


def _prune(seam: BoolArray, a: IntArray, b: IntArray, n: int) -> BoolArray:
    """Take off the loose ends of a seam, again and again."""
    e = np.flatnonzero(seam)
    while len(e):
        valence = np.bincount(np.r_[a[e], b[e]], minlength=n)
        loose = (valence[a[e]] == 1) | (valence[b[e]] == 1)
        if not loose.any():
            break
        e = e[~loose]
    return mask_of(len(seam), e)


def _shorten(part: _Part, seam: BoolArray, monitor: Monitor) -> BoolArray:
    """Replace arcs of the seam, the longest first, by the shortest cut between the two boundaries they join.

    With one arc glued a chart is an annulus, but for holes, and *every* path between the two boundaries of the
    annulus opens it again. One arc of each chart at a time; ends when no arc gets shorter, the work is spent
    or the time is up (the seam is valid all the way).
    """
    cut_mesh = part.cut_mesh
    n, _, a, b = _nodes(cut_mesh)
    chart = cut_mesh.chart[cut_mesh.edges[:, 0] // 3]
    tried = np.zeros(len(seam), bool)
    for _ in range(1 + SHORTENED_FACES // len(cut_mesh.faces)):
        arc = _longest_arcs(seam, tried, a, b, chart, part.weight, cut_mesh.n_vertices)
        if not arc.any() or monitor.expired:
            break
        tried |= arc
        path, gained = _reroute(part, seam & ~arc, arc, chart)
        before = np.bincount(chart[seam], part.weight[seam], cut_mesh.n_charts)
        seam = _prune(np.where(gained[chart], (seam & ~arc) | path, seam), a, b, n)
        after = np.bincount(chart[seam], part.weight[seam], cut_mesh.n_charts)
        # a chart that changed has new arcs to try
        tried &= seam & ~(after < before)[chart]
    return seam


def _longest_arcs(
    seam: BoolArray,
    tried: BoolArray,
    a: IntArray,
    b: IntArray,
    chart: IntArray,
    weight: FloatArray,
    n_vertices: int,
) -> BoolArray:
    """(e,) for each chart the longest arc of its seam not tried yet; arcs end at branches and boundaries."""
    e = np.flatnonzero(seam)
    through = np.bincount(np.r_[a[e], b[e]], minlength=n_vertices) == 2
    through[n_vertices:] = False
    count, arc = chains(a[e], b[e], through)
    length = np.bincount(arc, weight[e], count)
    stale = np.bincount(arc, tried[e], count) > 0
    owner = np.zeros(count, np.int64)
    owner[arc] = chart[e]
    best = first_of_groups(owner, stale, -length)
    out = np.zeros(len(seam), bool)
    out[e] = np.isin(arc, best[~stale[best]])
    return out


def _reroute(
    part: _Part, seam: BoolArray, arc: BoolArray, chart: IntArray
) -> tuple[BoolArray, BoolArray]:
    """Shortest paths between the boundaries that the arcs join: ((e,), (charts,) where one is shorter)."""
    cut_mesh = part.cut_mesh
    kept = np.flatnonzero(~seam)
    _, corners = corner_classes(len(cut_mesh.faces), cut_mesh.edges[kept])
    trial = CutMesh(corners, cut_mesh.rest_triangles, cut_mesh.chart, cut_mesh.edges[kept])
    n, _, a, b = _nodes(trial)
    on = arc[kept]
    owner = chart[kept]
    length = np.bincount(owner[on], part.weight[kept][on], trial.n_charts)
    # the ends of an arc are its only vertices on a boundary
    ends = np.unique(np.stack([np.r_[owner[on], owner[on]], np.r_[a[on], b[on]]], 1), axis=0)
    ends = ends[ends[:, 1] >= trial.n_vertices]
    two = group_count(ends[:, 0], trial.n_charts)[ends[1:, 0]] == 2
    pair = np.flatnonzero((ends[1:, 0] == ends[:-1, 0]) & two)
    charts, start, stop = ends[pair, 0], ends[pair, 1], ends[pair + 1, 1]
    path = np.zeros(len(seam), bool)
    gained = np.zeros(trial.n_charts, bool)
    if len(charts) == 0:
        return path, gained
    graph = Graph(n, a, b, part.weight[kept])
    distance, parent = graph.paths(start, limit=float(length.max()))
    better = distance[stop] < length[charts] * (1 - 1e-9)
    gained[charts[better]] = True
    path[kept[graph.trace(parent, stop[better])]] = True
    return path, gained


def _open(surface: Surface, cut: BoolArray, cut_mesh: CutMesh, charts: BoolArray) -> BoolArray:
    """(e,) a short path in each closed chart, between two far ends (or from a slit, where it has one)."""
    part = _part(surface, cut, charts[cut_mesh.chart])
    cut_mesh = part.cut_mesh
    n, node, a, b = _nodes(cut_mesh)
    graph = Graph(n, a, b, part.weight)
    chart = np.full(n, -1)
    chart[node] = cut_mesh.vertex_chart
    used = np.flatnonzero(chart >= 0)
    loops = cut_mesh.loops

    def farthest(distance: FloatArray) -> IntArray:
        return used[first_of_groups(chart[used], -distance[used])]

    start = used[np.unique(chart[used], return_index=True)[1]]
    start = farthest(graph.paths(start)[0])
    start[loops.chart[loops.outer]] = cut_mesh.n_vertices + np.flatnonzero(loops.outer)
    distance, parent = graph.paths(start)
    tip = farthest(distance)
    seam = mask_of(len(a), graph.trace(parent, tip))
    owner = cut_mesh.chart[cut_mesh.edges[:, 0] // 3]
    seam = _lengthen(seam, tip, a, b, owner, part, n)
    return mask_of(len(surface.edges), part.edge[seam])


def _lengthen(
    seam: BoolArray,
    tip: IntArray,
    a: IntArray,
    b: IntArray,
    owner: IntArray,
    part: _Part,
    n: int,
) -> BoolArray:
    """Add an edge at the tip of every path of one edge, which opens nothing."""
    taken = mask_of(n, np.r_[a[seam], b[seam], tip])
    short = group_count(owner[seam], len(tip)) < 2
    e = np.flatnonzero(short[owner])
    ta, tb = a[e] == tip[owner[e]], b[e] == tip[owner[e]]
    ok = (ta & ~taken[b[e]]) | (tb & ~taken[a[e]])
    e = e[ok]
    return seam | mask_of(len(seam), e[first_of_groups(owner[e], part.weight[e])])
