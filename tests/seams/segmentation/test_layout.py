"""Layouts judged, and charts laid out anew after their seams have moved."""

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.layout import eased, judge
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, middles, surface_of, uncut


def three() -> Atlas:
    """A sheet in three strips, laid out as it lies."""
    surface = surface_of(*shapes.grid(10, 4, 3.0, 1.0))
    return as_it_lies(cut_between(surface, np.floor(middles(surface)[:, 0]).astype(np.int64)))


def test_flips_stretches_and_overlaps_are_judged_chart_by_chart() -> None:
    atlas = three()
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    of = cut_mesh.vertex_chart
    flipped = uv * np.where(of == 1, -1, 1)[:, None] ** [1, 0]
    stretched = np.where((of == 2)[:, None], flipped * [2, 1], flipped)
    laid = judge(cut_mesh, stretched)
    # (4 + 1/4 + 1 + 1) / 4 for a stretch by two
    assert laid.energy == pytest.approx([1.0, np.inf, 1.5625])
    assert laid.overlapping.tolist() == [False, True, False]
    assert judge(cut_mesh, uv).energy == pytest.approx(np.ones(3))


def test_nearly_collapsed_faces_are_relaxed_and_what_is_far_stays() -> None:
    atlas = as_it_lies(uncut(*shapes.grid(20, 20)))
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    middle = int(np.linalg.norm(uv - uv.mean(0), axis=1).argmin())
    a, b, c = next(f for f in cut_mesh.faces.tolist() if middle in f)
    other = next(v for v in (a, b, c) if v != middle)
    crushed = uv.copy()
    crushed[middle] += 0.99 * (uv[other] - uv[middle])
    before, after = judge(cut_mesh, crushed), judge(cut_mesh, eased(cut_mesh, crushed, 8))
    assert np.isfinite(before.energy).all()
    assert after.energy[0] - 1 < (before.energy[0] - 1) / 10
    far = np.linalg.norm(uv - uv[middle], axis=1) > 0.5 * np.ptp(uv[:, 0])
    assert far.any()
    np.testing.assert_array_equal(after.uv[far], uv[far])
    # without such faces all stays
    np.testing.assert_array_equal(eased(cut_mesh, uv, 8), uv)
