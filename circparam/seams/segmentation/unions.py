"""Unions of two charts laid out together: all of a round in one block system."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2, group_sum, next_half_edge
from circparam.core.monitor import Monitor
from circparam.geometry.overlap import crossings, self_overlapping
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.segmentation.state import CONE
from circparam.solvers import dirichlet
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.poisson import from_jacobians
from circparam.solvers.separate import push_apart

MANY = 300  # of more trials at once those that cross before any relaxation are left out, and none is pushed
SHALLOW = 2  # pairs of boundary edges that may cross before a union is relaxed


@dataclass(frozen=True)
class MergeOptions:
    """bound: no chart's energy exceeds it. tolerance: of the relaxation of a trial. untangle: rounds of the
    Poisson start. rounds: at most so many. margin: parts of one chart keep this share of the root of its area
    apart. cone: curvature of a vertex above which arcs end there. faces: no union has more (None: any may).
    """

    bound: float
    tolerance: float = 1e-3
    untangle: int = 12
    rounds: int = 80
    cone: float = CONE
    margin: float = 0.004
    faces: int | None = None


@dataclass(frozen=True, eq=False)
class Unions:
    """What may become one chart each. corners: (m, 3, 2) layouts as they are; in_right: (m,) bool, faces of the
    chart that is turned onto the other one."""

    cut_mesh: CutMesh
    corners: FloatArray
    in_right: BoolArray


@dataclass(frozen=True, eq=False)
class Tried:
    """Unions laid out: uv (nv, 2), and of each (n,) its energy, a floor of that, what is wrong."""

    uv: FloatArray
    energy: FloatArray
    floor: FloatArray
    distorted: BoolArray
    overlapping: BoolArray

    @staticmethod
    def nothing(cut_mesh: CutMesh) -> Tried:
        """Of unions that nothing is known of."""
        n = cut_mesh.n_charts
        none = np.zeros(n, bool)
        uv = np.zeros((cut_mesh.n_vertices, 2))
        return Tried(uv, np.full(n, np.inf), np.ones(n), none, none.copy())

    def put(self, some: BoolArray, vertices: IntArray, part: Tried) -> None:
        """Take over what is known of some unions ((n,) bool) with those vertices."""
        self.uv[vertices] = part.uv
        for mine, theirs in (
            (self.energy, part.energy),
            (self.floor, part.floor),
            (self.distorted, part.distorted),
            (self.overlapping, part.overlapping),
        ):
            mine[some] = theirs


def lay_out(unions: Unions, options: MergeOptions, crowd: bool, monitor: Monitor) -> Tried:
    """Start from both layouts, the right one turned onto the left; relax; push apart what only touches.

    crowd: there are so many that those that cross before any relaxation are left out, and none is pushed.
    """
    cut_mesh = unions.cut_mesh
    turn = _turns(cut_mesh, unions.corners, unions.in_right)
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jacobian = dirichlet.jacobians(gradients, unions.corners.transpose(2, 1, 0))
    cosine, sine = turn[:, 0][cut_mesh.chart], turn[:, 1][cut_mesh.chart]
    turned = np.stack(
        [cosine * jacobian[0] - sine * jacobian[1], sine * jacobian[0] + cosine * jacobian[1]]
    )
    targets = np.where(unions.in_right, turned, jacobian)
    # unions that stay flipped are given up: of 169 that were embedded anew 9 came out under the bound
    uv, _ = from_jacobians(cut_mesh, targets, options.untangle)
    tried = _relax(cut_mesh, uv, options, crowd)
    good = ~tried.distorted & ~tried.overlapping
    if good.any():
        sub, vid, _ = cut_mesh.subset(good)
        over = np.zeros(len(good), bool)
        over[good] = self_overlapping(sub, tried.uv[vid], margin=options.margin)
        if over.any() and not crowd:
            sub, vid, _ = cut_mesh.subset(over)
            pushed, fine = push_apart(sub, tried.uv[vid], options.margin, options.bound)
            kept = fine[sub.vertex_chart]
            tried.uv[vid[kept]] = pushed[kept]
            over[np.flatnonzero(over)[fine]] = False
        tried.overlapping[over] = True
    return tried


def _relax(cut_mesh: CutMesh, uv: FloatArray, options: MergeOptions, crowd: bool) -> Tried:
    """Relax the unions; those that overlap deep, or still do after two steps, are given up.

    Of 160 unions of two meshes that overlapped after two steps, 158 overlapped when they had converged; of
    some 400 of six meshes whose boundaries crossed more than twice before any step, all did.
    """
    steps = RelaxOptions(tolerance=options.tolerance, max_iterations=2, give_up=options.bound)
    tried = Tried.nothing(cut_mesh)
    tried.uv[:] = uv
    pairs = crossings(uv, cut_mesh)
    crossed = np.bincount(cut_mesh.chart[pairs[:, 0] // 3], minlength=cut_mesh.n_charts)
    tried.overlapping[:] = crossed > (0 if crowd else SHALLOW)
    live = ~tried.overlapping
    if live.any():
        sub, vid, _ = cut_mesh.subset(live)
        first = relax(sub, uv[vid], steps)
        tried.uv[vid] = first.uv
        tried.floor[live] = first.floor
        tried.energy[live] = first.energy
        live[live] = np.isfinite(first.energy) & np.array([r != "gave up" for r in first.stopped])
    if live.any():
        sub, vid, _ = cut_mesh.subset(live)
        tried.overlapping[live] = self_overlapping(sub, tried.uv[vid])
        live &= ~tried.overlapping
    if live.any():
        sub, vid, _ = cut_mesh.subset(live)
        rest = relax(sub, tried.uv[vid], dataclasses.replace(steps, max_iterations=23))
        tried.uv[vid] = rest.uv
        tried.energy[live] = rest.energy
        tried.floor[live] = np.maximum(tried.floor[live], rest.floor)
    tried.distorted[:] = ~tried.overlapping & ~(tried.energy <= options.bound)
    return tried


def _turns(cut_mesh: CutMesh, corners: FloatArray, in_right: BoolArray) -> FloatArray:
    """(n, 2) cosine and sine of the rotation that lays the right chart's side of the glued arc onto the left's.

    in_right: (m,) bool, faces of the right chart.
    """
    i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
    glued = in_right[i // 3] != in_right[j // 3]
    i, j = i[glued], j[glued]
    swap = in_right[i // 3]
    p, q = np.where(swap, j, i), np.where(swap, i, j)
    flat = corners.reshape(-1, 2)
    ep = flat[next_half_edge(p)] - flat[p]
    eq = flat[q] - flat[next_half_edge(q)]
    union = cut_mesh.chart[p // 3]
    cosine = group_sum((ep * eq).sum(1), union, cut_mesh.n_charts)
    sine = group_sum(cross2(eq, ep), union, cut_mesh.n_charts)
    length = np.hypot(cosine, sine)
    ok = length > 0
    safe = np.where(ok, length, 1.0)
    return np.stack([np.where(ok, cosine / safe, 1.0), np.where(ok, sine / safe, 0.0)], 1)
