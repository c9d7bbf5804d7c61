"""Arcs of the seams between junctions."""

import numpy as np
import pytest

from circparam.seams.segmentation.arcs import arcs_of
from tests.support import shapes
from tests.support.atlases import cut_where, uncut


def test_a_slit_has_a_tip_and_one_chart_on_both_sides() -> None:
    """From the boundary inwards it has one free end; from boundary to boundary it has none."""
    atlas = uncut(*shapes.grid(9, 9))
    x, y = atlas.surface.points[:, 0], atlas.surface.points[:, 1]
    for reach, tip in ((0.5, True), (0.875, True), (1.0, False)):
        atlas.cut = cut_where(atlas.surface, (np.abs(y - 0.5) < 1e-9) & (x < reach + 1e-9))
        arcs = arcs_of(atlas, atlas.charts()[1])
        assert arcs.tip.tolist() == [tip]
        assert arcs.length == pytest.approx([reach])
        assert (arcs.left == arcs.right).tolist() == [tip]
    # in the middle, both ends are free
    atlas.cut = cut_where(atlas.surface, (np.abs(y - 0.5) < 1e-9) & (np.abs(x - 0.5) < 0.3))
    arcs = arcs_of(atlas, atlas.charts()[1])
    assert arcs.tip.tolist() == [True]
    assert len(arcs.edge) == 4
