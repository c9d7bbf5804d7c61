"""The objective of Newton's method: the symmetric Dirichlet energies of many charts at once."""

from functools import cached_property

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_count, group_sum, slices
from circparam.core.linalg import Factor, SparseMatrix, conjugate_gradients
from circparam.core.types import BoolArray, FloatArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet
from circparam.solvers.pattern import VertexPattern, hold, pattern_of
from circparam.solvers.preconditioner import (
    DIRECT_LIMIT,
    SMALL_CHART,
    BlockJacobi,
    CoarseSpace,
    TwoLevel,
    aggregates,
)

# A line search follows, so the direction of large charts need not be exact. Conjugate gradients end when the
# residual has fallen to this share (in the norm of the preconditioner), or after this many steps.
CG_TOLERANCE = 2e-2
CG_LIMIT = 60


class Objective:
    """The energy of every chart, Σ A E(J) / Σ A, its gradient and its Newton direction.

    cut_mesh: the charts, with n vertices and m faces. fixed: (n,) bool, vertices that stay where they are, or
    None. blend: share of the conformal energy. weight: (m,) factor of the area of each face, None for 1. The
    pattern of the Hessian and the coarse space of its preconditioner are made when first used, and kept.
    """

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
        self._coarse: CoarseSpace | None = None

    @cached_property
    def _pattern(self) -> VertexPattern:
        """The pattern of the Hessian with the vertices in their own order."""
        return VertexPattern(self.cut_mesh, None)

    def gather(self, uv: FloatArray, faces: slice = slice(None)) -> FloatArray:
        """(2, 3, m) uv of the corners (of some faces)."""
        corners = self.corners[:, faces]
        out = np.empty((2, *corners.shape))
        out[0], out[1] = uv[:, 0][corners], uv[:, 1][corners]
        return out

    def first_collapse(self, uv: FloatArray, d: FloatArray) -> FloatArray:
        """(m,) the step along d (n, 2) at which each face collapses (infinite if none)."""
        out = np.empty(len(self.weight))
        for k in slices(len(out)):
            out[k] = dirichlet.largest_step(self.gather(uv, k), self.gather(d, k))
        return out

    def energies(self, uv: FloatArray) -> tuple[FloatArray, FloatArray]:
        """((n_charts,) energy of each chart, infinite with a flipped face; Jacobians (2, 2, m))."""
        m = len(self.weight)
        jacobian, value = np.empty((2, 2, m)), np.empty(m)
        for k in slices(m):
            jacobian[..., k] = dirichlet.jacobians(self.gradients[..., k], self.gather(uv, k))
            value[k] = self.weight[k] * dirichlet.energy(jacobian[..., k], self.blend)
        energy = group_sum(value, self.cut_mesh.chart, self.cut_mesh.n_charts)
        return energy + self.cut_mesh.chart_roughness, jacobian

    def gradient(self, jacobian: FloatArray, uv: FloatArray) -> FloatArray:
        """(n, 2) gradient of the energies, zero at fixed vertices."""
        g = self.free_gradient(jacobian, uv)
        return g if self.fixed is None else np.where(self.fixed[:, None], 0.0, g)

    def free_gradient(self, jacobian: FloatArray, uv: FloatArray) -> FloatArray:
        """(n, 2) gradient as if no vertex were fixed."""
        corner = np.empty((2, 3, len(self.weight)))
        for k in slices(len(self.weight)):
            p = dirichlet.gradient(jacobian[..., k], self.blend) * self.weight[k]
            g = self.gradients[..., k]
            corner[..., k] = p[:, 0, None] * g[0] + p[:, 1, None] * g[1]
        flat = self.corners.ravel()
        n = self.cut_mesh.n_vertices
        return group_sum(corner.reshape(2, -1).T, flat, n)

    def stiffened(self, matrix: SparseMatrix, uv: FloatArray) -> SparseMatrix:
        """The Hessian at ``uv`` with additional stiffness; none here."""
        return matrix

    # iterations without a coarse space, for starts with local errors; None: to convergence
    local: int | None = None

    # whether the rows of a matrix that is factored may have an order of their own
    reordered = True

    def direction(
        self, uv: FloatArray, jacobian: FloatArray, g: FloatArray, proxy: bool
    ) -> FloatArray:
        """(n, 2) −H⁻¹ g, H the projected Hessian (or the quadratic proxy of SLIM); zero at fixed vertices."""
        blocks = self._blocks(jacobian, proxy)
        if self.cut_mesh.n_vertices <= DIRECT_LIMIT:
            step = self._factored(blocks, g, uv)
        else:
            step = self._by_size(self._hessian(blocks, uv), g, uv)
        if self.fixed is not None:
            # the coarse space of the iterative solver moves whole aggregates, including their fixed vertices
            return np.where(self.fixed[:, None], 0.0, -step)
        # no energy sees a chart move as a whole; rounding would let it drift until its faces lose their digits
        chart, n = self.cut_mesh.vertex_chart, self.cut_mesh.n_charts
        drift = group_sum(-step, chart, n) / group_count(chart, n)[:, None]
        return -step - drift[chart]

    def _blocks(self, jacobian: FloatArray, proxy: bool) -> FloatArray:
        """(2, 2, 3, m) blocks of the Hessian for the half-edges."""
        out = np.empty((2, 2, 3, len(self.weight)))
        for k in slices(len(self.weight)):
            if proxy:
                values, modes = dirichlet.proxy_modes(jacobian[..., k])
            else:
                values, modes = dirichlet.newton_modes(jacobian[..., k], self.blend)
            values *= self.weight[k]
            out[..., k] = dirichlet.edge_blocks(values, modes, self.gradients[..., k])
        return out

    def _factored(self, blocks: FloatArray, g: FloatArray, uv: FloatArray) -> FloatArray:
        """H⁻¹ g by factorisation; the order of elimination that the first one finds serves all others."""
        pattern = pattern_of(self.cut_mesh) if self.reordered else self._pattern
        matrix = self.stiffened(pattern.blocks(blocks), uv)
        if self.fixed is not None:
            hold(matrix, self.fixed[pattern.order])
        factor = Factor(matrix, pattern.ordered)
        if self.reordered and not pattern.ordered:
            self.cut_mesh.eliminated_in(pattern.elimination(factor, 2))
        return pattern.scatter(factor.solve(pattern.gather(g)))

    def _hessian(self, blocks: FloatArray, uv: FloatArray) -> SparseMatrix:
        """(2n, 2n) positive semidefinite, with unit rows (times a number) for fixed vertices."""
        matrix = self.stiffened(self._pattern.block_rows(blocks), uv)
        if self.fixed is not None:
            hold(matrix, self.fixed)
        return matrix

    def _by_size(self, matrix: SparseMatrix, g: FloatArray, uv: FloatArray) -> FloatArray:
        """Approximate matrix⁻¹ g: small charts are factored, large ones use conjugate gradients.

        Under one tolerance the worst charts would decide the accuracy of the small ones.
        """
        if self.local is not None:
            step = conjugate_gradients(matrix, g.ravel(), BlockJacobi(matrix), 0.0, self.local)
            return step.reshape(-1, 2)
        count = group_count(self.cut_mesh.vertex_chart, self.cut_mesh.n_charts)
        large = (count > SMALL_CHART)[self.cut_mesh.vertex_chart]
        if large.all():
            return self._iterated(matrix, g, uv, large)
        step = np.empty_like(g)
        small = np.repeat(~large, 2)
        rows = sps.csr_matrix(matrix)
        if self.fixed is not None:
            rows.eliminate_zeros()  # rows of fixed vertices would fill the factor
        # symmetric: the rows are the columns, which the factor wants
        step[~large] = Factor(rows[small][:, small].T).solve(g[~large].ravel()).reshape(-1, 2)
        if large.any():
            step[large] = self._iterated(rows[~small][:, ~small], g[large], uv, large)
        return step

    def _iterated(
        self, matrix: SparseMatrix, g: FloatArray, uv: FloatArray, large: BoolArray
    ) -> FloatArray:
        """Approximate matrix⁻¹ g by conjugate gradients, for the vertices of large charts ((n,) bool)."""
        if self._coarse is None:
            groups = aggregates(self.cut_mesh, uv)[large]
            groups = np.unique(groups, return_inverse=True)[1].reshape(-1)
            self._coarse = CoarseSpace(matrix, groups, uv[large])
        precondition = TwoLevel(matrix, self._coarse)
        rows = precondition.matrix
        step = conjugate_gradients(rows, g.ravel(), precondition, CG_TOLERANCE, CG_LIMIT)
        return step.reshape(-1, 2)


def in_units_of_faces(cut_mesh: CutMesh, uv: FloatArray) -> tuple[CutMesh, FloatArray, float]:
    """(cut mesh, layout, scale): both divided by the scale, the root of the mean area of a face."""
    scale = float(np.sqrt(cut_mesh.areas.mean()))
    return cut_mesh.in_units_of(scale), uv / scale, scale


def chart_energies(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(n_charts,) symmetric Dirichlet energy of every chart, mean over its area: 1 for an isometry.

    uv: (n_vertices, 2) in the units of the mesh. Infinite if a face is flipped or collapsed.
    """
    work, scaled, _ = in_units_of_faces(cut_mesh, uv)
    return Objective(work, None, 0.0).energies(scaled)[0]
