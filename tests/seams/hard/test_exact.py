"""Boxes and other polyhedra are unfolded without distortion where that is worth its seams."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import chart_distortion
from circparam.mesh.atlas import Atlas
from circparam.seams import SEAMS
from circparam.seams.options import SeamOptions
from tests.support import shapes
from tests.support.atlases import assert_promises, surface_of
from tests.support.parts import Part, extrude, rectangle


def charts_of(part: Part) -> Atlas:
    surface = surface_of(part.points, part.faces)
    seams = SEAMS["charts"].function(surface, SeamOptions(), Monitor())
    atlas = Atlas(surface, seams.cut, seams.uv)
    assert_promises(atlas, 1.05)
    return atlas


def distortion(atlas: Atlas) -> float:
    cut_mesh, uv = atlas.open()
    return float(np.average(chart_distortion(cut_mesh, uv), weights=cut_mesh.chart_areas))


def turned(part: Part) -> Part:
    points = part.points @ shapes.rotation(3).T
    return Part(points, part.faces, part.surface, part.flat, part.tube)


@pytest.mark.parametrize("turn", [False, True])
def test_a_cube_is_unfolded_to_a_net_of_six_squares(turn) -> None:
    """Seven of its twelve edges are cut, and every face is a unit square in the plane."""
    part = extrude(rectangle(1.0, 1.0), [], 1.0)
    atlas = charts_of(turned(part) if turn else part)
    assert atlas.charts()[0] == 1
    assert distortion(atlas) == pytest.approx(1.0, abs=1e-9)
    assert atlas.surface.edge_lengths[atlas.cut].sum() == pytest.approx(7.0)


@pytest.mark.parametrize("refine", [1, 2, 3, 4])
def test_so_is_a_cube_of_any_triangles(refine: int) -> None:
    points, faces = shapes.cube(refine)
    surface = surface_of(points, faces)
    seams = SEAMS["charts"].function(surface, SeamOptions(), Monitor())
    atlas = Atlas(surface, seams.cut, seams.uv)
    assert distortion(atlas) == pytest.approx(1.0, abs=1e-9)
    assert surface.edge_lengths[atlas.cut].sum() == pytest.approx(7.0)
