"""Developable charts laid out exactly, and the slits that they need."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.hard.regions import (
    seam_prices,
)
from circparam.seams.hard.unroll import slits, unroll
from tests.support import shapes
from tests.support.atlases import energies, surface_of


def test_a_tube_is_unrolled_along_a_straight_line() -> None:
    """An open tube of quads in rings: one slit from end to end, as long as the tube, and no distortion."""
    surface = surface_of(*shapes.cylinder(around=24, along=6, height=2.0))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool), prices=seam_prices(surface))
    atlas.cut |= slits(atlas)
    assert surface.edge_lengths[atlas.cut].sum() == pytest.approx(2.0)
    cut_mesh = atlas.cut_mesh()
    uv = unroll(cut_mesh)
    assert energies(cut_mesh, uv) == pytest.approx([1.0], abs=1e-9)
    size = np.sort(np.ptp((uv - uv.mean(0)) @ np.linalg.svd(uv - uv.mean(0))[2].T, axis=0))
    assert size == pytest.approx([2.0, 24 * 2 * np.sin(np.pi / 24)], rel=1e-6)


def test_holes_in_a_plane_need_no_slit_and_cone_tips_do() -> None:
    plane = surface_of(*shapes.annulus())
    atlas = Atlas(plane, np.zeros(len(plane.edges), bool), prices=seam_prices(plane))
    assert not slits(atlas).any()
    cone = surface_of(*shapes.cone())
    atlas = Atlas(cone, np.zeros(len(cone.edges), bool), prices=seam_prices(cone))
    atlas.cut |= slits(atlas)
    cut_mesh = atlas.cut_mesh()
    assert energies(cut_mesh, unroll(cut_mesh)) == pytest.approx([1.0], abs=1e-9)
