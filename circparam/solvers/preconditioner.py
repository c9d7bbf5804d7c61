"""One block matrix for all charts: the 2 × 2 vertex blocks of a Hessian, with a pattern computed once."""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    group_count,
    group_sum,
    next_half_edge,
    stable_order,
)
from circparam.core.graph import components
from circparam.core.linalg import Factor, SparseMatrix
from circparam.mesh.cut_mesh import CutMesh

# Number of vertices from which conjugate gradients with the two-level preconditioner are faster than a
# factorisation of the Hessian (measured on disks of 5k to 400k faces).
DIRECT_LIMIT = 3000
SMALL_CHART = 1000  # vertices up to which charts of larger systems are solved by factorisation
AGGREGATE_SIZE = 60  # vertices in one aggregate of the coarse space


class BlockPattern:
    """Where the blocks of the edges and vertices of the cut mesh stand in a block-sparse-row matrix."""

    def __init__(self, cut_mesh: CutMesh) -> None:
        flat = cut_mesh.faces.ravel()
        i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
        first = np.concatenate([i, cut_mesh.boundary])
        tail, head = flat[first], flat[next_half_edge(first)]
        n = cut_mesh.n_vertices
        rows = np.concatenate([tail, head, np.arange(n)])
        columns = np.concatenate([head, tail, np.arange(n)])
        self.n = n
        self.chart = cut_mesh.vertex_chart
        self.count = np.maximum(group_count(self.chart, cut_mesh.n_charts), 1)
        m = len(cut_mesh.faces)
        # half-edge k of face f is entry k m + f of the blocks
        self.inner = i % 3 * m + i // 3, j % 3 * m + j // 3
        self.boundary = cut_mesh.boundary % 3 * m + cut_mesh.boundary // 3
        self.tail, self.head = tail, head
        order = stable_order(columns)
        order = order[stable_order(rows[order])]
        self.place = np.empty(len(order), np.int64)  # of each of those pairs in the matrix
        self.place[order] = np.arange(len(order))
        self.indices = columns[order].astype(np.int32)
        self.indptr = np.r_[0, np.cumsum(group_count(rows, n))].astype(np.int32)
        self.diagonal = np.flatnonzero(rows[order] == columns[order])

    def assemble(self, blocks: FloatArray) -> sps.bsr_matrix:
        """The matrix from half-edge blocks (2, 2, 3, m) as made by dirichlet.edge_blocks."""
        flat = blocks.reshape(2, 2, -1)
        (i, j), rim = self.inner, self.boundary
        data = np.zeros((len(self.place), 2, 2))
        count = len(i) + len(rim)
        ahead, back = self.place[:count], self.place[count : 2 * count]
        for a in range(2):
            for b in range(2):
                edge = np.concatenate([flat[a, b, i] + flat[b, a, j], flat[a, b, rim]])
                data[ahead, a, b] = edge
                data[back, b, a] = edge
        diagonal = -np.add.reduceat(data, self.indptr[:-1], axis=0)
        # a small ridge: the energy is invariant under rigid motions of a chart
        trace = diagonal[:, 0, 0] + diagonal[:, 1, 1]
        mean = group_sum(trace, self.chart, len(self.count)) / self.count
        ridge = 1e-9 * trace + 1e-13 * mean[self.chart]
        diagonal[:, 0, 0] += ridge
        diagonal[:, 1, 1] += ridge
        data[self.diagonal] = diagonal
        return sps.bsr_matrix((data, self.indices, self.indptr), shape=(2 * self.n, 2 * self.n))


def hold_blocks(matrix: sps.bsr_matrix, fixed: BoolArray) -> None:
    """As ``pattern.hold``, of a matrix of blocks whose rows are the vertices in their own order."""
    size = float(np.abs(matrix.diagonal()).mean())
    row = np.repeat(np.arange(len(fixed)), np.diff(matrix.indptr))
    matrix.data[fixed[row] | fixed[matrix.indices]] = 0.0
    matrix.data[fixed[row] & (matrix.indices == row)] = size * np.eye(2)


def solve_direct(matrix: SparseMatrix, b: FloatArray) -> FloatArray:
    """matrix⁻¹ b by factorisation; b is (n, 2). The matrix is symmetric."""
    rows = matrix.tocsr()
    columns = sps.csc_matrix((rows.data, rows.indices, rows.indptr), shape=rows.shape)
    return Factor(columns).solve(b.ravel()).reshape(-1, 2)


def aggregates(cut_mesh: CutMesh, pattern: BlockPattern, uv: FloatArray) -> IntArray:
    """(nv,) connected groups of about AGGREGATE_SIZE vertices of one chart that lie together in the layout."""
    n = cut_mesh.n_vertices
    chart = cut_mesh.vertex_chart
    count = group_count(chart, cut_mesh.n_charts)
    side = np.sqrt(cut_mesh.chart_areas / count * AGGREGATE_SIZE)[chart]
    cell = np.floor(uv / side[:, None]).astype(np.int64)
    cell -= cell.min(0)
    span = cell.max(0) + 1
    key = (chart * span[0] + cell[:, 0]) * span[1] + cell[:, 1]
    same = key[pattern.tail] == key[pattern.head]
    return components(n, pattern.tail[same], pattern.head[same])[1]


def _diagonal_blocks(matrix: SparseMatrix) -> FloatArray:
    """(n, 2, 2) blocks on the diagonal."""
    if isinstance(matrix, sps.bsr_matrix):
        row = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
        return matrix.data[matrix.indices == row]
    main, above, below = (matrix.diagonal(k) for k in (0, 1, -1))
    above, below = np.r_[above, 0.0][::2], np.r_[below, 0.0][::2]
    return np.stack([main[::2], above, below, main[1::2]], 1).reshape(-1, 2, 2)


class BlockJacobi:
    """The inverse of the 2 × 2 diagonal blocks, as a preconditioner."""

    def __init__(self, matrix: SparseMatrix) -> None:
        a, b, c, d = _diagonal_blocks(matrix).reshape(-1, 4).T
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
