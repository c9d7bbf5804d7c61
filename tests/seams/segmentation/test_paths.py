"""Chains of seam edges, and the shortest paths that take their place."""

import numpy as np

from circparam.seams.segmentation.paths import Bands, Chains, chains_of, route


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


def test_two_chains_between_the_same_ends_get_the_same_edge() -> None:
    a, b = np.array([0, 1, 2]), np.array([1, 2, 0])
    ends = np.array([2, 2]), np.array([1, 1])
    found = route(Bands((a, b), np.ones(3), *no_band(3)), *ends, np.ones(2, np.int64))
    assert found.edges.tolist() == [1, 1]
    assert sorted(found.chain.tolist()) == [0, 1]
    assert len(found.failed) == 0


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
