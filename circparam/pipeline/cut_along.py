"""Cuts along chords of a layout, made along edges of the mesh: the shortest way near each chord."""

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import cross2, edge_keys, ends_of, group_sum
from circparam.core.graph import nearest
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.distortion import at_best_scales, chart_distortion
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.seams.accuracy import TRIAL
from circparam.seams.segmentation.layout import judge
from circparam.solvers.newton import relax

BAND = 0.2  # of a chord's length, and two edges: largest distance of the path along edges from the chord
ALIKE = 2.0  # ratio of the areas that the chord and the way cut off, at most


@dataclass(frozen=True)
class Limits:
    """Limits for both parts of a chart that is cut: the bound on the distortion, the least number of faces."""

    bound: float
    faces: int = 1


@dataclass(frozen=True, eq=False)
class Ground:
    """The atlas of one chart, on which it can be cut.

    chart: the chart that it is or was a part of. faces: (k,) those of the whole. costs: (e,) of a cut along
    each edge, infinite where none may lead. flat: (e,) bool, edges inside flats of the design.
    """

    chart: int
    faces: IntArray
    atlas: Atlas
    costs: FloatArray
    flat: BoolArray

    @cached_property
    def opened(self) -> tuple[CutMesh, FloatArray]:
        """The cut mesh, and the uv of its vertices."""
        return self.atlas.open()

    @cached_property
    def ways(self) -> tuple[IntArray, IntArray, IntArray]:
        """The edges along which a cut may lead, and both ends of each on the cut mesh."""
        edge = np.flatnonzero(~self.atlas.cut & np.isfinite(self.costs))
        return edge, *ends_of(self.opened[0].faces, self.atlas.surface.edges[edge, 0])

    def after(self, path: IntArray) -> Atlas:
        """The atlas cut along some edges, with the same layout."""
        cut = self.atlas.cut.copy()
        cut[path] = True
        return Atlas(self.atlas.surface, cut, self.atlas.corners, self.atlas.prices)

    def part(self, after: Atlas, mine: BoolArray) -> "Ground":
        """The part on some faces (bool) of the atlas after a cut."""
        inside = after.surface.inner_edges(mine)
        costs, flat = self.costs[inside], self.flat[inside]
        return Ground(self.chart, self.faces[mine], after.part(mine), costs, flat)


def cut_along(
    ground: Ground, start: FloatArray, end: FloatArray, least: float, limits: Limits
) -> Atlas | None:
    """The atlas of a chart cut along edges near a chord; None unless both parts are valid disks.

    start, end: (2,) of the chord in uv. least: area of the smaller part that it leaves, in space. The way
    begins and ends on a boundary near the ends of the chord, wherever it is shortest, or else at its ends. The
    layout stays.
    """
    for ends in (BAND, 0.0):
        path = _path(ground, start, end, ends)
        after = None if path is None else _kept(ground.after(path), path, least, limits)
        if after is not None:
            return after
    return None


def _path(ground: Ground, start: FloatArray, end: FloatArray, ends: float) -> IntArray | None:
    """Edges of the cheapest way near a chord; None if there is none."""
    (cut_mesh, uv), (edge, a, b) = ground.opened, ground.ways
    length = float(np.linalg.norm(end - start))
    step = float(np.median(np.linalg.norm(uv[a] - uv[b], axis=1))) if len(edge) else 0.0
    near = _distance(uv, start, end) <= BAND * length + 2 * step
    reach = ends * length + (step if ends else 0.0)
    starts, goals = (_beside(cut_mesh, uv, p, reach) for p in (start, end))
    return _cheapest_way(ground, near[a] & near[b], starts, goals)


def slit_open(ground: Ground) -> Atlas | None:
    """The atlas of a chart whose largest hole is joined to the outer loop; None if there is no way.

    The chart stays one and keeps its layout; a ring can be cut across then.
    """
    cut_mesh, uv = ground.opened
    loops = cut_mesh.loops
    vertex, ahead = ends_of(cut_mesh.faces, loops.half_edges)
    area = group_sum(cross2(uv[vertex], uv[ahead]), loops.loop_of, len(loops.chart))
    hole = int(np.where(loops.outer, -np.inf, np.abs(area)).argmax())
    starts, goals = vertex[loops.loop_of == hole], vertex[loops.outer[loops.loop_of]]
    path = _cheapest_way(ground, np.ones(len(ground.ways[0]), bool), starts, goals)
    return None if path is None else ground.after(path)


def _cheapest_way(
    ground: Ground, usable: BoolArray, starts: IntArray, goals: IntArray
) -> IntArray | None:
    """The edges of the cheapest way from one of some vertices to one of others; None if there is none.

    usable: which of the ``ways`` may be used. The path avoids the boundary in between.
    """
    if not usable.any() or not len(starts) or not len(goals):
        return None
    edge, a, b = (x[usable] for x in ground.ways)
    cut_mesh, costs = ground.opened[0], ground.costs[edge]
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


def _kept(atlas: Atlas, path: IntArray, least: float, limits: Limits) -> Atlas | None:
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
    if not least / ALIKE < float(cut_mesh.chart_areas.min()) < least * ALIKE:
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
    return atlas
