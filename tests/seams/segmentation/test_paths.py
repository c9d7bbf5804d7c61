"""Chains of seam edges, and the shortest paths that take their place."""

import numpy as np

from circparam.seams.segmentation.paths import Bands, Chains, chains_of, route


def test_chains_end_at_junctions_and_closed_ones_are_halved() -> None:
    # a path 0-1-2-3, a closed loop 4-5-6-7, and a junction at 2 with a branch to 8
    a = np.array([0, 1, 2, 4, 5, 6, 7, 2])
    b = np.array([1, 2, 3, 5, 6, 7, 4, 8])
    chains = chains_of(a, b, 9, np.zeros(9, bool))
    ends = sorted(
        tuple(sorted(e)) for e in zip(chains.start.tolist(), chains.end.tolist(), strict=True)
    )
    assert ends == [(0, 2), (2, 3), (2, 8), (4, 6), (4, 6)]
    assert chains.size.sum() == len(a)
    assert sorted(chains.vertex.tolist()) == [1, 5, 7]


def test_routes_are_shortest_inside_their_bands_and_never_cross() -> None:
    """Two chains on a grid, side by side: each keeps to its own columns although the other's are shorter."""
    width, height = 6, 8
    index = np.arange(width * height).reshape(height, width)
    a = np.r_[index[:, :-1].ravel(), index[:-1].ravel()]
    b = np.r_[index[:, 1:].ravel(), index[1:].ravel()]
    owner = np.where(np.arange(width) < 3, 0, 1) * np.ones((height, 1), int)
    value = np.arange(height)[:, None] * np.ones(width)
    start, end = index[0, [1, 4]], index[-1, [1, 4]]
    owner = owner.ravel().copy()
    owner[np.r_[start, end]] = -1
    bands = Bands((a, b), np.ones(len(a)), owner, value.ravel())
    found = route(bands, start, end, np.full(2, height - 1))
    assert len(found.failed) == 0
    assert np.bincount(found.chain).tolist() == [height - 1, height - 1]
    for k in range(2):
        on = found.edges[found.chain == k]
        columns = np.r_[a[on], b[on]] % width
        assert ((columns < 3) == (k == 0)).all()


def ends_of(chains: Chains) -> list[tuple[int, int]]:
    return sorted(
        (min(e), max(e)) for e in zip(chains.start.tolist(), chains.end.tolist(), strict=True)
    )


def test_positions_count_the_edges_from_the_start() -> None:
    """Whatever the numbers of the vertices along it."""
    way = np.array([7, 2, 9, 0, 5, 3])
    chains = chains_of(way[:-1], way[1:], 12, np.zeros(12, bool))
    assert chains.size.tolist() == [5]
    order = chains.vertex[np.argsort(chains.position)]
    assert sorted(chains.position.tolist()) == [1, 2, 3, 4]
    whole = np.r_[chains.start, order, chains.end]
    assert whole.tolist() in (way.tolist(), way[::-1].tolist())


def test_several_chains_keep_their_own_vertices() -> None:
    """Three chains of different lengths, their edges given in any order and direction."""
    ways = [[10, 3, 8, 1], [2, 11], [4, 9, 0, 6, 7]]
    a = np.concatenate([w[:-1] for w in ways])
    b = np.concatenate([w[1:] for w in ways])
    order = np.random.default_rng(3).permutation(len(a))
    swap = order % 2 == 0
    a, b = np.where(swap, b, a)[order], np.where(swap, a, b)[order]
    chains = chains_of(a, b, 13, np.zeros(13, bool))
    assert ends_of(chains) == [(1, 10), (2, 11), (4, 7)]
    for k in range(3):
        way = next(w for w in ways if {w[0], w[-1]} == {chains.start[k], chains.end[k]})
        way = way if way[0] == chains.start[k] else way[::-1]
        own = chains.chain == k
        assert chains.size[k] == len(way) - 1
        assert chains.vertex[own][np.argsort(chains.position[own])].tolist() == way[1:-1]


def test_chains_stop_where_they_are_told_to() -> None:
    stop = np.zeros(5, bool)
    stop[2] = True
    chains = chains_of(np.arange(4), np.arange(1, 5), 5, stop)
    assert ends_of(chains) == [(0, 2), (2, 4)]
    assert chains.size.tolist() == [2, 2]
    # a loop that hangs on one junction is halved at its middle
    chains = chains_of(np.array([0, 1, 2, 3]), np.array([1, 2, 3, 0]), 5, stop)
    assert ends_of(chains) == [(0, 2), (0, 2)]


def test_loops_are_opened_at_their_lowest_vertex_and_halved() -> None:
    """Two loops beside a path, so that each is told apart by its own vertices."""
    a = np.array([6, 7, 8, 9, 1, 2, 3, 11])
    b = np.array([7, 8, 9, 6, 2, 3, 1, 12])
    chains = chains_of(a, b, 13, np.zeros(13, bool))
    assert ends_of(chains)[-3:] == [(6, 8), (6, 8), (11, 12)]
    assert all(1 in pair for pair in ends_of(chains)[:2])
    assert chains.size.sum() == len(a)
    assert (chains.start != chains.end).all()


def no_band(n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full(n, -1), np.zeros(n)


def test_ends_that_one_edge_joins_are_joined_by_it() -> None:
    """Chains without a band, the shorter of two parallel edges for each, in both directions."""
    a = np.array([4, 0, 1, 2, 3, 4, 5])
    b = np.array([1, 1, 4, 5, 2, 3, 0])
    weight = np.array([3.0, 1.0, 2.0, 1.0, 1.0, 1.0, 1.0])
    start, end = np.array([1, 5, 3]), np.array([4, 2, 0])
    found = route(Bands((a, b), weight, *no_band(6)), start, end, np.ones(3, np.int64))
    assert found.failed.tolist() == [2], "no edge joins 3 and 0"
    assert sorted(zip(found.chain.tolist(), found.edges.tolist(), strict=True)) == [(0, 2), (1, 3)]


def test_two_chains_between_the_same_ends_get_the_same_edge() -> None:
    a, b = np.array([0, 1, 2]), np.array([1, 2, 0])
    ends = np.array([2, 2]), np.array([1, 1])
    found = route(Bands((a, b), np.ones(3), *no_band(3)), *ends, np.ones(2, np.int64))
    assert found.edges.tolist() == [1, 1]
    assert sorted(found.chain.tolist()) == [0, 1]
    assert len(found.failed) == 0


def line(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(count - 1), np.arange(1, count)


def test_a_step_may_go_as_far_along_its_chain_as_allowed_and_no_further() -> None:
    """Six vertices in a row; the values jump by 2 in the middle."""
    a, b = line(6)
    owner = np.array([-1, 0, 0, 0, 0, -1])
    value = np.array([0.0, 1, 2, 4, 5, 6])
    bands = Bands((a, b), np.ones(5), owner, value)
    start, end, size = np.array([0]), np.array([5]), np.array([6])
    assert len(route(bands, start, end, size).failed) == 0
    assert route(bands, start, end, size, 1.9).failed.tolist() == [0]
    found = route(bands, start, end, size, 2.0)
    assert sorted(found.edges.tolist()) == [0, 1, 2, 3, 4]
    # likewise at the ends: the last step would go from 5 to 8
    assert route(bands, start, end, np.array([8])).failed.tolist() == [0]
    assert len(route(bands, start, end, np.array([7])).failed) == 0


def test_paths_stay_in_their_own_band_and_take_the_lightest_way() -> None:
    """Two ways round a square, one of them lighter; then the lighter one belongs to nobody, then to another."""
    a, b = np.array([0, 1, 0, 2]), np.array([1, 3, 2, 3])
    weight = np.array([1.0, 1.0, 1.0, 1.5])
    one = np.array([0]), np.array([3]), np.array([2])
    value = np.array([0.0, 1, 1, 2])
    owner = np.array([-1, 0, 0, -1])
    assert sorted(route(Bands((a, b), weight, owner, value), *one).edges.tolist()) == [0, 1]
    owner = np.array([-1, -1, 0, -1])
    assert sorted(route(Bands((a, b), weight, owner, value), *one).edges.tolist()) == [2, 3]
    owner = np.array([-1, -1, -1, -1])
    assert route(Bands((a, b), weight, owner, value), *one).failed.tolist() == [0]
    two = np.array([0, 0]), np.array([3, 3]), np.array([2, 2])
    found = route(Bands((a, b), weight, np.array([-1, 1, 0, -1]), value), *two)
    assert [sorted(found.edges[found.chain == k].tolist()) for k in range(2)] == [[2, 3], [0, 1]]


def test_no_path_runs_through_the_end_of_another_chain() -> None:
    """Bands 0 and 1 meet in vertex 2, an end of chain 1: chain 0 finds no way through it."""
    a, b = line(5)
    owner = np.array([-1, 0, -1, 0, -1])
    bands = Bands((a, b), np.ones(4), owner, np.arange(5.0))
    found = route(bands, np.array([0, 2]), np.array([4, 1]), np.array([4, 1]))
    assert 0 in found.failed.tolist()
