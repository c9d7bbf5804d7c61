"""Developable charts laid out exactly, the slits that they need, and boxes that become nets."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.geometry.distortion import chart_distortion
from circparam.seams.hard.unroll import slits, unroll
from circparam.seams.prices import edge_prices
from tests.support import shapes
from tests.support.atlases import assert_promises, charts_of, energies, surface_of, whole
from tests.support.parts import cube


def slit_length(shape: shapes.Shape) -> float:
    """Length of the slits that a shape needs: unrolled with them it has no distortion."""
    surface = surface_of(*shape)
    atlas = whole(surface, edge_prices(surface))
    atlas.cut |= slits(atlas)
    cut_mesh = atlas.cut_mesh()
    assert energies(cut_mesh, unroll(cut_mesh)) == pytest.approx(
        np.ones(cut_mesh.n_charts), abs=1e-9
    )
    return float(surface.edge_lengths[atlas.cut].sum())


@pytest.mark.parametrize(
    ("shape", "length"),
    [
        (shapes.cylinder(around=24, along=6, height=2.0), 2.0),  # one slit from end to end
        (shapes.cube(2), 7.0),  # a tree through all eight corners, along sharp edges
        (shapes.cone(24, 3), np.hypot(1, 1.5)),  # one tip and one boundary, hence one slit
        (shapes.annulus(), 0.0),
        (shapes.grid(5, 5), 0.0),
    ],
)
def test_slits_join_tips_and_boundaries_and_what_is_flat_needs_none(shape, length: float) -> None:
    assert slit_length(shape) == pytest.approx(length)


@pytest.mark.parametrize("refine", [0, 1, 2, 3, 4])
@pytest.mark.parametrize("turn", [False, True])
def test_a_cube_is_unfolded_to_a_net_of_six_squares(turn: bool, refine: int) -> None:
    """Seven of its twelve edges are cut, and every face is a unit square in the plane."""
    points, faces = shapes.cube(refine) if refine else (cube().points, cube().faces)
    atlas = charts_of(surface_of(points @ shapes.rotation(3).T if turn else points, faces))
    assert_promises(atlas, 1.05)
    assert atlas.charts()[0] == 1
    assert chart_distortion(*atlas.open()) == pytest.approx(np.ones(1), abs=1e-9)
    assert atlas.surface.edge_lengths[atlas.cut].sum() == pytest.approx(7.0)
