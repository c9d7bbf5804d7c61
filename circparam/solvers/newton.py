"""Relax layouts by projected Newton on the symmetric Dirichlet energy, all charts in one system.

Every chart has its own step length, energy and stopping test; the Hessian is one block matrix. A step never
reaches the first collapse of a face, so a layout that starts without a flipped face ends without one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_count, group_min, group_sum
from circparam.core.linalg import SparseMatrix
from circparam.core.monitor import Monitor
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet
from circparam.solvers.preconditioner import (
    DIRECT_LIMIT,
    SMALL_CHART,
    BlockPattern,
    TwoLevel,
    aggregates,
    conjugate_gradients,
    solve_direct,
)

ARMIJO = 1e-4
SAFETY = 0.9  # share of the way to the first collapse that a step may go
BAD_START = 20.0  # energy above which the SLIM proxy leads better than the Hessian
PROXY_STEPS = 4
HOPE = 1.2  # a chart is not expected to win more than this many times its last full step again
STRIDE = (
    1.15  # a full step that wins this many times what the model said is followed by longer ones
)
STRIDES = (2.0, 4.0, 8.0)


@dataclass(frozen=True)
class RelaxOptions:
    """When to stop.

    tolerance: a chart has converged when the decrease that Newton's model predicts is below this share of its
    energy. max_iterations: bound on the steps. bound: charts whose energy falls to it stop there (None: none
    do). give_up: charts that Newton's model sees staying above this energy stop (None: none do).
    fixed: (nv,) bool, vertices that stay where they are. blend: share of the conformal energy. weight: (m,)
    positive factor of the area of each face in the energy (None: 1); energies are those with the weights then.
    """

    tolerance: float = 1e-6
    max_iterations: int = 200
    bound: float | None = None
    give_up: float | None = None
    fixed: BoolArray | None = None
    blend: float = 0.0
    weight: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Relaxed:
    """uv (nv, 2); energy, iterations (n_charts,); stopped: why each chart stopped.

    floor: (n_charts,) what the energy will hardly fall below, as far as the last steps tell.
    """

    uv: FloatArray
    energy: FloatArray
    floor: FloatArray
    iterations: IntArray
    stopped: list[str]


class System:
    """The charts that still move: cut mesh in components-first arrays, with their pattern."""

    def __init__(
        self,
        cut_mesh: CutMesh,
        fixed: BoolArray | None,
        blend: float,
        weight: FloatArray | None = None,
    ) -> None:
        self.cut_mesh = cut_mesh
        self.blend = blend
        self.fixed = fixed
        self.gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
        self.weight = cut_mesh.areas / cut_mesh.chart_areas[cut_mesh.chart]
        if weight is not None:
            self.weight = self.weight * weight
        self.corners = cut_mesh.faces.T.copy()
        self.pattern: BlockPattern | None = None
        self.agg: IntArray | None = None
        self.large: BoolArray | None = None  # (nv,) vertices of charts that are solved by iteration

    def gather(self, uv: FloatArray) -> FloatArray:
        """(2, 3, m) uv of the corners."""
        return np.stack([uv[:, 0][self.corners], uv[:, 1][self.corners]])

    def energies(self, uv: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n_charts,) energy of each chart, and the Jacobians."""
        jacobian = dirichlet.jacobians(self.gradients, self.gather(uv))
        value = self.weight * dirichlet.energy(jacobian, self.blend)
        return group_sum(value, self.cut_mesh.chart, self.cut_mesh.n_charts), jacobian

    def vertex_gradient(self, jacobian: FloatArray, uv: FloatArray) -> FloatArray:
        """(nv, 2) gradient of the energies."""
        p = dirichlet.gradient(jacobian, self.blend) * self.weight
        corner = p[:, 0, None] * self.gradients[0] + p[:, 1, None] * self.gradients[1]
        flat = self.corners.ravel()
        n = self.cut_mesh.n_vertices
        return np.stack([group_sum(corner[d].ravel(), flat, n) for d in range(2)], 1)

    def direction(
        self, uv: FloatArray, jacobian: FloatArray, g: FloatArray, proxy: bool
    ) -> FloatArray:
        """(nv, 2) the Newton direction (or the SLIM proxy's)."""
        if self.pattern is None:
            self.pattern = BlockPattern(self.cut_mesh)
        if proxy:
            values, directions = dirichlet.proxy_modes(jacobian)
        else:
            values, directions = dirichlet.newton_modes(jacobian, self.blend)
        blocks = dirichlet.edge_blocks(values * self.weight, directions, self.gradients)
        matrix = self.stiffened(self.pattern.assemble(blocks))
        if self.fixed is not None:
            matrix = _hold(matrix, self.fixed)
            g = np.where(self.fixed[:, None], 0.0, g)
        if self.cut_mesh.n_vertices <= DIRECT_LIMIT:
            return -solve_direct(matrix, g)
        if self.large is None:
            count = group_count(self.cut_mesh.vertex_chart, self.cut_mesh.n_charts)
            self.large = (count > SMALL_CHART)[self.cut_mesh.vertex_chart]
        if self.large.all():
            return -self._iterated(matrix, g, uv, self.pattern, self.large)
        # with one tolerance for all, the charts that are worst off decide how well the small are solved
        step = np.empty_like(g)
        small = np.repeat(~self.large, 2)
        rows = sps.csr_matrix(matrix)
        step[~self.large] = solve_direct(rows[small][:, small], g[~self.large])
        if self.large.any():
            step[self.large] = self._iterated(
                rows[~small][:, ~small], g[self.large], uv, self.pattern, self.large
            )
        return -step

    def _iterated(
        self,
        matrix: SparseMatrix,
        g: FloatArray,
        uv: FloatArray,
        pattern: BlockPattern,
        large: BoolArray,
    ) -> FloatArray:
        """About matrix⁻¹ g by conjugate gradients, for the vertices of large charts."""
        if self.agg is None:
            agg = aggregates(self.cut_mesh, pattern, uv)[large]
            self.agg = np.unique(agg, return_inverse=True)[1].reshape(-1)
        precondition = TwoLevel(matrix, self.agg, uv[large])
        step = conjugate_gradients(matrix, g.ravel(), precondition, 2e-2, 60)
        return step.reshape(-1, 2)

    def stiffened(self, matrix: sps.bsr_matrix) -> SparseMatrix:
        """The Hessian with whatever else resists the motion; here nothing does."""
        return matrix


def _hold(matrix: SparseMatrix, fixed: BoolArray) -> SparseMatrix:
    """The matrix with identity rows and columns (times a number) for fixed vertices."""
    held = np.repeat(fixed, 2)
    moves = sps.diags(np.where(held, 0.0, 1.0))
    size = float(np.abs(matrix.diagonal()).mean())
    return sps.csr_matrix(moves @ matrix @ moves + sps.diags(np.where(held, size, 0.0)))


def relax(
    cut_mesh: CutMesh, uv: FloatArray, options: RelaxOptions, monitor: Monitor | None = None
) -> Relaxed:
    """Minimise the symmetric Dirichlet energy of every chart from a layout without flipped faces.

    uv: (nv, 2) in the units of the mesh. Charts that start with a flipped or collapsed face are left as they
    are and their energy is infinite. Source of the steps: Smith and Schaefer (2015); of the eigensystem: Smith,
    Goes and Kim (2019).
    """
    scale = np.sqrt(cut_mesh.areas.mean())
    work = replace(cut_mesh, rest_triangles=cut_mesh.rest_triangles / scale)
    out = uv / scale
    n = cut_mesh.n_charts
    iterations = np.zeros(n, np.int64)
    stopped = np.full(n, "iterations", dtype=object)
    floor = np.ones(n)
    weight = options.weight
    system = System(work, options.fixed, options.blend, weight)
    energy, jacobian = system.energies(out)
    stopped[~np.isfinite(energy)] = "flipped start"
    active = np.isfinite(energy)
    if options.bound is not None:
        stopped[active & (energy <= options.bound)] = "bound"
        active &= energy > options.bound
    charts = np.arange(n)  # charts, vertices of the whole that the system holds
    vertices = np.arange(cut_mesh.n_vertices)
    fresh = True
    for step in range(options.max_iterations):
        if not active.any():
            break
        if monitor is not None and monitor.expired:
            stopped[active] = "time"
            break
        inside = active[charts]
        share = (
            work.areas.size
            and np.bincount(system.cut_mesh.chart, minlength=len(charts))[inside].sum()
        )
        if share < 0.8 * len(system.cut_mesh.faces):
            sub, vid, fid = system.cut_mesh.subset(inside)
            charts, vertices = charts[inside], vertices[vid]
            held = None if options.fixed is None else options.fixed[vertices]
            weight = None if weight is None else weight[fid]
            system = System(sub, held, options.blend, weight)
            inside = np.ones(len(charts), bool)
            fresh = True
        u = out[vertices]
        e = energy[charts]
        if fresh:
            e, jacobian = system.energies(u)
            fresh = False
        proxy = bool(step < PROXY_STEPS and e[inside].max() > BAD_START)
        moved = newton_step(system, u, e, jacobian, inside, proxy)
        u, e1, jacobian, predicted, lengths = moved
        progress, full = lengths > 0, lengths > 0.5
        gain = np.where(inside, e, 0.0) - np.where(inside, e1, 0.0)
        expected = np.where(full, e1 - HOPE * gain, 1.0)
        floor[charts] = np.where(inside, np.maximum(floor[charts], expected), floor[charts])
        out[vertices] = u
        iterations[charts] += inside
        energy[charts] = e1
        done = inside & (predicted <= options.tolerance * e1) & (not proxy)
        stuck = inside & ~progress & ~done
        stopped[charts[done]] = "converged"
        stopped[charts[stuck]] = "no descent"
        finished = done | stuck
        if options.give_up is not None and step > 0:
            hopeless = inside & full & ~finished & (floor[charts] > options.give_up)
            stopped[charts[hopeless]] = "gave up"
            finished |= hopeless
        if options.bound is not None:
            reached = inside & (e1 <= options.bound) & ~finished
            stopped[charts[reached]] = "bound"
            finished |= reached
        active[charts[finished]] = False
        if monitor is not None:
            monitor.update(
                1 - active.mean(), f"energy {energy[np.isfinite(energy)].max(initial=0):.5g}"
            )
    out *= scale
    if options.fixed is not None:  # to scale and back changes last bits
        out[options.fixed] = uv[options.fixed]
    return Relaxed(out, energy, floor, iterations, [str(s) for s in stopped])


def newton_step(
    system: System,
    u: FloatArray,
    e: FloatArray,
    jacobian: FloatArray,
    inside: BoolArray,
    proxy: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """One damped step of every active chart: (uv, energies, Jacobians, predicted decrease, step lengths)."""
    p = system.cut_mesh
    n = p.n_charts
    safe = np.where(np.isfinite(e)[p.chart], jacobian, np.eye(2)[:, :, None])
    g = system.vertex_gradient(safe, u)
    if system.fixed is not None:
        g = np.where(system.fixed[:, None], 0.0, g)
    d = system.direction(u, safe, g, proxy)
    if system.fixed is not None:
        # the coarse space of the iterative solver moves whole aggregates, and with them what is fixed
        d = np.where(system.fixed[:, None], 0.0, d)
    else:
        # no energy sees a chart move as a whole; rounding would let it drift until its faces lose their digits
        count = group_count(p.vertex_chart, n)
        drift = np.stack([group_sum(d[:, k], p.vertex_chart, n) / count for k in range(2)], 1)
        d = d - drift[p.vertex_chart]
    slope = group_sum((g * d).sum(1), p.vertex_chart, n)
    bad = ~(slope <= 0)
    if bad.any():  # the model failed (rounding): go down the gradient instead
        d = np.where(bad[p.vertex_chart][:, None], -g, d)
        slope = group_sum((g * d).sum(1), p.vertex_chart, n)
    reach = group_min(dirichlet.largest_step(system.gather(u), system.gather(d)), p.chart, n)
    t = np.where(inside & np.isfinite(e), np.minimum(1.0, SAFETY * reach), 0.0)
    for _ in range(40):
        trial = u + t[p.vertex_chart][:, None] * d
        e1, j1 = system.energies(trial)
        with np.errstate(invalid="ignore"):
            bad = (t > 0) & ~(e1 <= e + ARMIJO * t * slope)
        if not bad.any():
            break
        t[bad] = np.where(t[bad] < 1e-10, 0.0, t[bad] / 2)
    if not proxy:
        trial, e1, j1, t = _stride(system, u, d, (trial, e1, j1, t), e, slope, reach)
    return trial, e1, j1, -slope / 2, t


def _stride(
    system: System,
    u: FloatArray,
    d: FloatArray,
    found: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    e: FloatArray,
    slope: FloatArray,
    reach: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Longer steps for charts whose full step won more than the model said.

    A face that is nearly collapsed, at width x, has the energy 1/x², of which a Newton step wins 7/16 where
    its model promises 1/3: it only grows x by a third, and a start with such faces needs dozens of full steps.
    """
    trial, e1, j1, t = found
    p = system.cut_mesh
    with np.errstate(invalid="ignore"):
        far = (t == 1) & (e - e1 > -STRIDE * slope / 2)
    for length in STRIDES:
        far &= SAFETY * reach >= length
        if not far.any():
            break
        longer = np.where(far, length, t)
        u2 = u + longer[p.vertex_chart][:, None] * d
        e2, j2 = system.energies(u2)
        with np.errstate(invalid="ignore"):
            far &= e2 < e1
        keep = far[p.vertex_chart]
        trial = np.where(keep[:, None], u2, trial)
        j1 = np.where(far[p.chart], j2, j1)
        e1, t = np.where(far, e2, e1), np.where(far, length, t)
    return trial, e1, j1, t
