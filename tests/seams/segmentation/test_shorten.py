"""Seams that become shortest paths inside bands round them."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.seams.prices import FLAT_PRICE, edge_costs, edge_prices
from circparam.seams.segmentation.shorten import propose
from tests.support import shapes
from tests.support.atlases import cut_between, cut_where, middles, surface_of, uncut


def detour(height: float = 0.25) -> Atlas:
    """A sheet cut across at y = 0.5, but higher in its middle part."""
    surface = surface_of(*shapes.grid(9, 9))
    middle = middles(surface)
    level = np.where(np.abs(middle[:, 0] - 0.5) < 0.25, 0.5 + height, 0.5)
    return cut_between(surface, (middle[:, 1] > level).astype(np.int64))


def jagged() -> Atlas:
    """A sheet cut across at y = 0.5, but round two single faces over that line."""
    surface = surface_of(*shapes.grid(9, 9))
    middle = middles(surface)
    below = middle[:, 1] < 0.5
    below |= (middle[:, 1] < 0.55) & np.isin((middle[:, 0] * 8).astype(int), [2, 5])
    return cut_between(surface, below.astype(np.int64))


def moved(atlas: Atlas, rings: int, pinned: np.ndarray | None = None) -> np.ndarray:
    proposal = propose(atlas, rings, pinned)
    return proposal.cut(np.ones(proposal.n, bool))


def on_line(atlas: Atlas, y: float = 0.5) -> np.ndarray:
    return cut_where(atlas.surface, np.abs(atlas.surface.points[:, 1] - y) < 1e-9)


@pytest.mark.parametrize("rings", [0, 1, 3])
def test_two_sides_of_a_face_become_the_third(rings: int) -> None:
    atlas = jagged()
    assert atlas.seam_length == pytest.approx(1 + 2 * 0.125 * np.sqrt(2))
    assert np.array_equal(moved(atlas, rings), on_line(atlas))


def test_without_seams_there_is_nothing_to_propose() -> None:
    atlas = uncut(*shapes.grid(4, 4))
    proposal = propose(atlas)
    assert proposal.n == 0
    assert not proposal.cut(np.zeros(0, bool)).any()
    all_pinned = detour()
    proposal = propose(all_pinned, 2, np.ones(len(all_pinned.cut), bool))
    assert proposal.n == 0
    assert np.array_equal(proposal.cut(np.zeros(0, bool)), all_pinned.cut)


def test_pinned_seams_stay_and_paths_keep_off_them() -> None:
    """The step up is pinned: what lies on both sides of it is shortened as far as its ends."""
    atlas = detour()
    pinned = atlas.cut & on_line(atlas, 0.75)
    assert pinned.sum() == 4
    cut = moved(atlas, 2, pinned)
    assert cut[pinned].all()
    rest = cut & ~pinned
    assert (
        atlas.surface.edge_lengths[rest].sum()
        <= atlas.surface.edge_lengths[atlas.cut & ~pinned].sum() + 1e-12
    )
    # edges that are not cut yet cannot be pinned
    other = jagged()
    assert np.array_equal(moved(other, 2, on_line(other) & ~other.cut), on_line(other))


def test_locked_edges_are_never_cut() -> None:
    """The straight way is locked in its middle."""
    atlas = jagged()
    surface = atlas.surface
    middle = on_line(atlas) & ~atlas.cut
    atlas = Atlas(dataclasses.replace(surface, locked=middle), atlas.cut)
    cut = moved(atlas, 3)
    assert not (cut & middle).any()
    length = surface.edge_lengths
    assert 1.0 < length[cut].sum() <= length[atlas.cut].sum()
    assert np.isinf(edge_costs(atlas)[middle]).all()
    assert np.isfinite(edge_costs(atlas)[~middle]).all()


def test_random_seams_never_cost_more_afterwards_and_keep_their_junctions() -> None:
    surface = surface_of(*shapes.bumped_disk(300))
    seeds = np.random.default_rng(2).choice(len(surface.faces), 7, replace=False)
    middle = middles(surface)
    label = np.linalg.norm(middle[:, None] - middle[seeds], axis=2).argmin(1)
    atlas = cut_between(surface, label)
    cost = edge_costs(atlas)
    proposal = propose(atlas, 2)
    length = np.zeros((2, proposal.n))
    for row, of in enumerate((proposal.old, proposal.new)):
        np.add.at(length[row], of[of >= 0], cost[of >= 0])
    assert (length[1] <= length[0] + 1e-12).all()
    assert length[1].sum() < 0.99 * length[0].sum()
    was = Atlas(surface, atlas.cut).charts()[0]
    for take in (np.ones(proposal.n, bool), np.arange(proposal.n) % 2 == 0):
        now = Atlas(surface, proposal.cut(take))
        assert now.charts()[0] == was
        degree = [np.bincount(np.r_[c.ends[0][c.cut], c.ends[1][c.cut]]) for c in (atlas, now)]
        assert np.array_equal(np.flatnonzero(degree[0] > 2), np.flatnonzero(degree[1] > 2))


def test_seams_along_sharp_edges_cost_less() -> None:
    """On a cube by a third; inside the sides of a hard one they are dear."""
    atlas = uncut(*shapes.cube(2))
    surface = atlas.surface
    n = surface.normals
    sharp = np.abs((n[surface.edges[:, 0] // 3] * n[surface.edges[:, 1] // 3]).sum(1)) < 0.5
    length = surface.edge_lengths
    assert edge_costs(atlas)[sharp] == pytest.approx(length[sharp] / 1.5)
    atlas.prices = edge_prices(surface)
    assert edge_costs(atlas)[~sharp] == pytest.approx(FLAT_PRICE * length[~sharp])
    none = np.zeros(len(length), bool)
    atlas.prices = SeamPrices(np.full(len(length), 3.0), none, none, none)
    assert edge_costs(atlas) == pytest.approx(3 * length)


def test_chains_that_find_no_way_keep_their_path() -> None:
    """Two seams, all edges locked: neither finds one, and both stay."""
    surface = surface_of(*shapes.row_of(shapes.grid(9, 9), 2))
    atlas = cut_between(surface, (middles(surface)[:, 1] > 0.5).astype(np.int64))
    locked = dataclasses.replace(surface, locked=np.ones(len(atlas.cut), bool))
    atlas = Atlas(locked, atlas.cut)
    assert propose(atlas, 2).n == 2
    assert atlas.cut.any()
    assert np.array_equal(moved(atlas, 2), atlas.cut)
