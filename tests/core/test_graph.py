"""Graphs: components, cycles, paths, forests and matchings against plain Python."""

import numpy as np
import pytest
import scipy.sparse as sps
from hypothesis import given
from hypothesis import strategies as st

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.graph import (
    Graph,
    components,
    cycles,
    distances,
    lowest_of_cycles,
    matching,
    nearest,
    severed,
    spanning_forest,
    undirected,
)

seeds = st.integers(0, 10**6)


def random_graph(seed: int) -> tuple[int, IntArray, IntArray, FloatArray]:
    """Up to 12 nodes; parallel edges, loops and equal weights among the edges."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 13))
    e = int(rng.integers(0, 2 * n))
    a, b = rng.integers(0, n, (2, e))
    return n, a, b, rng.integers(1, 6, e).astype(float)


def all_distances(n: int, a: IntArray, b: IntArray, weight: FloatArray) -> FloatArray:
    """(n, n) by Floyd and Warshall."""
    d = np.where(np.eye(n, dtype=bool), 0.0, np.inf)
    for i, j, w in zip(a, b, weight, strict=True):
        d[i, j] = d[j, i] = min(d[i, j], w) if i != j else 0.0
    for k in range(n):
        d = np.minimum(d, d[:, k : k + 1] + d[k : k + 1])
    return d


@given(seeds)
def test_components_are_numbered_by_their_lowest_node(seed: int) -> None:
    n, a, b, weight = random_graph(seed)
    count, label = components(n, a, b)
    together = np.isfinite(all_distances(n, a, b, weight))
    assert np.array_equal(label[:, None] == label[None], together)
    first = [int(np.flatnonzero(label == k)[0]) for k in range(count)]
    assert first == sorted(first)


@given(seeds)
def test_cycles_walk_a_permutation_from_the_lowest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    follower = rng.permutation(int(rng.integers(0, 70)))
    expected, seen = [], set()
    for k in range(len(follower)):
        walk = []
        while k not in seen:
            seen.add(k)
            walk.append(k)
            k = int(follower[k])
        expected += [walk] if walk else []
    label, order, size = cycles(follower)
    lowest = lowest_of_cycles(follower)
    assert size.tolist() == [len(walk) for walk in expected]
    assert order.tolist() == [k for walk in expected for k in walk]
    for number, walk in enumerate(expected):
        assert (label[walk] == number).all()
        assert (lowest[walk] == walk[0]).all()


@given(seeds)
def test_paths_from_the_nearest_source(seed: int) -> None:
    n, a, b, weight = random_graph(seed)
    sources = np.unique(np.random.default_rng(seed + 1).integers(0, n, 2))
    best = all_distances(n, a, b, weight)[sources].min(0)
    graph = Graph(n, a, b, weight)
    for matrix in (undirected(n, a, b, weight), graph.matrix):
        distance, _, source = nearest(matrix, sources)
        assert np.array_equal(distance, best)
        assert np.array_equal(distances(matrix, sources), best)
        assert np.array_equal(source >= 0, np.isfinite(best))
        assert set(source[source >= 0].tolist()) <= set(sources.tolist())
        short = distances(matrix, sources, limit=3.0)
        assert np.array_equal(short, np.where(best <= 3, best, np.inf))
    distance, parent = graph.paths(sources)
    assert np.array_equal(distance, best)
    assert (parent[~np.isfinite(best)] == -1).all()
    assert (parent[sources] == -1).all()


@given(seeds)
def test_a_trace_is_the_lightest_edges_back_to_the_sources(seed: int) -> None:
    n, a, b, weight = random_graph(seed)
    graph = Graph(n, a, b, weight)
    distance, parent = graph.paths(np.array([n - 1]))
    for end in np.flatnonzero(np.isfinite(distance)):
        edges = graph.trace(parent, np.array([end]))
        assert weight[edges].sum() == distance[end]
        assert len(np.unique(edges)) == len(edges)
    ends = np.flatnonzero(np.isfinite(distance))
    assert len(graph.trace(parent, ends)) == len(ends) - 1, "a tree over what is reached"


@pytest.mark.parametrize("one_way", [(0, 1, 2), (2, 1, 0)])
def test_edges_held_once_count_both_ways_where_asked(one_way: tuple[int, ...]) -> None:
    a, b = np.array(one_way[:2]), np.array(one_way[1:])
    graph = sps.csr_matrix((np.ones(2), (a, b)), shape=(3, 3))
    assert distances(graph, np.array([1]), symmetric=False).tolist() == [1, 0, 1]
    assert nearest(graph, np.array([1]), symmetric=False)[1].tolist()[::2] == [1, 1]
    assert np.isinf(distances(graph, np.array([1]))).sum() == 1


@given(seeds)
def test_the_forest_takes_the_first_edges_that_join(seed: int) -> None:
    """Kruskal's algorithm, ties by the number of the edge."""
    n, a, b, weight = random_graph(seed)
    part = np.arange(n)
    expected = []
    for e in np.lexsort((np.arange(len(a)), weight)):
        if part[a[e]] != part[b[e]]:
            part[part == part[a[e]]] = part[b[e]]
            expected.append(int(e))
    assert spanning_forest(n, a, b, weight).tolist() == sorted(expected)


@given(seeds)
def test_matching_takes_the_best_pair_that_is_left(seed: int) -> None:
    n, a, b, score = random_graph(seed)
    taken: set[int] = set()
    expected = []
    for e in np.lexsort((np.arange(len(a)), -score)):
        if not {int(a[e]), int(b[e])} & taken:
            taken |= {int(a[e]), int(b[e])}
            expected.append(int(e))
    assert matching(score, a, b, n).tolist() == sorted(expected)


def test_what_is_severed_from_the_largest_piece_of_its_group() -> None:
    """Two chains, 0 to 5 and 6 to 9, broken where a node is not kept. The largest piece has most area."""
    i = np.array([0, 1, 2, 3, 4, 6, 7, 8])
    kept = np.array([1, 1, 0, 1, 1, 1, 1, 0, 1, 1], bool)
    area = np.array([4.0, 4, 9, 1, 1, 1, 1, 1, 1, 2])
    group = np.array([0] * 6 + [1] * 4)
    out = severed(kept, i, i + 1, area, group)
    assert np.flatnonzero(out).tolist() == [3, 4, 5, 6]
    assert not severed(np.ones(10, bool), i, i + 1, area, group).any()
