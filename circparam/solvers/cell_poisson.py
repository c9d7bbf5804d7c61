"""The layout with given Jacobians, from a start that is right except near a few cells of a coarse surface.

Conjugate gradients with two preconditioners: the diagonal, and a system with one number for each cell. There
are a twelfth as many cells as vertices, so the cost is linear in the faces, and no factor of the mesh is
stored.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import FloatArray, IntArray, group_sum, slices
from circparam.core.linalg import Factor, conjugate_gradients
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet
from circparam.solvers.poisson import clamp_stretch, divergence, laplacian

RESIDUAL_RATIO = 1e-3  # residual at which the iteration ends, in the norm of the preconditioner
MOST_ITERATIONS = 80  # iterations at most; from the layout of a level it takes 20 to 60
RIDGE_SHARE = 1e-9  # of the diagonal of the cells, since no system sees a chart move as a whole
CLAMPING_ROUNDS = 3  # of clamping: of the flips of a rough mesh they leave a twentieth
CLAMPED_ITERATIONS = 10  # iterations after each
LEAST_STRETCH = 0.6  # the least singular value that a target keeps


class CellPoisson:
    """Σ area |J(u) − target|² over the layouts u of a cut mesh.

    cell: (nv,) labels 0..k−1, any: cells that hang together within a chart serve best.
    """

    def __init__(self, cut_mesh: CutMesh, cell: IntArray) -> None:
        self.cut_mesh, self.cell = cut_mesh, cell
        self.gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
        self.matrix = laplacian(cut_mesh)
        diagonal = self.matrix.diagonal()
        self.inverse = 1 / np.where(diagonal > 0, diagonal, 1.0)
        n = len(cell)
        self.cells = int(cell.max(initial=-1)) + 1
        sums = sps.csr_matrix((np.ones(n), cell, np.arange(n + 1)), shape=(n, self.cells))
        coarse = sums.T @ self.matrix @ sums
        diagonal = coarse.diagonal()
        coarse = coarse + sps.diags(np.where(diagonal > 0, RIDGE_SHARE * diagonal, 1.0))
        self.coarse = Factor(sps.csc_matrix(coarse))

    def precondition(self, r: FloatArray) -> FloatArray:
        """(nv,) approximation of the inverse Laplacian times the residual (nv,)."""
        return self.inverse * r + self.coarse.solve(group_sum(r, self.cell, self.cells))[self.cell]

    def towards(
        self, targets: FloatArray, start: FloatArray, limit: int = MOST_ITERATIONS
    ) -> FloatArray:
        """(nv, 2) about the layout with these Jacobians (2, 2, m), from ``start`` (nv, 2) on."""
        right = divergence(self.cut_mesh, self.gradients, targets)
        columns = [
            conjugate_gradients(self.matrix, b, self.precondition, RESIDUAL_RATIO, limit, x)
            for b, x in zip(right.T, start.T, strict=True)
        ]
        return np.stack(columns, axis=1)

    def unfolded(self, uv: FloatArray) -> FloatArray:
        """The layout (nv, 2) with few of the flips it had, by rounds of clamping the stretch of its faces.

        Parts stretched by at most 1 / ``LEAST_STRETCH`` keep their shape (local and global steps: Liu 2008).
        """
        faces, targets = self.cut_mesh.faces, np.empty((2, 2, len(self.cut_mesh.faces)))
        for _ in range(CLAMPING_ROUNDS):
            flipped = False
            for k in slices(len(faces)):
                jacobian = dirichlet.jacobians(self.gradients[..., k], uv.T[:, faces[k].T])
                flipped |= not (dirichlet.determinants(jacobian) > 0).all()
                targets[..., k] = clamp_stretch(jacobian, LEAST_STRETCH)
            if not flipped:
                break
            uv = self.towards(targets, uv, CLAMPED_ITERATIONS)
        return uv
