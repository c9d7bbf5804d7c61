"""Developable charts laid out exactly, and the slits that they need."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.hard.unroll import slits, transported, unroll
from circparam.seams.prices import edge_prices
from tests.support import shapes
from tests.support.atlases import energies, surface_of


def test_a_tube_is_unrolled_along_a_straight_line() -> None:
    """An open tube of quads in rings: one slit from end to end, as long as the tube, and no distortion."""
    surface = surface_of(*shapes.cylinder(around=24, along=6, height=2.0))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool), prices=edge_prices(surface))
    atlas.cut |= slits(atlas)
    assert surface.edge_lengths[atlas.cut].sum() == pytest.approx(2.0)
    cut_mesh = atlas.cut_mesh()
    uv = unroll(cut_mesh)
    assert energies(cut_mesh, uv) == pytest.approx([1.0], abs=1e-9)
    size = np.sort(np.ptp((uv - uv.mean(0)) @ np.linalg.svd(uv - uv.mean(0))[2].T, axis=0))
    assert size == pytest.approx([2.0, 24 * 2 * np.sin(np.pi / 24)], rel=1e-6)


def test_holes_in_a_plane_need_no_slit_and_cone_tips_do() -> None:
    plane = surface_of(*shapes.annulus())
    atlas = Atlas(plane, np.zeros(len(plane.edges), bool), prices=edge_prices(plane))
    assert not slits(atlas).any()
    cone = surface_of(*shapes.cone())
    atlas = Atlas(cone, np.zeros(len(cone.edges), bool), prices=edge_prices(cone))
    atlas.cut |= slits(atlas)
    cut_mesh = atlas.cut_mesh()
    assert energies(cut_mesh, unroll(cut_mesh)) == pytest.approx([1.0], abs=1e-9)


def test_bent_sheets_are_rolled_out_exactly() -> None:
    """Every chart by itself, at whatever scale."""
    strip = shapes.half_cylinder(12, 4, 2.0)
    cone = shapes.cone(16, 4, slit=True)
    surface = surface_of(*shapes.join(strip, (cone[0] * 10 + np.array([30.0, 0, 0]), cone[1])))
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    uv = unroll(cut_mesh)
    assert energies(cut_mesh, uv) == pytest.approx([1.0, 1.0], abs=1e-9)
    first = uv[cut_mesh.vertex_chart == 0]
    diagonal = np.linalg.norm(first[:, None] - first, axis=2).max()
    assert diagonal == pytest.approx(np.hypot(1.0, 24 * np.sin(1 / 12)), rel=1e-9)


def uncut_hard(shape) -> Atlas:
    surface = surface_of(*shape)
    return Atlas(surface, np.zeros(len(surface.edges), bool), prices=edge_prices(surface))


def test_only_charts_that_are_named_are_slit() -> None:
    tube = shapes.cylinder(around=24, along=3)
    atlas = uncut_hard(shapes.row_of(tube, 2))
    _, chart = atlas.charts()
    for which in ([True, False], [False, True]):
        new = slits(atlas, np.array(which))
        assert new.any()
        assert np.array(which)[chart[atlas.surface.edges[new, 0] // 3]].all()
        length = atlas.surface.edge_lengths[new].sum()
        assert length == pytest.approx(2.0)
    assert slits(atlas).sum() == 6
    assert not slits(atlas, np.zeros(2, bool)).any()


def test_a_closed_tube_is_slit_to_both_tips_and_a_box_between_its_corners() -> None:
    """Every tip of curvature is joined; what is flat inside needs nothing."""
    atlas = uncut_hard(shapes.cube(2))
    new = slits(atlas)
    atlas.cut |= new
    cut_mesh = atlas.cut_mesh()
    # a tree through all eight corners, along sharp edges: seven of them
    assert atlas.surface.edge_lengths[new].sum() == pytest.approx(7.0)
    assert energies(cut_mesh, unroll(cut_mesh)) == pytest.approx([1.0], abs=1e-9)
    # a cap alone: one tip and one boundary, hence one slit
    cap = uncut_hard(shapes.cone(24, 3))
    new = slits(cap)
    assert cap.surface.edge_lengths[new].sum() == pytest.approx(np.hypot(1, 1.5))
    flat = uncut_hard(shapes.grid(5, 5))
    assert not slits(flat).any()


def test_moving_faces_bend_along_with_the_nearest_that_stay() -> None:
    """A strip between two ends that are turned apart; its cells get longer, so the middle is not that of
    their count."""
    x = np.cumsum(np.r_[0.0, 0.05 * 1.35 ** np.arange(16)])
    points = np.stack([np.repeat(x, 2), np.tile([0, 0.1], 17), np.zeros(34)], 1)
    k = 2 * np.arange(16)
    faces = np.r_[np.stack([k, k + 2, k + 3], 1), np.stack([k, k + 3, k + 1], 1)]
    surface = surface_of(points, faces)
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    # the rest triangles lie along their first sides
    own = np.arctan2(*np.moveaxis(points[faces[:, 1]] - points[faces[:, 0]], 1, 0)[[1, 0]])
    cell = np.r_[np.arange(16), np.arange(16)]
    moves = (cell > 0) & (cell < 15)
    given = own + np.where(cell == 15, 1.0, 0.0) + np.where(moves, 0.3, 0.0)
    bent = transported(cut_mesh, rotations(given), moves)
    # the way goes from face to face: its length is that of half the sum of their mean sides, twice
    middle = cut_mesh.edge_lengths.mean(1)
    way = np.concatenate([[c, c + 16] for c in range(16)])
    way = way if shares(faces[way[1]], faces[way[2]]) else way.reshape(-1, 2)[:, ::-1].ravel()
    assert all(shares(faces[p], faces[q]) for p, q in pairwise(way))
    step = np.cumsum(np.r_[0.0, middle[way[:-1]] + middle[way[1:]]])
    at = np.empty(32)
    at[way] = step
    from_left = at - step[1]
    from_right = step[30] - at
    expected = own + np.where(moves, from_right < from_left, cell == 15)
    assert 2 < np.sum(moves & (from_right < from_left)) < 26
    assert np.allclose(bent, rotations(expected), atol=1e-9)
    # nothing stays: nothing to bend round
    assert transported(cut_mesh, rotations(given), np.ones(32, bool)) == pytest.approx(
        rotations(given)
    )


def rotations(angle: np.ndarray) -> np.ndarray:
    """(2, 2, m)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, -s]), np.stack([s, c])])


def shares(one: np.ndarray, other: np.ndarray) -> bool:
    """Two faces have a side in common."""
    return len(np.intersect1d(one, other)) == 2
