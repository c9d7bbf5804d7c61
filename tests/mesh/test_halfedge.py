"""Half-edges sorted, paired and joined, against plain Python over random triangle soups."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from circparam.core.arrays import IntArray
from circparam.mesh.halfedge import (
    boundary_half_edges,
    opposite_half_edges,
    point_corners,
    run_opposite,
    shared_edges,
    sort_by_edge,
)

seeds = st.integers(0, 10**6)


def soup(seed: int) -> IntArray:
    """Up to 12 faces on 6 points, any winding, each of three different points."""
    rng = np.random.default_rng(seed)
    return np.array([rng.permutation(6)[:3] for _ in range(int(rng.integers(1, 13)))])


def by_edge(faces: IntArray) -> dict[tuple[int, int], list[int]]:
    """The half-edges on each edge, edges in ascending order."""
    out: dict[tuple[int, int], list[int]] = {}
    for h in range(faces.size):
        a, b = int(faces[h // 3, h % 3]), int(faces[h // 3, (h + 1) % 3])
        out.setdefault((min(a, b), max(a, b)), []).append(h)
    return dict(sorted(out.items()))


@given(seeds)
def test_runs_are_the_half_edges_of_each_edge(seed: int) -> None:
    faces = soup(seed)
    runs, expected = sort_by_edge(faces, 6), list(by_edge(faces).values())
    assert runs.size.tolist() == [len(h) for h in expected]
    assert runs.order.tolist() == [h for run in expected for h in run]
    assert runs.order[runs.head].tolist() == [run[0] for run in expected]
    assert runs.pairs.tolist() == [run for run in expected if len(run) == 2]
    which = np.arange(len(faces)) % 2 == 0
    some = sort_by_edge(faces, 6, which)
    assert np.array_equal(np.sort(some.order), np.flatnonzero(np.repeat(which, 3)))
    assert some.size.sum() == len(some.order)


@given(seeds)
def test_shared_edges_run_against_each_other_and_have_no_third(seed: int) -> None:
    faces = soup(seed)
    flat = faces.ravel().tolist()
    expected = sorted(
        run for run in by_edge(faces).values() if len(run) == 2 and flat[run[0]] != flat[run[1]]
    )
    pairs = shared_edges(faces)
    assert pairs.tolist() == expected
    assert run_opposite(faces, pairs).all()
    assert not run_opposite(faces, pairs[:, [0, 0]]).any()
    # every half-edge is in a pair or on a boundary
    other = opposite_half_edges(len(faces), pairs)
    inner = np.flatnonzero(other >= 0)
    assert np.array_equal(other[other[inner]], inner)
    assert np.array_equal(np.sort(pairs.ravel()), inner)
    assert np.array_equal(boundary_half_edges(len(faces), pairs), np.flatnonzero(other < 0))


@given(seeds)
def test_corners_join_at_their_points_however_faces_are_wound(seed: int) -> None:
    faces = soup(seed)
    label = point_corners(faces, sort_by_edge(faces, 6).pairs)
    for corners in (np.flatnonzero(label == k) for k in range(label.max() + 1)):
        assert len(np.unique(faces.ravel()[corners])) == 1
    back = np.random.default_rng(seed).random(len(faces)) < 0.5
    turned = np.where(back[:, None], faces[:, ::-1], faces)
    again = point_corners(turned, sort_by_edge(turned, 6).pairs)
    again = np.where(back[:, None], again.reshape(-1, 3)[:, ::-1], again.reshape(-1, 3)).ravel()
    assert np.array_equal(label[:, None] == label, again[:, None] == again)
