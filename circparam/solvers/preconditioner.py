"""Preconditioners of a Hessian with a 2 × 2 block for each pair of neighbouring vertices."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import ends_of, group_count, group_sum
from circparam.core.graph import components
from circparam.core.linalg import Factor, SparseMatrix
from circparam.core.types import FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh

# Number of vertices from which conjugate gradients with the two-level preconditioner are faster than a
# factorisation of the Hessian (measured on disks of 5k to 400k faces).
DIRECT_LIMIT = 3000
SMALL_CHART = 1000  # vertices up to which charts of larger systems are solved by factorisation
AGGREGATE_SIZE = 60  # vertices in one aggregate of the coarse space


def aggregates(cut_mesh: CutMesh, uv: FloatArray) -> IntArray:
    """(nv,) connected groups of about AGGREGATE_SIZE vertices of one chart that lie together in the layout."""
    n = cut_mesh.n_vertices
    chart = cut_mesh.vertex_chart
    count = group_count(chart, cut_mesh.n_charts)
    side = np.sqrt(cut_mesh.chart_areas / count * AGGREGATE_SIZE)[chart]
    cell = np.floor(uv / side[:, None]).astype(np.int64)
    cell -= cell.min(0)
    span = cell.max(0) + 1
    key = (chart * span[0] + cell[:, 0]) * span[1] + cell[:, 1]
    tail, head = ends_of(cut_mesh.faces, np.r_[cut_mesh.edges[:, 0], cut_mesh.boundary])
    same = key[tail] == key[head]
    return components(n, tail[same], head[same])[1]


class BlockJacobi:
    """The inverse of the 2 × 2 diagonal blocks, as a preconditioner."""

    def __init__(self, matrix: SparseMatrix) -> None:
        if isinstance(matrix, sps.bsr_matrix):
            row = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
            a, b, c, d = matrix.data[matrix.indices == row].reshape(-1, 4).T
        else:
            main, above, below = (matrix.diagonal(k) for k in (0, 1, -1))
            a, b, c, d = main[::2], above[::2], below[::2], main[1::2]
        self.inverse = np.stack([d, -b, -c, a]) / (a * d - b * c)

    def __call__(self, r: FloatArray) -> FloatArray:
        """The blocks times the residual (2n,)."""
        a, b, c, d = self.inverse
        x, y = r[::2], r[1::2]
        out = np.empty_like(r)
        out[::2], out[1::2] = a * x + b * y, c * x + d * y
        return out


class CoarseSpace:
    """Affine motions of each aggregate, and how a matrix acts on them (Galerkin), factored.

    The six modes of an aggregate (constants and linear functions for both coordinates) span the errors that
    block Jacobi damps slowly. A Hessian changes little from step to step there, so one serves all steps.
    """

    def __init__(self, matrix: SparseMatrix, agg: IntArray, uv: FloatArray) -> None:
        n = len(agg)
        na = int(agg.max()) + 1
        size = group_count(agg, na).astype(np.float64)
        centre = group_sum(uv, agg, na) / size[:, None]
        offset = uv - centre[agg]
        radius = np.sqrt(np.bincount(agg, (offset**2).sum(1), na) / size) + 1e-300
        modes = np.c_[np.ones(n), offset / radius[agg][:, None]]
        modes[size[agg] < 4, 1:] = 0.0  # too few vertices to separate the linear modes
        data = np.repeat(modes[:, None, :], 2, axis=1).ravel()
        column = 6 * agg[:, None, None] + np.array([[0, 1, 2], [3, 4, 5]])[None]
        prolong = sps.csr_matrix(
            (data, column.ravel(), 3 * np.arange(2 * n + 1)), shape=(2 * n, 6 * na)
        )
        if isinstance(matrix, sps.bsr_matrix):  # by blocks it takes half
            both = np.zeros((n, 2, 6))
            both[:, 0, :3] = both[:, 1, 3:] = modes
            blocks = sps.bsr_matrix((both, agg, np.arange(n + 1)), shape=(2 * n, 6 * na))
            coarse = (blocks.T @ (matrix @ blocks)).tocsc()
            coarse.eliminate_zeros()
        else:
            coarse = (prolong.T @ (sps.csr_matrix(matrix) @ prolong)).tocsc()
        d = coarse.diagonal()
        coarse = coarse + sps.diags(np.where(d > 0, 1e-7 * d, 1.0))
        self._prolong, self._restrict = prolong, prolong.T.tocsr()
        self._factor = Factor(sps.csc_matrix(coarse))

    def correction(self, r: FloatArray) -> FloatArray:
        """(2n,) the motion of the aggregates that the residual (2n,) asks for."""
        return self._prolong @ self._factor.solve(self._restrict @ r)


class TwoLevel(BlockJacobi):
    """Block Jacobi with a coarse space: a preconditioner.

    Smoothing on both sides keeps it symmetric, as conjugate gradients need.
    """

    def __init__(self, matrix: SparseMatrix, coarse: CoarseSpace) -> None:
        super().__init__(matrix)
        self.coarse = coarse
        # products with vectors take a third less by rows than by blocks
        self.matrix = sps.csr_matrix(matrix)

    def __call__(self, r: FloatArray) -> FloatArray:
        """One symmetric V-cycle: smooth, correct on the coarse space, smooth."""
        x = 0.6 * super().__call__(r)
        x = x + self.coarse.correction(r - self.matrix @ x)
        return x + 0.6 * super().__call__(r - self.matrix @ x)
