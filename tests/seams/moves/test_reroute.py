"""Seams that become shortest paths inside bands round them, as far as charts stay good."""

import dataclasses

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.evaluate import Demands
from circparam.seams.moves.reroute import move_seams, propose
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import cut_between, cut_where, energies, middles, surface_of


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


@pytest.mark.parametrize("around", [3, 4, 5])
def test_a_ring_round_a_neck_stays_a_ring(around: int) -> None:
    """One of three edges becomes chains of two edges and of one between the same ends."""
    surface = surface_of(*shapes.tube(3.0, around, closed=False))
    atlas = cut_between(surface, (middles(surface)[:, 2] > 1).astype(np.int64))
    atlas.cut = moved(atlas, rings=3)
    assert atlas.charts()[0] == 2


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


BOUND = 1.05


def halves(shape: tuple[np.ndarray, np.ndarray], wave: float) -> Atlas:
    """A shape cut in two at y = 0.5, or along a wave round that, and laid out."""
    surface = surface_of(*shape)
    middle = middles(surface)
    middle = (middle - middle.min(0)) / np.ptp(middle[:, :2], axis=0).max()
    atlas = cut_between(surface, (middle[:, 1] > 0.5 + wave * np.sin(5 * middle[:, 0])).astype(int))
    lay_out_fresh(atlas, None, RelaxOptions(tolerance=1e-4, max_iterations=40))
    return atlas


def test_a_seam_moves_to_where_it_is_cheap() -> None:
    p, f = shapes.delaunay_square(900)
    plain = halves((np.c_[p[:, :2], 0.1 * p[:, 0] ** 2], f), 0.0)  # faces of a flat have one price
    height = plain.surface.vertex_points[np.stack(plain.ends)].mean(0)[:, 1]
    cheap = np.abs(height - 0.58) < 0.05
    surface = dataclasses.replace(plain.surface, price=np.where(cheap, 0.2, 1.0))
    atlas = Atlas(surface, plain.cut, plain.corners)
    cost = edge_costs(atlas)
    before = cost[atlas.cut].sum()
    move_seams(atlas, Demands(BOUND, 0.0), Monitor())
    assert cost[atlas.cut].sum() < 0.5 * before
    lengths = atlas.surface.edge_lengths
    inside = lengths[atlas.cut & cheap].sum() / lengths[atlas.cut].sum()
    assert inside > 0.7


def test_one_piece_that_breaks_the_bound_does_not_hold_the_others_back() -> None:
    """A spike beside the seam: whoever takes its tip over to the other chart pays for it."""
    plain = halves(shapes.delaunay_square(1200), 0.1)
    p = plain.surface.points.copy()
    at = np.array([0.5, 0.5])
    p[:, 2] += 0.5 * np.exp(-((np.linalg.norm(p[:, :2] - at, axis=1) / 0.05) ** 2))
    atlas = halves((p, plain.surface.faces), 0.1)
    bound = float(energies(*atlas.open()).max()) * 1.0005
    length = atlas.seam_length
    move_seams(atlas, Demands(bound, 0.0), Monitor())
    assert atlas.seam_length < length
    assert (energies(*atlas.open()) <= bound).all()
