"""Components and shortest paths on sparse graphs: SciPy's csgraph with the array types of this project."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sps
import scipy.sparse.csgraph as csgraph

from circparam.core.arrays import FloatArray, IntArray, first_of_runs, group_min


def components(n: int, i: IntArray, j: IntArray) -> tuple[int, IntArray]:
    """Connected components of n nodes joined by i–j: (number, (n,) label in order of the lowest node)."""
    graph = sps.coo_matrix((np.ones(len(i), bool), (i, j)), shape=(n, n))
    count, labels = csgraph.connected_components(graph, directed=False)
    return int(count), labels.astype(np.int64)


def undirected(n: int, i: IntArray, j: IntArray, length: FloatArray) -> sps.csr_matrix:
    """Symmetric graph with the given edge lengths; of several edges between two nodes the shortest counts."""
    other = i != j
    i, j, length = i[other], j[other], length[other]
    a, b, w = np.r_[i, j], np.r_[j, i], np.r_[length, length]
    order = np.lexsort((w, b, a))
    a, b, w = a[order], b[order], w[order]
    first = first_of_runs(a * n + b)
    return sps.csr_matrix((w[first], (a[first], b[first])), shape=(n, n))


def nearest(
    graph: sps.csr_matrix, sources: IntArray, limit: float = np.inf, unweighted: bool = False
) -> tuple[FloatArray, IntArray, IntArray]:
    """Shortest paths from the nearest of several sources.

    Returns (distance (n,), infinite where none reaches; the node before on the path, and the source (n,), both
    −1 or less where there is none).
    """
    found: Any = csgraph.dijkstra(
        graph,
        indices=sources,
        min_only=True,
        return_predecessors=True,
        limit=limit,
        unweighted=unweighted,
    )
    distance, before, source = found
    return distance, before.astype(np.int64), source.astype(np.int64)


def distances(graph: sps.csr_matrix, sources: IntArray, limit: float = np.inf) -> FloatArray:
    """(n,) distance from the nearest of several sources."""
    found: Any = csgraph.dijkstra(graph, indices=sources, min_only=True, limit=limit)
    result: FloatArray = found
    return result


def matching(score: FloatArray, left: IntArray, right: IntArray, n: int) -> IntArray:
    """The greedy matching: the best pair, then the best among what is left, and so on, in array rounds.

    score: (a,) higher is better; ties go to the lower index. Returns the indices of the chosen pairs,
    ascending. A pair may join a node with itself.
    """
    rank = np.empty(len(score), np.float64)
    rank[np.lexsort((np.arange(len(score)), -score))] = np.arange(len(score))
    alive = np.arange(len(score))
    chosen = []
    while len(alive):
        best = np.minimum(
            group_min(rank[alive], left[alive], n), group_min(rank[alive], right[alive], n)
        )
        wins = (rank[alive] == best[left[alive]]) & (rank[alive] == best[right[alive]])
        chosen.append(alive[wins])
        taken = np.zeros(n, bool)
        taken[left[alive[wins]]] = taken[right[alive[wins]]] = True
        alive = alive[~taken[left[alive]] & ~taken[right[alive]]]
    return np.sort(np.concatenate(chosen)) if chosen else np.zeros(0, np.int64)
