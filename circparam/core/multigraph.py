"""Shortest paths and spanning trees on graphs with parallel edges, which SciPy's matrices cannot hold."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sps
import scipy.sparse.csgraph as csgraph

from circparam.core.arrays import FloatArray, IntArray, first_of_runs


class Graph:
    """An undirected graph of n nodes with weighted edges (a, b); of parallel edges the lightest counts.

    weight: (e,) positive. Edges from a node to itself are never on a path.
    """

    def __init__(self, n: int, a: IntArray, b: IntArray, weight: FloatArray) -> None:
        self.n = n
        e = np.flatnonzero(a != b)
        low, high = np.minimum(a[e], b[e]), np.maximum(a[e], b[e])
        key = low * n + high
        order = np.argsort(key, kind="stable")
        head = first_of_runs(key[order])
        lightest = order[head]
        count = np.diff(np.r_[head, len(order)])
        if len(head) < len(order):  # parallel edges are few: sort only those by weight
            among = order[np.repeat(count > 1, count)]
            among = among[np.lexsort((weight[e[among]], key[among]))]
            lightest[count > 1] = among[first_of_runs(key[among])]
        self._edge, self._key = e[lightest], key[lightest]
        low, high = low[lightest], high[lightest]
        matrix = sps.coo_matrix((weight[self._edge], (low, high)), shape=(n, n)).tocsr()
        self._matrix = matrix + matrix.T

    def paths(self, sources: IntArray, limit: float = np.inf) -> tuple[FloatArray, IntArray]:
        """Distance (n,) from the nearest source, infinite where none is, and the node before each, else −1."""
        distance, before, _ = csgraph.dijkstra(
            self._matrix,
            directed=True,
            indices=sources,
            return_predecessors=True,
            limit=limit,
            min_only=True,
        )
        parent = before.astype(np.int64)
        parent[parent < 0] = -1
        return np.asarray(distance, np.float64), parent

    def edge(self, a: IntArray, b: IntArray) -> IntArray:
        """The lightest edge between each pair of neighbouring nodes."""
        key = np.minimum(a, b) * self.n + np.maximum(a, b)
        result: IntArray = self._edge[np.searchsorted(self._key, key)]
        return result

    def trace(self, parent: IntArray, ends: IntArray) -> IntArray:
        """Edges of the paths from the ends back to the sources, each once; all paths are walked together."""
        marked = np.zeros(self.n, bool)
        front = np.unique(ends)
        while len(front):
            front = front[~marked[front]]
            marked[front] = True
            front = np.unique(parent[front])
            front = front[front >= 0]
        on = np.flatnonzero(marked & (parent >= 0))
        return self.edge(on, parent[on])


def spanning_forest(n: int, a: IntArray, b: IntArray, order: FloatArray) -> IntArray:
    """Edges of the spanning forest that takes edges in ascending ``order`` (ties in their own order)."""
    rank = np.empty(len(a), np.int64)
    by_rank = np.lexsort((np.arange(len(a)), order))
    rank[by_rank] = np.arange(len(a))
    low, high = np.minimum(a, b), np.maximum(a, b)
    key = low * n + high
    first = np.lexsort((rank, key))
    first = first[first_of_runs(key[first])]
    first = first[low[first] != high[first]]
    matrix = sps.coo_matrix((rank[first] + 1.0, (low[first], high[first])), shape=(n, n))
    tree = csgraph.minimum_spanning_tree(matrix.tocsr())
    return np.sort(by_rank[np.asarray(tree.data, np.int64) - 1])
