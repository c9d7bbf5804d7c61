"""Two layouts moved together, as they are or bent."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.geometry.overlap import self_overlapping
from circparam.mesh.atlas import Atlas
from circparam.seams.hard.fit import composed
from circparam.seams.hard.regions import (
    turns,
)
from circparam.seams.hard.unroll import unroll
from circparam.seams.segmentation.unions import _turns
from tests.support import shapes
from tests.support.atlases import surface_of
from tests.support.parts import extrude, rectangle


def test_layouts_that_fit_along_a_hinge_are_joined_exactly() -> None:
    """Two sides of a box, each laid out somewhere: moved together they are the box untangled."""
    part = extrude(rectangle(1.0, 1.0))
    surface = surface_of(part.points, part.faces)
    label = part.surface[surface.source]
    angle, _ = turns(surface)
    two = np.isin(label, [0, 2])
    sides = surface.part(two)
    cut = np.zeros(len(sides.edges), bool)
    apart = Atlas(sides, turns(sides)[0] > 1)
    cut_mesh = apart.cut_mesh()
    uv = unroll(cut_mesh)
    rotation = shapes.rotation(3)[:2, :2]
    rotation = np.linalg.svd(rotation)[0]
    rotation[0] *= np.sign(np.linalg.det(rotation))
    moved = cut_mesh.vertex_chart == 1
    uv[moved] = uv[moved] @ rotation + [3.0, -2.0]
    joined = sides.cut_mesh(cut)
    right = cut_mesh.chart == 1
    turn = _turns(joined, uv[cut_mesh.faces], right)
    together, value, parts = composed(joined, uv[cut_mesh.faces], right, turn)
    assert (angle > 1).any()
    assert parts == pytest.approx([1.0])
    assert value == pytest.approx([1.0])
    assert not self_overlapping(joined, together).any()
