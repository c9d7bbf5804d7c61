"""Small charts that join their neighbours, or stay as they were."""

from __future__ import annotations

import numpy as np

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams import charts as module
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.seams.segmentation.small import absorb
from circparam.seams.segmentation.unions import MergeOptions
from tests.support import shapes
from tests.support.atlases import surface_of


def straddled() -> Atlas:
    """A sphere in two charts and a third, of a few faces, across the seam between them."""
    surface = surface_of(*shapes.icosphere(3))
    middle = surface.points[surface.faces].mean(1)
    half = (middle[:, 2] > 0).astype(np.int64)
    half[np.linalg.norm(middle - [1.0, 0, 0], axis=1) < 0.25] = 2
    e = surface.edges // 3
    atlas = Atlas(surface, half[e[:, 0]] != half[e[:, 1]])
    assert atlas.charts()[0] == 3
    lay_out_fresh(atlas, None, module.ROUGH)
    return atlas


def test_small_charts_join_their_neighbours_face_by_face() -> None:
    atlas = straddled()
    few = int(np.bincount(atlas.charts()[1]).min())
    assert absorb(atlas, MergeOptions(1.6), few, Monitor()) == 0
    assert atlas.charts()[0] == 3, "as large as asked already"
    # the two halves alone would close to a sphere: the bound keeps them apart
    assert absorb(atlas, MergeOptions(1.6), few + 1, Monitor()) == 0
    n, chart = atlas.charts()
    assert np.bincount(chart).min() > few
    cut_mesh = atlas.cut_mesh()
    laid = judge(cut_mesh, atlas.gather(cut_mesh))
    assert n == 2
    assert not laid.bad(1.6).any()


def test_small_charts_that_nobody_takes_stay_as_they_were() -> None:
    atlas = straddled()
    before = atlas.cut.copy()
    few = int(np.bincount(atlas.charts()[1]).min())
    assert absorb(atlas, MergeOptions(1.0001), few + 1, Monitor()) == 1
    assert np.array_equal(atlas.cut, before)
