"""Angle based flattening: ABF++ (Sheffer et al. 2005) and its one-solve form, Linear ABF (Zayer et al. 2007).

The angles of all charts are the unknowns of one Newton system. Its wheel condition has the logarithmic form, so
the first step from the rescaled angles is Linear ABF. The plane map is the conformal map of the triangles with
the new angles, which is exact where the angles fit together. Flips are possible.

A hole stays a hole. Its boundary counts as one inner vertex: its corners add up to the turn of a closed
boundary, its wheel closes, and the walk along it must come back to its start. These four conditions a hole are
all that a layout asks; on a plane the angles of the surface meet them as they are.
"""

from itertools import islice

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_max, group_sum, scattered
from circparam.core.linalg import Factor, gradient_iterates
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.registry import Row
from circparam.core.types import BoolArray, ComplexArray, FloatArray, IntArray
from circparam.errors import NoResultError
from circparam.geometry.intrinsic import corner_angles, vertex_angle_sums
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import CHECKED, FREE, Layout, MethodOptions, MethodRow
from circparam.methods.conformal import at_surface_area, conformal_spectral, start_modes
from circparam.methods.untangled import untangle_layout
from circparam.solvers.holes import hole_vertices
from circparam.solvers.tutte.embed import require_boundary

ABF_STEPS = 20
CONVERGED_RADIANS = 1e-9  # largest violation of a constraint, in radians (or logarithm)
PATIENCE_STEPS = 4  # steps without progress after which a chart is given up
MOST_CG_STEPS = 15  # conjugate gradient steps, each about a twentieth of a factorisation
# targets stay so far from 0 and π; angles above a twentieth of their target
LEAST_ANGLE_RADIANS = 1e-8


def abf(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor) -> Layout:
    """ABF++ on all charts; a chart on which Newton does not converge takes Linear ABF, which a note says."""
    require_boundary(cut_mesh)
    limit = 1 if options.linear else options.max_iterations or ABF_STEPS
    with monitor.stage("solve"):
        angles, steps, converged = solve_angles(cut_mesh, limit, monitor)
        notes = []
        if not options.linear and not converged.all():
            notes.append(
                f"abf: ABF++ did not converge on {int((~converged).sum())} charts; "
                "Linear ABF took its place there"
            )
        z, _ = conformal_spectral(with_angles(cut_mesh, angles), start_modes(cut_mesh))
        uv = at_surface_area(
            cut_mesh, np.stack([z.real, z.imag], 1), np.ones(cut_mesh.n_charts, bool)
        )
    uv, repairs = untangle_layout(cut_mesh, uv, "abf", options, monitor)
    reasons = ["solved" if options.linear or not c else "converged" for c in converged]
    return Layout(uv, steps, reasons, notes + repairs)


def with_angles(cut_mesh: CutMesh, angles: FloatArray) -> CutMesh:
    """The same cut mesh, each triangle with these angles (normalised to π) and its first side kept."""
    angles = angles * (np.pi / angles.sum(1))[:, None]
    first = cut_mesh.edge_lengths[:, 0]
    leg = first * np.sin(angles[:, 1]) / np.sin(angles[:, 2])
    rest_triangles = np.zeros_like(cut_mesh.rest_triangles)
    rest_triangles[:, 1, 0] = first
    rest_triangles[:, 2, 0] = leg * np.cos(angles[:, 0])
    rest_triangles[:, 2, 1] = leg * np.sin(angles[:, 0])
    return CutMesh(cut_mesh.faces, rest_triangles, cut_mesh.chart, cut_mesh.edges)


@dataclass(frozen=True, eq=False)
class _HoleBoundaries:
    """The boundaries of holes, walked: vertices (k,) in order, hole after hole, size (h,) of each."""

    cut_mesh: CutMesh
    vertices: IntArray
    size: IntArray

    def edges(self, alpha: FloatArray) -> ComplexArray:
        """(k,) the edge that leaves each vertex, as a complex number; those of a hole add up to 1 in length.

        At a vertex the walk turns by π less its corners, and the edge grows by the sines of its wheel.
        """
        log = np.log(np.sin(alpha))
        wheel = vertex_angle_sums(self.cut_mesh, log[:, [1, 2, 0]] - log[:, [2, 0, 1]])
        turn = np.pi - vertex_angle_sums(self.cut_mesh, alpha)
        first = np.cumsum(self.size) - self.size
        step = (1j * turn - wheel)[self.vertices]
        # the remaining defect of the hole is distributed, so that the first step starts near a closed walk
        lack = -2j * np.pi - np.add.reduceat(step, first)
        run = np.cumsum(step + np.repeat(lack / self.size, self.size))
        edge = np.exp(run - np.repeat(run[first], self.size))
        total = np.add.reduceat(np.abs(edge), first)
        return edge / np.repeat(total, self.size)

    def gaps(self, alpha: FloatArray) -> FloatArray:
        """(2h,) how far the walks miss their starts, as a share of their lengths: all x, then all y."""
        gap = np.add.reduceat(self.edges(alpha), np.cumsum(self.size) - self.size)
        return np.concatenate([gap.real, gap.imag])

    def jacobian(self, alpha: FloatArray) -> sps.csr_matrix:
        """(2h, 3m) derivatives of the gaps: a change at a vertex moves all later vertices."""
        f = self.cut_mesh.faces
        h, m = len(self.size), len(f)
        edge = self.edges(alpha)
        last = np.cumsum(self.size) - 1
        run = np.cumsum(edge)
        remaining = np.repeat(run[last], self.size) - run + edge
        remaining[last - self.size + 1] = 0.0  # the first edge stays where it is
        moved = np.zeros(self.cut_mesh.n_vertices, np.complex128)
        moved[self.vertices] = remaining
        hole = scattered(len(moved), self.vertices, np.repeat(np.arange(h), self.size))
        corner = np.arange(3 * m).reshape(m, 3)
        use = hole[f] >= 0
        at, pull, cot = hole[f][use], moved[f][use], 1 / np.tan(alpha)
        value = np.concatenate(
            [-1j * pull, -pull * cot[:, [1, 2, 0]][use], pull * cot[:, [2, 0, 1]][use]]
        )
        column = np.concatenate([corner[use], corner[:, [1, 2, 0]][use], corner[:, [2, 0, 1]][use]])
        moves = sps.csr_matrix((value, (np.tile(at, 3), column)), shape=(h, 3 * m))
        return sps.csr_matrix(sps.vstack([moves.real, moves.imag]))


@dataclass(frozen=True, eq=False)
class _AngleSystem:
    """target β, weight 2/β² (m, 3). row (n_vertices,): of inner vertices one each, then of holes one each,
    −1 on the outer boundary. goal (rows,): angle sum of each. holes: the walks that must close."""

    cut_mesh: CutMesh
    target: FloatArray
    weight: FloatArray
    row: IntArray
    goal: FloatArray
    holes: _HoleBoundaries

    @property
    def rows(self) -> int:
        """Number of inner vertices and holes."""
        return len(self.goal)

    def sums(self, corners: FloatArray) -> FloatArray:
        """(rows,) sum of corner values (m, 3) over each row."""
        row = self.row[self.cut_mesh.faces.ravel()]
        at = np.where(row >= 0, row, self.rows)
        return group_sum(corners.ravel(), at, self.rows + 1)[:-1]

    def residuals(self, alpha: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Violations: (faces (m,), angle sums (rows,), wheels (rows,))."""
        log = np.log(np.sin(alpha))
        wheel = self.sums(log[:, [1, 2, 0]] - log[:, [2, 0, 1]])
        return alpha.sum(1) - np.pi, self.sums(alpha) - self.goal, wheel

    def jacobian(self, alpha: FloatArray) -> sps.csr_matrix:
        """(2 rows, 3m): derivatives of the angle sums, then of the wheels."""
        f = self.cut_mesh.faces
        m = len(f)
        corner = np.arange(3 * m).reshape(m, 3)
        row = self.row[f]
        use = row >= 0
        cot = 1 / np.tan(alpha)
        after, before = [1, 2, 0], [2, 0, 1]
        wheel = self.rows + row[use]
        value = [np.ones(len(wheel)), cot[:, after][use], -cot[:, before][use]]
        column = [corner[use], corner[:, after][use], corner[:, before][use]]
        at = np.concatenate([row[use], wheel, wheel]), np.concatenate(column)
        return sps.csr_matrix((np.concatenate(value), at), shape=(2 * self.rows, 3 * m))


def _system(cut_mesh: CutMesh) -> _AngleSystem:
    """Targets: the angles on the surface, rescaled to 2π round inner vertices.

    Round a hole of k boundary edges the corners add up to (k + 2)π in every layout: the boundary turns by −2π.
    """
    angles = corner_angles(cut_mesh)
    inner = ~cut_mesh.on_boundary
    scale = np.ones(cut_mesh.n_vertices)
    sums = vertex_angle_sums(cut_mesh, angles)
    scale[inner] = 2 * np.pi / sums[inner]
    target = np.clip(
        angles * scale[cut_mesh.faces], LEAST_ANGLE_RADIANS, np.pi - LEAST_ANGLE_RADIANS
    )
    row = np.where(inner, np.cumsum(inner) - 1, -1)
    vertices, hole, size = hole_vertices(cut_mesh)
    row[vertices] = int(inner.sum()) + hole
    goal = np.concatenate([np.full(int(inner.sum()), 2 * np.pi), (size + 2) * np.pi])
    return _AngleSystem(
        cut_mesh, target, 2 / target**2, row, goal, _HoleBoundaries(cut_mesh, vertices, size)
    )


def solve_angles(
    cut_mesh: CutMesh, limit: int, monitor: Monitor
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Minimise Σ (α − β)²/β² under the planarity conditions, by Newton with the Hessian of the objective.

    Returns (angles (m, 3), steps (n_charts,), converged (n_charts,)). Charts that do not converge in ``limit``
    steps carry the angles of the first step, those of Linear ABF.
    """
    system = _system(cut_mesh)
    n, chart = cut_mesh.n_charts, cut_mesh.chart
    alpha = system.target
    linear = alpha
    lowest = 0.05 * system.target
    steps = np.zeros(n, np.int64)
    open_charts = np.ones(n, bool)
    converged = np.zeros(n, bool)
    best, best_at = np.full(n, np.inf), np.zeros(n, np.int64)
    solver = _StepSolver()
    row_chart = np.zeros(system.rows, np.int64)
    hole_chart = cut_mesh.loops.chart[~cut_mesh.loops.outer]
    row_chart[system.row[system.row >= 0]] = cut_mesh.vertex_chart[system.row >= 0]
    for iteration in range(limit):
        try:
            delta = _newton_step(system, alpha, solver)
        except NoResultError:
            break
        new = np.clip(alpha + delta, lowest, np.pi - LEAST_ANGLE_RADIANS)
        alpha = np.where(open_charts[chart][:, None], new, alpha)
        if iteration == 0:
            linear = new
        steps += open_charts
        face, angle, wheel = system.residuals(alpha)
        worst = group_max(np.abs(face), chart, n)
        for violation in (angle, wheel):
            worst = np.maximum(worst, group_max(np.abs(violation), row_chart, n))
        gap = np.abs(system.holes.gaps(alpha))
        worst = np.maximum(worst, group_max(gap, np.tile(hole_chart, 2), n))
        size = group_max(np.abs(delta).max(1), chart, n)
        worst = np.where(np.isfinite(worst), worst, np.inf)
        converged |= open_charts & (worst < CONVERGED_RADIANS) & (size < 1e-6)
        better = worst < 0.9 * best
        best, best_at = np.where(better, worst, best), np.where(better, iteration, best_at)
        open_charts &= ~converged & (iteration - best_at < PATIENCE_STEPS)
        monitor.update(iteration / limit, f"angle error {worst.max():.2g}")
        if not open_charts.any() or monitor.expired:
            break
    alpha = np.where(converged[chart][:, None], alpha, linear)
    return alpha, np.where(converged, steps, 1), converged


class _StepSolver:
    """Solver for the systems of successive steps. They change little, so the factor of an earlier one
    preconditions conjugate gradients well. A new factor is made only if the iterations become slow."""

    factor: Factor | None = None

    def solve(self, matrix: sps.csc_matrix, b: FloatArray) -> FloatArray:
        """x with matrix @ x = b, to rounding."""
        if self.factor is not None:
            target = 1e-13 * float(np.abs(b).max(initial=0.0))
            start = self.factor.solve(b)
            iterates = gradient_iterates(matrix, b, self.factor.solve, start)
            for x, residual, weight in islice(iterates, MOST_CG_STEPS):
                if float(np.abs(residual).max(initial=0.0)) <= target:
                    return x
                if not weight > 0:
                    break
        self.factor = Factor(matrix)
        return self.factor.solve(b)


def _newton_step(system: _AngleSystem, alpha: FloatArray, solver: _StepSolver) -> FloatArray:
    """δα (m, 3) of one step.

    With the Hessian Λ = diag(2/β²) the multipliers enter only through their new values. The step therefore
    solves min ½ δᵀΛδ + gᵀδ under the linearised conditions. The face conditions are eliminated first: their
    Schur complement is diagonal, three corners a face.
    """
    w = 1 / system.weight  # Λ⁻¹
    gradient = system.weight * (alpha - system.target)
    face, angle, wheel = system.residuals(alpha)
    J = sps.csr_matrix(sps.vstack([system.jacobian(alpha), system.holes.jacobian(alpha)]))
    b2 = -np.concatenate([angle, wheel, system.holes.gaps(alpha)])
    step = -w * gradient
    # project onto the face conditions: P = W − W 1 (1ᵀW1)⁻¹ 1ᵀ W on each face
    total = w.sum(1)
    step -= w * ((step.sum(1) + face) / total)[:, None]
    W = sps.diags(w.ravel())
    m = len(w)
    ones = sps.csr_matrix(
        (w.ravel() / np.sqrt(np.repeat(total, 3)), np.arange(3 * m), 3 * np.arange(m + 1)),
        shape=(m, 3 * m),
    )
    half = J @ ones.T
    schur = (J @ W @ J.T - half @ half.T).tocsc()
    d = schur.diagonal()
    schur = schur + sps.diags(1e-12 * d + 1e-300)
    multipliers = solver.solve(sps.csc_matrix(schur), b2 - J @ step.ravel())
    correction = (J.T @ multipliers).reshape(-1, 3) * w
    correction -= w * (correction.sum(1) / total)[:, None]
    return step + correction


ROW: MethodRow = Row(
    "abf",
    abf,
    "angle based flattening: angles",
    "Sheffer et al. 2005 (ABF++); Zayer et al. 2007 (linear)",
    FREE,
    CHECKED,
    frozenset({"linear"}),
)
