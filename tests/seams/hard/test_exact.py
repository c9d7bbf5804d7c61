"""Boxes and other polyhedra are unfolded without distortion where that is worth its seams."""

import numpy as np
import pytest

from circparam.geometry.distortion import chart_distortion
from tests.support import shapes
from tests.support.atlases import assert_promises, charts_of, surface_of
from tests.support.parts import cube


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
