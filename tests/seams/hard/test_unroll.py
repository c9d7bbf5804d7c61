"""Developable charts laid out exactly, and the slits that they need."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.hard.unroll import slits, unroll
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
