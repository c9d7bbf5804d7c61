"""Push parts of one chart's boundary apart where they overlap or nearly touch, at the least cost in distortion.

Each round finds the boundary vertices that lie beyond a facing part of the boundary, or too near to one.
One-sided springs w (1 − s / d)² join the symmetric Dirichlet energy there, while the signed distance s is below
the wanted distance d. Their weights rise until nothing overlaps. A penalty rather than the barrier of Smith and
Schaefer (2015), because the layouts that come here overlap already.
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    first_of_groups,
    group_count,
    group_sum,
    mask_of,
    next_half_edge,
    numbered,
    positions_in,
    unit,
)
from circparam.core.compiled import kd_tree
from circparam.core.linalg import SparseMatrix
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.boundary import BoundarySegments, boundary_in
from circparam.geometry.closest import centres, within
from circparam.geometry.intersect import meeting, nearby, segment_distance, windings
from circparam.geometry.overlap import wound_wrongly
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.newton import Iterate, newton_step
from circparam.solvers.objective import Objective, in_units_of_faces
from circparam.solvers.region import cut_out

PUSH_ROUNDS = 6
PUSH_STEPS = 2  # Newton steps between two looks at the boundaries
# share of the root of a chart's area that moves round a spring at first; twice that each round
MOVED_REACH = 0.05
# Faces of a chart that may move. Pushes of 40,000 to 270,000 faces never succeed and take most of the time
# (docs/experiments/merging.md).
WIDE_FACES = 30_000
# share of the root of a chart's area: parts deeper in each other are not pushed apart
DEEPEST_SHARE = 0.02
FACING_COSINE = -0.2  # cosine between outward normals below which two segments face each other
SPRING_WEIGHT = 1e-5  # of a spring at first; the energy of a chart is about 1
STIFFER_RATIO = 8.0  # times a round
# share of the root of a chart's area: distance of the test point outside a boundary
ASIDE_SHARE = 1e-6
AFFORDED_RATIO = 1.5  # times the bound's excess over 1: charts above it are not pushed
ALL_BOUNDARY = 0.5  # charts whose boundary is over this over the margin, in roots of area, are left
# rounds in which the conflicts of a chart must fall by the factor HEADWAY_RATIO, else it is left
PUSH_PATIENCE = 3
HEADWAY_RATIO = 0.9
# Share of the boundary in conflict above which a chart is not pushed: of 113 charts that separate the worst
# has 0.114 (docs/experiments/merging.md).
HOPELESS_SHARE = 0.13
PULL_MARGINS = 1.5  # times the margin: rest length of the springs, so that the margin is reached
LEAST_PULL = 1e-3  # share of the root of a chart's area: the same where there is no margin


@dataclass(frozen=True, eq=False)
class _Springs:
    """(k,) springs: a vertex against the point (1 − t) tail + t head, along the outward normal (k, 2) there.

    ends: (3, k) vertex, tail and head. A spring pulls while the signed distance s between the two along the
    normal is below ``distance``. Its strain is then 1 − s / distance, its energy weight · strain². chart: of
    the vertex.
    """

    ends: IntArray
    t: FloatArray
    normal: FloatArray
    distance: FloatArray
    weight: FloatArray
    chart: IntArray

    def strain(self, uv: FloatArray) -> FloatArray:
        """(k,) 1 − s / distance, not below 0."""
        t = self.t[:, None]
        vertex, tail, head = uv[self.ends]
        s = ((vertex - ((1 - t) * tail + t * head)) * self.normal).sum(1)
        return np.maximum(1 - s / self.distance, 0.0)

    @cached_property
    def slopes(self) -> tuple[IntArray, FloatArray]:
        """((k, 6) coordinates, (k, 6) derivative by them) of the strains that pull."""
        c = np.stack([np.ones(len(self.t)), self.t - 1, -self.t], 1) / -self.distance[:, None]
        column = 2 * self.ends.T[:, :, None] + np.arange(2)
        data = c[:, :, None] * self.normal[:, None]
        return column.reshape(-1, 6), data.reshape(-1, 6)

    @cached_property
    def squares(self) -> tuple[IntArray, IntArray, FloatArray]:
        """(rows, columns, values), (k, 36) each: the derivatives times their transposes."""
        at, slope = self.slopes
        value = slope[:, :, None] * slope[:, None, :]
        return np.repeat(at, 6, axis=1), np.tile(at, (1, 6)), value.reshape(-1, 36)


class _SpringObjective(Objective):
    """The symmetric Dirichlet energy of charts, with springs between parts of their boundaries."""

    def __init__(self, cut_mesh: CutMesh, fixed: BoolArray | None, springs: _Springs) -> None:
        super().__init__(cut_mesh, fixed, 0.0)
        self.springs = springs

    def energies(self, uv: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Energies with those of the springs, w strain², and the Jacobians."""
        value, jacobian = super().energies(uv)
        k = self.springs
        return value + group_sum(k.weight * k.strain(uv) ** 2, k.chart, len(value)), jacobian

    def free_gradient(self, jacobian: FloatArray, uv: FloatArray) -> FloatArray:
        """(nv, 2) gradient of the energies."""
        k = self.springs
        at, slope = k.slopes
        pull = slope * (2 * k.weight * k.strain(uv))[:, None]
        added = group_sum(pull.ravel(), at.ravel(), 2 * len(uv))
        return super().free_gradient(jacobian, uv) + added.reshape(-1, 2)

    reordered = False  # springs join any two vertices

    def stiffened(self, matrix: SparseMatrix, uv: FloatArray) -> SparseMatrix:
        """The Hessian with that of the springs that pull: 2 w times the squared derivative of the strain."""
        k = self.springs
        row, column, square = k.squares
        value = square * (2 * k.weight * (k.strain(uv) > 0))[:, None]
        n = 2 * len(uv)
        added = sps.csc_matrix((value.ravel(), (row.ravel(), column.ravel())), shape=(n, n))
        return sps.csc_matrix(matrix + added)


def push_apart(
    cut_mesh: CutMesh,
    uv: FloatArray,
    margin: float,
    bound: float,
    monitor: Monitor | None = None,
    chamfers: bool = False,
) -> tuple[FloatArray, BoolArray]:
    """Separate the overlapping parts of charts where the bound permits.

    uv: (nv, 2) without flips, about isometric. margin: share of the root of a chart's area that parts of its
    boundary should keep apart. Returns (uv, (n_charts,) bool: parts keep it, and the bound holds).
    """
    work, u, scale = in_units_of_faces(cut_mesh, uv)
    # charts above the bound are not worth a round, nor charts that are hardly more than their boundary
    limit, pull = 1 + AFFORDED_RATIO * (bound - 1), PULL_MARGINS * margin or LEAST_PULL
    around = group_sum(cut_mesh.loops.length, cut_mesh.loops.chart, cut_mesh.n_charts)
    todo = around * margin < ALL_BOUNDARY * np.sqrt(cut_mesh.chart_areas)
    charts, vertices = np.arange(len(todo)), np.arange(len(u))  # those still worked on
    fine, out = np.zeros(len(todo), bool), u.copy()
    weight = np.full(len(todo), SPRING_WEIGHT)
    conflicts: list[IntArray] = []
    for turn in range(PUSH_ROUNDS + 1):
        if not todo.any():
            break
        if not todo.all():
            work, kept, _ = work.subset(todo)
            u, vertices, charts, weight = u[kept], vertices[kept], charts[todo], weight[todo]
            conflicts = [count[todo] for count in conflicts]
            todo = np.ones(len(charts), bool)
        energy, _ = Objective(work, None, 0.0).energies(u)
        todo &= energy <= limit
        boundary = boundary_in(work, u)
        i, _, crowded = meeting(boundary, between=False)
        near = nearby(boundary, pull * boundary.size, todo, chamfers)
        close = segment_distance(*(x[k] for k in near for x in (boundary.start, boundary.end)))
        tight = near[0][close < margin * boundary.size[boundary.chart[near[0]]]]
        free = todo & (energy <= bound)
        free[boundary.chart[i]] = free[boundary.chart[tight]] = free[crowded] = False
        fine[charts[free]] = True
        todo &= ~free
        conflicts.append(group_count(boundary.chart[np.r_[i, tight]], len(todo)))
        if turn == 0:
            todo &= conflicts[0] < HOPELESS_SHARE * group_count(boundary.chart, len(todo))
        if turn >= PUSH_PATIENCE:
            todo &= conflicts[-1] < HEADWAY_RATIO * conflicts[turn - PUSH_PATIENCE]
        if turn == PUSH_ROUNDS or not todo.any() or (monitor is not None and monitor.expired):
            break
        springs, lost = _find(boundary, work.faces.ravel(), near, pull, weight, todo)
        todo &= ~lost
        if not todo.any():
            break
        u, wide = _moved(work, u, springs, MOVED_REACH * 2.0**turn * boundary.size)
        out[vertices] = u
        todo &= ~wide
        weight[todo] *= STIFFER_RATIO
    if fine.any():  # parts folded out of a hole, or wound twice, have no boundaries that meet
        part, kept, _ = cut_mesh.subset(fine)
        fine[fine] = ~wound_wrongly(part, out[kept], boundary_in(part, out[kept]))
    return out * scale, fine


def _moved(
    cut_mesh: CutMesh, uv: FloatArray, springs: _Springs, reach: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """The layout after a few Newton steps of the faces within reach ((n_charts,)) of a spring.

    Also returns the charts ((n_charts,) bool) that stay, because too many of their faces would have to move.
    """
    chart = cut_mesh.chart
    region = within(
        (centres(uv, cut_mesh.faces), chart), (uv[springs.ends[0]], springs.chart), reach
    )
    wide = group_count(chart[region], cut_mesh.n_charts) > WIDE_FACES
    region &= ~wide[chart]
    part, source, fixed = cut_out(cut_mesh, region, np.zeros(len(uv), bool))
    local = _in_part(springs, cut_mesh, part, source)
    if len(local.chart) == 0:
        return uv, wide
    objective = _SpringObjective(part, fixed if fixed.any() else None, local)
    at = Iterate(uv[source], *objective.energies(uv[source]))
    active = np.ones(part.n_charts, bool)
    for _ in range(PUSH_STEPS):
        at = newton_step(objective, at, active, proxy=False).to
    out = uv.copy()
    out[source] = at.uv  # fixed vertices have not moved
    return out, wide


def _in_part(springs: _Springs, whole: CutMesh, part: CutMesh, source: IntArray) -> _Springs:
    """The springs between vertices of a part, whose vertices are those of the whole in ``source`` (k,).

    One whose other side lies outside is left to a later, wider part. Energies are means over charts, so that
    the weights grow by the share of the chart that the part is.
    """
    ends = positions_in(whole.n_vertices, source)[springs.ends]
    inside = (ends >= 0).all(0)
    ends, old = ends[:, inside], springs.chart[inside]
    chart = part.vertex_chart[ends[0]]
    weight = springs.weight[inside] * (whole.chart_areas[old] / part.chart_areas[chart])
    t, normal, distance = (x[inside] for x in (springs.t, springs.normal, springs.distance))
    return _Springs(ends, t, normal, distance, weight, chart)


def _find(
    boundary: BoundarySegments,
    flat: IntArray,
    near: tuple[IntArray, IntArray],
    pull: float,
    weight: FloatArray,
    todo: BoolArray,
) -> tuple[_Springs, BoolArray]:
    """Springs for vertices that lie beyond a part of the boundary that faces them, or too near to it.

    near: pairs of segments. pull: share of the root of a chart's area, rest length of its springs. Returns the
    springs, the nearest of each vertex, and the charts ((n,) bool) with a vertex so deep in another part that
    no segment is within reach.
    """
    # a vertex is named by the segment that begins there
    live = np.flatnonzero(todo[boundary.chart])
    outward, covered = _outward(boundary, live)
    beyond = live[covered]
    a, b = _within_reach(boundary, beyond)
    a = np.r_[a, near[0], boundary.following[near[0]], near[1], boundary.following[near[1]]]
    b = np.r_[b, near[1], near[1], near[0], near[0]]
    keep = todo[boundary.chart[a]] & (a != b) & (a != boundary.following[b])
    a, b = a[keep], b[keep]
    along = boundary.end - boundary.start
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    normal = np.stack([along[:, 1], -along[:, 0]], 1) / length[:, None]
    out, over = np.zeros((len(along), 2)), np.zeros(len(along), bool)
    out[live], over[live] = outward, covered
    offset = boundary.start[a] - boundary.start[b]
    t = np.clip((offset * along[b]).sum(1) / length[b] ** 2, 0.0, 1.0)
    distance = np.linalg.norm(offset - t[:, None] * along[b], axis=1)
    side = (offset * normal[b]).sum(1)
    size = boundary.size[boundary.chart[b]]
    facing = (normal[b] * out[a]).sum(1) < FACING_COSINE
    deep = (side < 0) & (distance < DEEPEST_SHARE * size)
    keep = np.where(over[a], deep, (side >= 0) & facing)
    k = np.flatnonzero(keep)
    # a vertex at a notch may lie beyond sides that all face elsewhere
    k = k[first_of_groups(a[k], ~facing[k], distance[k], b[k])]
    lost = mask_of(len(todo), boundary.chart[np.setdiff1d(beyond, a[k])])
    if lost.any():
        k = k[~lost[boundary.chart[a[k]]]]
    # the mean of both normals: at two tips that touch, that of the nearest segment alone would jump about
    away = unit(normal[b[k]] - out[a[k]])
    tail = boundary.half_edge[b[k]]
    chart = boundary.chart[b[k]]
    ends = flat[np.stack([boundary.half_edge[a[k]], tail, next_half_edge(tail)])]
    return _Springs(ends, t[k], away, pull * size[k], weight[chart], chart), lost


def _within_reach(boundary: BoundarySegments, vertex: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of a boundary vertex and a segment of the same chart with its middle about within reach of the
    vertex."""
    if len(vertex) == 0:
        return vertex, vertex
    charts = mask_of(len(boundary.size), boundary.chart[vertex])
    segment = np.flatnonzero(charts[boundary.chart])
    middle = (boundary.start[segment] + boundary.end[segment]) / 2
    half = np.linalg.norm(boundary.end[segment] - boundary.start[segment], axis=1) / 2
    radius = DEEPEST_SHARE * boundary.size[boundary.chart[vertex]] + np.median(half)
    found = kd_tree(middle).query_ball_point(boundary.start[vertex], radius, return_sorted=True)
    count = np.fromiter(map(len, found), np.int64, len(found))
    a, b = np.repeat(vertex, count), segment[np.concatenate(found).astype(np.int64)]
    same = boundary.chart[a] == boundary.chart[b]
    return a[same], b[same]


def _outward(boundary: BoundarySegments, vertex: IntArray) -> tuple[FloatArray, BoolArray]:
    """((k, 2) outward normals of boundary vertices, (k,) bool: another part of the chart covers the vertex).

    vertex: (k,) the boundary segments that begin there.
    """
    v, inverse = numbered(vertex)
    place = boundary.start[v]
    leaves, back = boundary.end[v] - place, boundary.start[boundary.before[v]] - place
    # the middle of the wedge outside, counter-clockwise from the way back to the way on: right at slits too
    first = np.arctan2(back[:, 1], back[:, 0])
    turn = (np.arctan2(leaves[:, 1], leaves[:, 0]) - first) % (2 * np.pi)
    middle = first + turn / 2
    outward = np.stack([np.cos(middle), np.sin(middle)], 1)
    point = place + ASIDE_SHARE * boundary.size[boundary.chart[v], None] * outward
    covered = windings(boundary, point, boundary.chart[v]) != 0
    return outward[inverse], covered[inverse]
