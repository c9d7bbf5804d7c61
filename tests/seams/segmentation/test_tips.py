"""What is stretched too much is cut out along a short loop, where that is cheaper than a slit or a split."""

from __future__ import annotations

import numpy as np

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import face_stretch
from circparam.seams.segmentation import tail
from circparam.seams.segmentation.grow import dual_graph
from circparam.seams.segmentation.tail import hold_stretch
from circparam.seams.segmentation.tips import PLACES, REST, cut_tips
from circparam.seams.segmentation.weigh import Limits, share_over
from tests.seams.segmentation.test_tail import sound
from tests.support import shapes
from tests.support.atlases import middles, relaxed, uncut

LIMITS = Limits(1.5, 2.0)


def far_of(atlas, most=LIMITS.most):
    cut_mesh, uv = atlas.open()
    return face_stretch(cut_mesh, uv) > most


def test_a_spire_far_from_any_boundary_is_cut_out_at_its_foot():
    atlas, _ = relaxed(shapes.spire())
    hold_stretch(atlas, LIMITS, Monitor())
    cut_mesh, uv = atlas.open()
    assert share_over(cut_mesh, face_stretch(cut_mesh, uv), 2.0).sum() <= 1e-3
    sound(atlas, LIMITS.bound)
    assert atlas.charts()[0] >= 2
    # the way from the boundary to the spire alone is 0.95, the loop round its foot 0.31
    assert atlas.surface.edge_lengths[atlas.cut].sum() < 0.8


def test_no_chart_is_cut_out_where_charts_may_not_be_split():
    atlas, _ = relaxed(shapes.spire())
    hold_stretch(atlas, LIMITS, Monitor(), splits=False)
    assert atlas.charts()[0] == 1


def test_what_is_cut_out_holds_the_stretched_faces_and_little_else():
    atlas, _ = relaxed(shapes.spire())
    far = far_of(atlas)
    assert far.any()
    before = atlas.corners.copy()
    within = cut_tips(atlas, dual_graph(atlas.surface), far, LIMITS.allowed)
    areas = atlas.surface.areas
    assert areas[far & ~within].sum() < REST * LIMITS.allowed * areas.sum()
    assert np.hypot(*middles(atlas.surface)[within, :2].T).max() < 0.1
    count, chart = atlas.charts()
    assert count == 2
    assert len(np.unique(chart[within])) == len(np.unique(chart[~within])) == 1
    assert np.array_equal(atlas.corners, before)


def test_a_surface_that_is_curved_all_over_has_no_tips():
    atlas = uncut(*shapes.icosphere(3))
    far = np.zeros(len(atlas.surface.faces), bool)
    far[:: len(far) // (2 * PLACES)] = True  # everywhere
    assert not cut_tips(atlas, dual_graph(atlas.surface), far, 1e-6).any()
    assert not atlas.cut.any()


def test_locked_edges_are_not_cut():
    atlas, _ = relaxed(shapes.spire())
    atlas.surface.locked[:] = True
    assert not cut_tips(atlas, dual_graph(atlas.surface), far_of(atlas), 1e-4).any()
    assert not atlas.cut.any()


def test_splits_end_when_their_work_is_done(monkeypatch):
    """Charts that splits hardly help are not split again and again."""
    atlas, _ = relaxed(shapes.spire())
    tried = []
    monkeypatch.setattr(tail, "_peaks", lambda *_: np.zeros(0, np.int64))
    monkeypatch.setattr(tail, "_cut_out", lambda *_: None)
    monkeypatch.setattr(tail, "_split", lambda *_: tried.append(1) is None)
    monkeypatch.setattr(tail, "FREE", 0)
    hold_stretch(atlas, LIMITS, Monitor())
    assert len(tried) == tail.SPLITTING
