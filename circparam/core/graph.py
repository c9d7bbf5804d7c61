"""Components, cycles, shortest paths, spanning trees and matchings of graphs: all over arrays of edges.

The one place that calls SciPy's csgraph for these, with the array types of this project. SciPy's matrices
have one weight for each pair of nodes; of several edges between two nodes, each function documents which one
counts.
"""

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    edge_keys,
    first_of_each,
    first_of_groups,
    first_of_runs,
    group_count,
    group_max,
    group_min,
    group_sum,
    mask_of,
    positions_in,
    sorted_distinct,
    stable_order,
)
from circparam.core.clock import tick
from circparam.core.compiled import (
    breadth_first_order,
    compressed_rows,
    dijkstra,
    label_components,
    minimum_spanning_tree,
)
from circparam.core.types import BoolArray, FloatArray, IntArray


def components(n: int, i: IntArray, j: IntArray) -> tuple[int, IntArray]:
    """Connected components of n nodes joined by i–j: (number, (n,) label in order of the lowest node).

    SciPy's function takes five times as long for its checks and for its copies of the graph.
    """
    tick()
    start, ahead = compressed_rows(n, i, j)
    labels = np.full(n, -1, np.int32)  # −1: not reached yet
    if label_components is None:
        from scipy.sparse.csgraph import connected_components

        graph = sps.csr_matrix((np.ones(len(ahead), bool), ahead, start), shape=(n, n))
        count, labels = connected_components(graph, directed=False)
    else:
        start_back, back = compressed_rows(n, j, i)
        count = label_components(ahead, start, back, start_back, labels)
    return int(count), labels.astype(np.int64)


def severed(
    kept: BoolArray, i: IntArray, j: IntArray, area: FloatArray, group: IntArray
) -> BoolArray:
    """(n,) bool: nodes of ``kept`` ((n,) bool) in a piece that is smaller than the largest of their group.

    i, j: (e,) nodes of one group that are joined. group: (n,) from 0. Largest by the sum of the areas (n,).
    """
    joined = kept[i] & kept[j]
    n, piece = components(len(kept), i[joined], j[joined])
    size = group_sum(area * kept, piece, n)[piece]
    largest = group_max(size, group, int(group.max(initial=-1)) + 1)[group]
    return kept & (size < largest)


def cycles(follower: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The cycles of a permutation (n,), each walked from its lowest element on.

    Returns (label (n,): cycle of each element, in order of the lowest; order (n,): the elements, cycle after
    cycle, each along ``follower``; size (cycles,)).
    """
    label, position, _ = along_cycles(follower, np.ones(len(follower)))
    size = group_count(label, int(label.max(initial=-1)) + 1)
    return label, np.lexsort((position, label)), size


def along_cycles(follower: IntArray, length: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Ways along the cycles of a permutation (n,) whose elements are so long: list ranking by doubling.

    Returns (label (n,): cycle of each element, in order of the lowest; (n,) way from the beginning of the
    lowest of the cycle to that of each; (n,) length of the cycle).
    """
    n, lowest = len(follower), lowest_of_cycles(follower)
    head = lowest == np.arange(n)
    label = (np.cumsum(head) - 1)[lowest]
    # length from each element on to the head of its cycle; n is past the end
    remaining = np.append(length, 0.0)
    jump = np.append(np.where(head[follower], n, follower), n)
    while (jump < n).any():
        remaining += remaining[jump]
        jump = jump[jump]
    total = group_sum(length, label, n)[label]
    return label, total - remaining[:n], total


def lowest_of_cycles(follower: IntArray) -> IntArray:
    """(n,) the lowest element of the cycle that each element of a permutation is in, by pointer doubling.

    Each round looks twice as far ahead. Once nothing changes, consecutive windows of a cycle have the same
    lowest element, which is then the lowest of the cycle.
    """
    lowest, jump = np.arange(len(follower)), follower
    while True:
        lower = np.minimum(lowest, lowest[jump])
        if (lower == lowest).all():
            return lowest
        lowest, jump = lower, jump[jump]


def undirected(n: int, i: IntArray, j: IntArray, length: FloatArray) -> sps.csr_matrix:
    """Symmetric graph with the given edge lengths; of several edges between two nodes the shortest counts."""
    other = i != j
    i, j, length = i[other], j[other], length[other]
    a, b, w = np.concatenate([i, j]), np.concatenate([j, i]), np.concatenate([length, length])
    key = a * n + b
    order = stable_order(key)
    first = first_of_runs(key[order])
    shortest = np.minimum.reduceat(w[order], first) if len(first) else w
    kept = order[first]
    start = np.searchsorted(a[kept], np.arange(n + 1)).astype(np.int32)
    return sps.csr_matrix((shortest, b[kept].astype(np.int32), start), shape=(n, n))


def nearest(
    graph: sps.csr_matrix, sources: IntArray, limit: float = np.inf, symmetric: bool = True
) -> tuple[FloatArray, IntArray, IntArray]:
    """Shortest paths from the nearest of several sources.

    graph: (n, n) weights of the edges. symmetric: False if it holds each edge once, either way round; then
    both ways count. Returns (distance (n,), infinite if none reaches; the node before on the path, and the
    source (n,), both −1 or less where there is none).
    """
    tick()
    distance, before, source = dijkstra(
        graph,
        indices=sources,
        min_only=True,
        return_predecessors=True,
        limit=limit,
        directed=symmetric,
    )
    return distance, before.astype(np.int64), source.astype(np.int64)


def distances(
    graph: sps.csr_matrix, sources: IntArray, limit: float = np.inf, symmetric: bool = True
) -> FloatArray:
    """(n,) distance from the nearest of several sources, infinite if none reaches. As in ``nearest``."""
    tick()
    return dijkstra(graph, indices=sources, min_only=True, limit=limit, directed=symmetric)


class Graph:
    """An undirected graph of n nodes with weighted edges (a, b); of parallel edges the lightest counts.

    weight: (e,) positive. Edges from a node to itself are never on a path.
    """

    def __init__(self, n: int, a: IntArray, b: IntArray, weight: FloatArray) -> None:
        self.n = n
        self.matrix = undirected(n, a, b, weight)
        e = np.flatnonzero(a != b)
        key = edge_keys(a[e], b[e], n)
        lightest = first_of_groups(key, weight[e])
        self._edge, self._key = e[lightest], key[lightest]

    def paths(self, sources: IntArray, limit: float = np.inf) -> tuple[FloatArray, IntArray]:
        """Distance (n,) from the nearest source, infinite if none is, and the node before each, else −1."""
        distance, parent, _ = nearest(self.matrix, sources, limit)
        return distance, np.maximum(parent, -1)

    def edge(self, a: IntArray, b: IntArray) -> IntArray:
        """The lightest edge between each pair of neighbouring nodes."""
        return self._edge[np.searchsorted(self._key, edge_keys(a, b, self.n))]

    def trace(self, parent: IntArray, ends: IntArray) -> IntArray:
        """Edges of the paths from the ends back to the sources, each once; all paths are walked together."""
        marked = np.zeros(self.n, bool)
        front = sorted_distinct(ends)
        while len(front):
            front = front[~marked[front]]
            marked[front] = True
            front = sorted_distinct(parent[front])
            front = front[front >= 0]
        on = np.flatnonzero(marked & (parent >= 0))
        return self.edge(on, parent[on])


def chains(a: IntArray, b: IntArray, through: BoolArray) -> tuple[int, IntArray]:
    """Edges (a, b) joined at the nodes ``through`` ((n,) bool), each of which has two: (number, (e,) label)."""
    ends = np.concatenate([a, b])
    k = np.flatnonzero(through[ends])
    k = k[stable_order(ends[k])] % max(len(a), 1)
    return components(len(a), k[::2], k[1::2])


def spanning_forest(n: int, a: IntArray, b: IntArray, order: FloatArray) -> IntArray:
    """Edges of the spanning forest that takes edges in ascending ``order`` (ties in their own order)."""
    tick()
    by_rank = np.argsort(order, kind="stable")
    rank = positions_in(len(a), by_rank)
    low, high = np.minimum(a, b), np.maximum(a, b)
    first = first_of_groups(edge_keys(a, b, n), rank)
    first = first[a[first] != b[first]]
    matrix = sps.coo_matrix((rank[first] + 1.0, (low[first], high[first])), shape=(n, n))
    tree = minimum_spanning_tree(matrix.tocsr())
    return np.sort(by_rank[np.asarray(tree.data, np.int64) - 1])


def breadth_first(n: int, i: IntArray, j: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Breadth-first search of n nodes joined by i–j, from the lowest node of every component.

    Returns (component (n,) of each node; the nodes (n,) as they are reached, components side by side; the node
    (n,) from which each is reached, n for the lowest ones).
    """
    parts, part = components(n, i, j)
    # one more node reaches all components, so that one search does
    ends = np.r_[i, first_of_each(part, parts)], np.r_[j, np.full(parts, n)]
    graph = sps.coo_matrix((np.ones(len(ends[0]), bool), ends), shape=(n + 1, n + 1)).tocsr()
    order, before = breadth_first_order(graph, n, directed=False)
    return part, order[1:].astype(np.int64), before[:n].astype(np.int64)


def matching(score: FloatArray, left: IntArray, right: IntArray, n: int) -> IntArray:
    """The greedy matching: the best pair, then the best of the remaining ones, and so on, in array rounds.

    score: (a,) higher is better; ties go to the lower index. Returns the indices of the chosen pairs,
    ascending. A pair may join a node with itself.
    """
    tick()
    rank = positions_in(len(score), np.argsort(-score, kind="stable")).astype(np.float64)
    alive = np.arange(len(score))
    chosen = [alive[:0]]
    while len(alive):
        best = np.minimum(
            group_min(rank[alive], left[alive], n), group_min(rank[alive], right[alive], n)
        )
        won = alive[(rank[alive] == best[left[alive]]) & (rank[alive] == best[right[alive]])]
        chosen.append(won)
        taken = mask_of(n, np.concatenate([left[won], right[won]]))
        alive = alive[~taken[left[alive]] & ~taken[right[alive]]]
    return np.sort(np.concatenate(chosen))
