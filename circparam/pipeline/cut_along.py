"""Cuts along chords of a layout, made along edges of the mesh: the shortest way near each chord."""

from dataclasses import replace

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import cross2, edge_keys, ends_of, group_sum
from circparam.core.graph import nearest
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.geometry.distortion import at_best_scales, chart_distortion
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.seams.accuracy import TRIAL
from circparam.seams.segmentation.layout import judge
from circparam.solvers.newton import relax

BAND = 0.2  # of a chord's length, and two edges: largest distance of the path along edges from the chord
ALIKE = 2.0  # ratio of the areas that the chord and the way cut off, at most


@dataclass(frozen=True, eq=False)
class Chord:
    """A straight cut through a chart from start to end (2,), in the uv of its atlas. least: area of the smaller
    part that it leaves, in space."""

    start: FloatArray
    end: FloatArray
    least: float


@dataclass(frozen=True)
class Limits:
    """Limits for both parts of a chart that is cut: the bound on the distortion, the least number of faces."""

    bound: float
    faces: int = 1


@dataclass(frozen=True, eq=False)
class Opened:
    """An opened atlas: its cut mesh and the uv (nv, 2) of that mesh, for repeated use."""

    atlas: Atlas
    cut_mesh: CutMesh
    uv: FloatArray

    @classmethod
    def of(cls, atlas: Atlas) -> "Opened":
        """An atlas, opened."""
        return cls(atlas, *atlas.open())


def cut_along(whole: Opened, chord: Chord, costs: FloatArray, limits: Limits) -> Opened | None:
    """The atlas of one chart cut along edges near a chord; None unless both parts are valid disks.

    costs: (e,) of a seam along each edge, infinite if seams are forbidden. The way begins and ends on a
    boundary near the ends of the chord, wherever it is shortest, or else at its ends. The layout stays.
    """
    atlas = whole.atlas
    for ends in (BAND, 0.0):
        path = _path(whole, chord, costs, ends)
        if path is None:
            continue
        cut = atlas.cut.copy()
        cut[path] = True
        after = _kept(Atlas(atlas.surface, cut, atlas.corners, atlas.prices), path, chord, limits)
        if after is not None:
            return after
    return None


def _path(whole: Opened, chord: Chord, costs: FloatArray, ends: float) -> IntArray | None:
    """Edges of the cheapest way near a chord; None if there is none."""
    atlas, cut_mesh, uv = whole.atlas, whole.cut_mesh, whole.uv
    edge = np.flatnonzero(~atlas.cut & np.isfinite(costs))
    a, b = ends_of(cut_mesh.faces, atlas.surface.edges[edge, 0])
    length = float(np.linalg.norm(chord.end - chord.start))
    step = float(np.median(np.linalg.norm(uv[a] - uv[b], axis=1))) if len(edge) else 0.0
    away = _distance(uv, chord.start, chord.end)
    near = away <= BAND * length + 2 * step
    edge, a, b = (x[near[a] & near[b]] for x in (edge, a, b))
    reach = ends * length + (step if ends else 0.0)
    starts, goals = (_beside(cut_mesh, uv, p, reach) for p in (chord.start, chord.end))
    if not len(edge) or not len(starts) or not len(goals):
        return None
    return cheapest_way(cut_mesh, edge, (a, b), costs[edge], starts, goals)


def slit_open(whole: Opened, costs: FloatArray) -> Opened | None:
    """The atlas of one chart whose largest hole is joined to the outer loop; None if there is no way.

    costs: (e,) as for ``cut_along``. The chart stays one and keeps its layout; a ring can be cut across then.
    """
    atlas, cut_mesh = whole.atlas, whole.cut_mesh
    loops = cut_mesh.loops
    vertex, ahead = ends_of(cut_mesh.faces, loops.half_edges)
    area = group_sum(cross2(whole.uv[vertex], whole.uv[ahead]), loops.loop_of, len(loops.chart))
    hole = int(np.where(loops.outer, -np.inf, np.abs(area)).argmax())
    edge = np.flatnonzero(~atlas.cut & np.isfinite(costs))
    starts, goals = vertex[loops.loop_of == hole], vertex[loops.outer[loops.loop_of]]
    ends = ends_of(cut_mesh.faces, atlas.surface.edges[edge, 0])
    path = cheapest_way(cut_mesh, edge, ends, costs[edge], starts, goals)
    if path is None:
        return None
    cut = atlas.cut.copy()
    cut[path] = True
    return Opened.of(Atlas(atlas.surface, cut, atlas.corners, atlas.prices))


def cheapest_way(
    cut_mesh: CutMesh,
    edge: IntArray,
    ends: tuple[IntArray, IntArray],
    costs: FloatArray,
    starts: IntArray,
    goals: IntArray,
) -> IntArray | None:
    """The edges of the cheapest way from one of some vertices to one of others; None if there is none.

    edge: (e,) usable edges, with their ends and costs. The path avoids the boundary in between.
    """
    a, b = ends
    n = cut_mesh.n_vertices
    rim = cut_mesh.on_boundary
    # along the boundary it would tear fragments off: each vertex there costs more than any way round
    costs = costs + costs.sum() * (rim[a].astype(float) + rim[b])
    graph = sps.csr_matrix((costs, (a, b)), shape=(n, n))
    distance, before, _ = nearest(graph, starts, symmetric=False)
    path = [int(goals[np.argmin(distance[goals])])]
    if not 0 < distance[path[0]] < np.inf:
        return None
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    q = np.array(path)
    return edge[np.isin(edge_keys(a, b, n), edge_keys(q[1:], q[:-1], n))]


def _beside(cut_mesh: CutMesh, uv: FloatArray, place: FloatArray, reach: float) -> IntArray:
    """Boundary vertices at a place (2,) in uv, with those no further than ``reach`` along their loops."""
    loops = cut_mesh.loops
    vertex, ahead = ends_of(cut_mesh.faces, loops.half_edges)
    here = np.flatnonzero((uv[vertex] == place).all(1))
    length = np.linalg.norm(uv[ahead] - uv[vertex], axis=1)
    ends = np.cumsum(length)
    found = [vertex[here]]
    for k in here.tolist():
        loop = int(np.searchsorted(loops.start, k, side="right")) - 1
        part = slice(int(loops.start[loop]), int(loops.start[loop + 1]))
        at = ends[part] - length[part]
        away = np.abs(at - at[k - part.start])
        around = float(length[part].sum())
        found.append(vertex[part][np.minimum(away, around - away) <= reach])
    return np.unique(np.concatenate(found))


def _distance(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(k,) distance of points (k, 2) from a segment."""
    d = end - start
    t = np.clip(((points - start) @ d) / max(float(d @ d), 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - start - t[:, None] * d, axis=1)


def _kept(atlas: Atlas, path: IntArray, chord: Chord, limits: Limits) -> Opened | None:
    """An atlas cut along a path (edges) if both charts are valid, else None.

    Both parts, or None. Each part is a disk (holes allowed) with enough faces, below the bound: a part above it
    is relaxed. The smaller part has about the planned area.
    """
    count, chart = atlas.charts()
    if count != 2 or np.bincount(chart).min() < limits.faces:
        return None
    if (np.diff(chart[atlas.surface.edges[path] // 3], axis=1) == 0).any():
        return None  # a slit that ends inside
    cut_mesh, uv = atlas.open()
    if not chord.least / ALIKE < float(cut_mesh.chart_areas.min()) < chord.least * ALIKE:
        return None
    if not_disks(cut_mesh).any():
        return None
    high = chart_distortion(cut_mesh, uv) > limits.bound
    if high.any():
        part, vertices, _ = cut_mesh.subset(high)
        start = at_best_scales(part, uv[vertices])
        bound = replace(TRIAL, bound=limits.bound, give_up=limits.bound)
        laid = judge(part, relax(part, start, bound).uv)
        if laid.bad(limits.bound).any():
            return None
        uv[vertices] = laid.uv
        atlas.scatter(cut_mesh, uv)
    return Opened(atlas, cut_mesh, uv)
