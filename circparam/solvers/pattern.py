"""Symmetric matrices over the vertices of a cut mesh: a pattern made once, filled in place.

A pattern may order its vertices so that elimination fills little. The order of one factorisation serves all
later ones over the same edges, with one number or a block for each pair of vertices.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_count, group_sum, stable_order
from circparam.core.linalg import Factor, SparseMatrix
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface

RIDGE_SHARE = 1e-9  # of the diagonal, since the energy does not see a chart move as a whole
# entries of a transposed block, where a block is (00, 01, 10, 11)
TRANSPOSED = np.array([0, 2, 1, 3])


def pattern_of(cut_mesh: CutMesh) -> "VertexPattern":
    """The pattern of a cut mesh in its known order of elimination; cached with the cut mesh."""
    kept: VertexPattern | None = cut_mesh.__dict__.get("_pattern")
    if kept is None or (cut_mesh.elimination is not None and not kept.ordered):
        kept = cut_mesh.__dict__["_pattern"] = VertexPattern(cut_mesh, cut_mesh.elimination)
    return kept


def elimination_ranks(surface: Surface) -> IntArray:
    """(vertices,) when elimination takes each vertex of a surface, in an order that fills little.

    Any part of the surface, cut in any way, fills no more in the same order than it does as part of the whole.
    They are kept with the surface.
    """
    kept: IntArray | None = surface.__dict__.get("_ranks")
    if kept is not None:
        return kept
    whole = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    kept = surface.__dict__["_ranks"] = ranks_of(whole)
    return kept


def ranks_of(cut_mesh: CutMesh) -> IntArray:
    """(n_vertices,) when elimination takes each vertex of a cut mesh."""
    pattern = VertexPattern(cut_mesh, None)
    weight, added = np.ones(3 * len(cut_mesh.faces)), np.ones(cut_mesh.n_vertices)
    return Factor(pattern.numbers(weight, added)).position


def eliminate_as(cut_mesh: CutMesh, ranks: IntArray, vertices: IntArray) -> None:
    """Give a cut mesh the order of elimination of its surface. vertices: (m, 3) of the surface."""
    rank = np.zeros(cut_mesh.n_vertices, np.int64)
    rank[cut_mesh.faces.ravel()] = ranks[vertices.ravel()]
    cut_mesh.eliminated_in(stable_order(rank))


class VertexPattern:
    """Where the entries of the vertices and edges of a cut mesh stand in a sparse matrix.

    order: (n,) vertices as they are eliminated, row after row of the matrix; those of the cut mesh where
    None. Two vertices that several edges join share one entry, the sum.
    """

    def __init__(self, cut_mesh: CutMesh, order: IntArray | None) -> None:
        n = cut_mesh.n_vertices
        # half-edge k of face f is entry k m + f, as ``edge_blocks`` has them
        flat = cut_mesh.faces.T.ravel()
        i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
        m = len(cut_mesh.faces)
        self.left, self.right, self.boundary = (
            h % 3 * m + h // 3 for h in (i, j, cut_mesh.boundary)
        )
        first = np.concatenate([self.left, self.boundary])
        ahead = first + m
        ahead[ahead >= 3 * m] -= 3 * m
        self.n, self.ordered = n, order is not None
        self.order = np.arange(n) if order is None else order
        rank = np.empty(n, np.int64)
        rank[self.order] = np.arange(n)
        tail, head = rank[flat[first]], rank[flat[ahead]]
        self.rows = np.concatenate([tail, head])
        self.chart = cut_mesh.vertex_chart[self.order]
        self.count = np.maximum(group_count(self.chart, cut_mesh.n_charts), 1)
        every = np.arange(n)
        key = np.concatenate([head, tail, every]) * n + np.concatenate([tail, head, every])
        self.source = stable_order(key)
        found = key[self.source]
        twice = found[1:] == found[:-1]
        self.place: IntArray | None = None
        if twice.any():
            self.place = np.empty(len(key), np.int64)
            self.place[self.source] = np.cumsum(np.concatenate([[0], ~twice]))
            found = found[np.concatenate([[True], ~twice])]
            self.source = np.arange(len(found))
        # SciPy looks through indices of 64 bits to see whether 32 are enough
        self.row = (found % n).astype(np.int32)
        self.start = np.searchsorted(found, np.arange(n + 1) * n).astype(np.int32)
        self._blocks: tuple[IntArray, sps.csc_matrix] | None = None

    def numbers(self, weight: FloatArray, added: FloatArray) -> sps.csc_matrix:
        """(n, n) graph Laplacian with a weight (3 m,) for each half-edge, those of both sides added up.

        weight: half-edge k of face f at k m + f. added: (n,) to the diagonal, by vertices.
        """
        edge = -np.concatenate([weight[self.left] + weight[self.right], weight[self.boundary]])
        both = np.concatenate([edge, edge])
        diagonal = added[self.order] - group_sum(both, self.rows, self.n)
        data = self._placed(np.concatenate([both, diagonal]))
        return sps.csc_matrix((data, self.row, self.start), shape=(self.n, self.n))

    def blocks(self, blocks: FloatArray) -> sps.csc_matrix:
        """(2n, 2n) matrix of half-edge blocks (2, 2, 3, m) as made by ``dirichlet.edge_blocks``.

        The rows of the blocks sum to zero, except for a small ridge. The next call overwrites the same matrix.
        """
        both = self._edge_blocks(blocks)
        diagonal = -np.stack([group_sum(x, self.rows, self.n) for x in both])
        diagonal[::3] += self._ridge(diagonal[0] + diagonal[3])
        data = np.concatenate([both, diagonal], axis=1)
        if self.place is not None:
            data = np.stack([self._placed(x) for x in data])
        gather, matrix = self._block_pattern()
        matrix.data = data.ravel()[gather]
        return matrix

    def block_rows(self, blocks: FloatArray) -> sps.bsr_matrix:
        """The matrix of ``blocks`` by rows of blocks, for products with vectors."""
        # symmetric: the columns of the pattern are the rows of the matrix
        both, empty = self._edge_blocks(blocks), np.zeros(self.n)
        data = np.empty((len(self.row), 4))
        for k, transposed in enumerate(TRANSPOSED):
            data[:, k] = self._placed(np.concatenate([both[transposed], empty]))
        diagonal = -np.add.reduceat(data, self.start[:-1], axis=0)
        diagonal[:, ::3] += self._ridge(diagonal[:, 0] + diagonal[:, 3])[:, None]
        data[self.row == np.repeat(np.arange(self.n), np.diff(self.start))] = diagonal
        entries = data.reshape(-1, 2, 2), self.row, self.start
        return sps.bsr_matrix(entries, shape=(2 * self.n, 2 * self.n))

    def _edge_blocks(self, blocks: FloatArray) -> FloatArray:
        """(4, 2e) blocks of the edges, those of both sides added up, in one direction, then in the other."""
        flat, count = blocks.reshape(4, -1), len(self.rows) // 2
        out = np.empty((4, 2 * count))
        for ahead, back, place in zip(flat, flat[TRANSPOSED], out, strict=True):
            place[: len(self.left)] = ahead[self.left] + back[self.right]
            place[len(self.left) : count] = ahead[self.boundary]
        out[:, count:] = out[TRANSPOSED, :count]
        return out

    def _ridge(self, trace: FloatArray) -> FloatArray:
        """(n,) what the diagonal gets, by the traces of its blocks."""
        mean = group_sum(trace, self.chart, len(self.count)) / self.count
        return RIDGE_SHARE * trace + 1e-4 * RIDGE_SHARE * mean[self.chart]

    def gather(self, x: FloatArray) -> FloatArray:
        """Values (n, 2) of the vertices as rows of the matrix (2n,)."""
        return x[self.order].ravel()

    def scatter(self, x: FloatArray) -> FloatArray:
        """Rows (2n,) of the matrix as values (n, 2) of the vertices."""
        out = np.empty((self.n, 2))
        out[self.order] = x.reshape(-1, 2)
        return out

    def elimination(self, factor: Factor, size: int) -> IntArray:
        """(n,) vertices in the order in which a factor of such a matrix eliminated them.

        size: 1 for a matrix of numbers, 2 for blocks.
        """
        return self.order[stable_order(factor.position[::size])]

    def _placed(self, values: FloatArray) -> FloatArray:
        if self.place is None:
            return values[self.source]
        return group_sum(values, self.place, len(self.row))

    def _block_pattern(self) -> tuple[IntArray, sps.csc_matrix]:
        """Where each number of the block matrix comes from, and a matrix to fill."""
        if self._blocks is None:
            size = np.diff(self.start)
            width = len(self.source) if self.place is not None else len(self.rows) + self.n
            column = np.repeat(np.arange(self.n), size)
            at = 2 * self.start[column] + 2 * np.arange(len(self.row))
            below = 2 * size[column]
            total = 4 * len(self.row)
            gather, index = np.empty(total, np.int64), np.empty(total, np.int32)
            for entry, place in enumerate((at, at + below, at + 1, at + below + 1)):
                gather[place] = entry * width + self.source
                index[place] = 2 * self.row + entry // 2
            start = np.zeros(2 * self.n + 1, np.int32)
            np.cumsum(np.repeat(2 * size, 2), out=start[1:])
            matrix = sps.csc_matrix((np.zeros(total), index, start), shape=(2 * self.n, 2 * self.n))
            matrix.has_canonical_format = True
            self._blocks = gather, matrix
        return self._blocks


def hold(matrix: SparseMatrix, fixed: BoolArray) -> None:
    """Give fixed vertices ((n,) bool, as the rows have them) unit rows and columns, times a number, in place.

    matrix: (2n, 2n), symmetric, with its whole diagonal; of blocks, or by columns.
    """
    by_blocks = isinstance(matrix, sps.bsr_matrix)
    held = fixed if by_blocks else np.repeat(fixed, 2)
    size = float(np.abs(matrix.diagonal()).mean())
    line = np.repeat(np.arange(len(held)), np.diff(matrix.indptr))
    matrix.data[held[line] | held[matrix.indices]] = 0.0
    matrix.data[held[line] & (matrix.indices == line)] = size * np.eye(2) if by_blocks else size
