"""Seams of a finished atlas that move to cheaper paths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.arrays import next_half_edge
from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.seams.hard.flats import flat_prices
from circparam.seams.hard.straighten import straighten
from circparam.seams.segmentation.layout import judge
from circparam.seams.segmentation.weigh import Limits
from tests.support import shapes
from tests.support.atlases import (
    as_it_lies,
    cut_between,
    energies,
    middles,
    surface_of,
    voronoi,
)

BOUND = 1.05
LIMITS = Limits(BOUND, 2.0)


def priced(atlas: Atlas, price: np.ndarray | float = 1.0) -> Atlas:
    """The atlas with a price for every edge."""
    none = np.zeros(len(atlas.cut), bool)
    prices = SeamPrices(np.broadcast_to(price, len(none)).astype(float), none, none, none)
    return Atlas(atlas.surface, atlas.cut, atlas.corners, prices)


def paid(atlas: Atlas) -> float:
    """What all seams cost."""
    return float(atlas.lengths[atlas.cut].sum())


def joined(atlas: Atlas) -> bool:
    """Whether both sides of every edge that is not cut have the same uv."""
    flat = atlas.corners.reshape(-1, 2)
    i, j = atlas.surface.edges[~atlas.cut].T
    there = np.r_[flat[next_half_edge(j)] - flat[i], flat[j] - flat[next_half_edge(i)]]
    return bool(np.abs(there).max() < 1e-9)


def in_halves(seed: int, turned: float = 0.0) -> Atlas:
    """A plane sheet in two charts with a ragged seam between them; one of them lies elsewhere, turned."""
    surface = surface_of(*shapes.grid(16, 12))
    x, y = middles(surface)[:, :2].T
    ragged = 0.06 * np.random.default_rng(seed).uniform(-1, 1, 12)
    label = x - np.median(x) > ragged[(12 * (y - y.min()) / np.ptp(y)).astype(int).clip(0, 11)]
    atlas = as_it_lies(cut_between(surface, label))
    c, s = np.cos(turned), np.sin(turned)
    atlas.corners[label] = atlas.corners[label] @ np.array([[c, s], [-s, c]]) + [3, 1]
    return atlas


@given(st.integers(0, 30), st.floats(0, 6))
@settings(max_examples=15, deadline=None)
def test_a_ragged_seam_in_a_plane_is_straightened_without_distortion(
    seed: int, turn: float
) -> None:
    atlas = priced(in_halves(seed, turn))
    count, before = atlas.charts()[0], paid(atlas)
    straighten(atlas, LIMITS, Monitor())
    assert atlas.charts()[0] == count
    assert paid(atlas) < before - 0.01
    assert joined(atlas)
    cut_mesh, uv = atlas.open()
    assert energies(cut_mesh, uv) == pytest.approx(np.ones(cut_mesh.n_charts), abs=1e-9)
    assert not judge(cut_mesh, uv).overlapping.any()


def test_dear_edges_are_left_for_cheap_ones_beside_them() -> None:
    """The seam runs one row beside a line that is cheap."""
    surface = surface_of(*shapes.grid(12, 12))
    x = middles(surface)[:, 0]
    lines = np.unique(surface.points[:, 0].round(9))
    atlas = as_it_lies(cut_between(surface, x > lines[5]))
    at = surface.points[surface.faces].reshape(-1, 3)[:, 0]
    h = surface.edges[:, 0]
    cheap = (np.abs(at[h] - lines[6]) < 1e-9) & (np.abs(at[next_half_edge(h)] - lines[6]) < 1e-9)
    atlas = priced(atlas, np.where(cheap, 0.2, 1.0))
    straighten(atlas, LIMITS, Monitor())
    assert cheap[atlas.cut].sum() > 6  # its ends on the boundary stay where they are
    assert joined(atlas)


def test_a_seam_leaves_the_flats_of_a_ring() -> None:
    atlas = voronoi(shapes.torus(24, 12), 12, 3)
    prices = flat_prices(atlas.surface)
    assert prices is not None
    atlas = Atlas(atlas.surface, atlas.cut, atlas.corners, prices)
    length = atlas.surface.edge_lengths

    def in_flats() -> float:
        return float(length[atlas.cut & prices.flat].sum())

    before = in_flats()
    straighten(atlas, Limits(1.2, 2.0), Monitor())
    assert in_flats() < 0.6 * before


def test_a_junction_moves_where_faces_at_it_are_handed_over() -> None:
    """Three charts of a sheet; one face sticks out into a neighbour, also one at the junction."""
    surface = surface_of(*shapes.grid(8, 8))
    x, y = middles(surface)[:, :2].T
    at = np.unique(surface.points[:, 0].round(9))[4], np.unique(surface.points[:, 1].round(9))[4]
    label = np.where(y > at[1], 2, (x > at[0]).astype(int))
    clean = priced(as_it_lies(cut_between(surface, label)))
    seen = 0
    for face in range(len(label)):
        for other in range(3):
            trial = label.copy()
            trial[face] = other
            atlas = priced(as_it_lies(cut_between(surface, trial)))
            if atlas.charts()[0] != 3 or paid(atlas) < paid(clean) + 1e-9:
                continue
            straighten(atlas, LIMITS, Monitor())
            assert paid(atlas) <= paid(clean) + 1e-9
            seen += 1
    assert seen > 0


def test_nothing_moves_without_time_or_without_seams() -> None:
    atlas = priced(in_halves(1))
    cut = atlas.cut.copy()
    straighten(atlas, LIMITS, Monitor(timeout=0.0))
    assert np.array_equal(atlas.cut, cut)
    whole = priced(as_it_lies(cut_between(atlas.surface, np.zeros(len(atlas.surface.faces)))))
    straighten(whole, LIMITS, Monitor())
    assert not whole.cut.any()


def folded(angle: float) -> Atlas:
    """A sheet folded along two lines, cut in two charts across the middle of its three flats."""
    points, faces = shapes.grid(25, 9)
    points = (points - points.min(0)) / np.ptp(points[:, 0])
    plane = surface_of(points, faces)
    flat = as_it_lies(cut_between(plane, middles(plane)[:, 0] > 0.5))
    x = points[:, 0]
    bent = np.maximum(x - 2 / 3, 0.0), np.maximum(1 / 3 - x, 0.0)
    c, s = np.cos(angle), np.sin(angle)
    there = np.clip(x, 1 / 3, 2 / 3) + c * bent[0] - c * bent[1]
    surface = surface_of(np.stack([there, points[:, 1], -s * (bent[0] + bent[1])], 1), faces)
    return Atlas(surface, flat.cut, flat.corners, flat_prices(surface))


def test_a_seam_far_inside_a_flat_leaves_it_at_once() -> None:
    """The next edge of the flat is further away than a chain moves; all of the smaller part goes over."""
    atlas = folded(0.7)
    assert atlas.flat is not None
    assert (atlas.cut & atlas.flat).any()
    before = paid(atlas)
    straighten(atlas, LIMITS, Monitor())
    assert not (atlas.cut & atlas.flat).any()
    assert atlas.cut.any()
    assert paid(atlas) < before
    assert atlas.charts()[0] == 2
    assert joined(atlas)
    cut_mesh, uv = atlas.open()
    assert energies(cut_mesh, uv) == pytest.approx(np.ones(cut_mesh.n_charts), abs=1e-9)


def test_a_flat_stays_in_two_charts_where_the_way_round_it_costs_more() -> None:
    atlas = folded(0.7)
    assert atlas.prices is not None
    rim = ~atlas.prices.flat & ~atlas.cut
    dear = SeamPrices(np.where(rim, 9.0, 1.0), atlas.prices.flat, rim & False, rim & False)
    atlas = Atlas(atlas.surface, atlas.cut, atlas.corners, dear)
    count, cut = atlas.cut.sum(), atlas.cut.copy()
    straighten(atlas, LIMITS, Monitor())
    assert atlas.cut.sum() == count
    assert np.array_equal(atlas.cut, cut)
