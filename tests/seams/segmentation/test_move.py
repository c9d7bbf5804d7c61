"""Pieces of seams that move to where they cost less, as far as charts stay good."""

import dataclasses

import numpy as np

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.evaluate import Demands
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.move import move_seams
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import cut_between, energies, middles, surface_of

BOUND = 1.05


def priced(atlas: Atlas, price: np.ndarray) -> Atlas:
    surface = dataclasses.replace(atlas.surface, price=price)
    return Atlas(surface, atlas.cut, atlas.corners)


def halves(shape: tuple[np.ndarray, np.ndarray], wave: float, n: float = 5) -> Atlas:
    """A shape cut in two at y = 0.5, or along a wave round that, and laid out."""
    surface = surface_of(*shape)
    middle = middles(surface)
    middle = (middle - middle.min(0)) / np.ptp(middle[:, :2], axis=0).max()
    atlas = cut_between(surface, (middle[:, 1] > 0.5 + wave * np.sin(n * middle[:, 0])).astype(int))
    lay_out_fresh(atlas, None, RelaxOptions(tolerance=1e-4, max_iterations=40))
    return atlas


def heights(atlas: Atlas) -> np.ndarray:
    """(e,) y of the middle of every edge."""
    a, b = atlas.ends
    return atlas.surface.vertex_points[np.stack([a, b])].mean(0)[:, 1]


def test_a_winding_seam_gets_straight() -> None:
    atlas = halves(shapes.delaunay_square(900), 0.12)
    before = atlas.seam_length
    move_seams(atlas, Demands(BOUND, 0.0), Monitor())
    assert atlas.charts()[0] == 2
    assert atlas.seam_length < 0.9 * before


def test_a_seam_moves_to_where_it_is_cheap() -> None:
    p, f = shapes.delaunay_square(900)
    plain = halves((np.c_[p[:, :2], 0.1 * p[:, 0] ** 2], f), 0.0)  # faces of a flat have one price
    cheap = np.abs(heights(plain) - 0.58) < 0.05
    atlas = priced(plain, np.where(cheap, 0.2, 1.0))
    cost = edge_costs(atlas)
    before = cost[atlas.cut].sum()
    move_seams(atlas, Demands(BOUND, 0.0), Monitor())
    assert cost[atlas.cut].sum() < 0.5 * before
    lengths = atlas.surface.edge_lengths
    inside = lengths[atlas.cut & cheap].sum() / lengths[atlas.cut].sum()
    assert inside > 0.7


def test_what_would_break_the_bound_stays() -> None:
    atlas = halves(shapes.hemisphere(14), 0.1)
    cut, corners = atlas.cut.copy(), atlas.corners.copy()
    move_seams(atlas, Demands(1 + 1e-6, 0.0), Monitor())
    assert np.array_equal(atlas.cut, cut)
    assert np.array_equal(atlas.corners, corners)


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


def test_no_time_no_move() -> None:
    atlas = halves(shapes.delaunay_square(900), 0.12)
    cut = atlas.cut.copy()
    monitor = Monitor(timeout=1e-9)
    move_seams(atlas, Demands(BOUND, 0.0), monitor)
    assert monitor.expired
    assert np.array_equal(atlas.cut, cut)
