"""Arcs of the seams between junctions."""

import numpy as np
import pytest

from circparam.seams.segmentation.arcs import arcs_of
from tests.support import shapes
from tests.support.atlases import cut_between, cut_where, middles, surface_of, uncut


def test_four_quarters_meet_in_a_junction_of_four_arcs() -> None:
    surface = surface_of(*shapes.grid(9, 9, 4.0, 2.0))
    middle = middles(surface)
    atlas = cut_between(surface, (middle[:, 0] > 2.5).astype(np.int64) + 2 * (middle[:, 1] > 1))
    n, chart = atlas.charts()
    arcs = arcs_of(atlas, chart)
    assert n == 4
    assert sorted(arcs.length.tolist()) == pytest.approx([1.0, 1.0, 1.5, 2.5])
    corner = {tuple(c > [2.5, 1]): int(k) for c, k in zip(middle[:, :2], chart, strict=True)}
    beside = sorted(zip(arcs.left.tolist(), arcs.right.tolist(), strict=True))
    around = [corner[k] for k in ((False, False), (True, False), (True, True), (False, True))]
    expected = [(min(p), max(p)) for p in zip(around, around[1:] + around[:1], strict=True)]
    assert beside == sorted(expected)
    for k in range(4):
        on = arcs.edge[arcs.arc == k]
        assert atlas.lengths[on].sum() == pytest.approx(arcs.length[k])
        ends = np.sort(chart[surface.edges[on] // 3], axis=1)
        assert (ends == [arcs.left[k], arcs.right[k]]).all()


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
