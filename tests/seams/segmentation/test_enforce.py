"""Layouts judged, and charts held to the bound: slit, split, pushed apart or laid out anew."""

import dataclasses

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import Roughness
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.layout import eased, judge, lay_out_fresh
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, judged, middles, surface_of, uncut, whole

GAPS = RelaxOptions(tolerance=1e-6, max_iterations=40)


@pytest.mark.parametrize(("turn", "most"), [(3 * np.pi, 4), (16.0, 6)])
def test_charts_that_lie_on_themselves_are_cut_and_good_ones_are_not(
    turn: float, most: int
) -> None:
    """A ring of more than one turn, which nothing pushes apart, beside a flat sheet."""
    ring, sheet = shapes.wound(turn), shapes.grid(12, 12)
    m = len(ring[1])
    atlas = as_it_lies(uncut(*shapes.join(ring, (sheet[0] + [3.0, 0, 0], sheet[1]))))
    surface, flat = atlas.surface, atlas.corners[m:].copy()
    laid = judged(atlas)
    assert laid.overlapping.tolist() == [True, False]
    enforce(atlas, laid, 1.05, GAPS, Monitor())
    after = judged(atlas)
    assert not after.bad(1.05).any()
    on_ring = surface.edges[:, 0] // 3 < m
    assert atlas.cut[on_ring].any()
    assert not atlas.cut[~on_ring].any()
    assert np.array_equal(atlas.corners[m:], flat)
    # cut, not bent: the pieces keep the layout they had
    assert after.energy == pytest.approx(np.ones(after.cut_mesh.n_charts), abs=1e-3)
    # at most one turn each, and the sheet
    assert 1 + np.ceil(turn / (2 * np.pi)) <= after.cut_mesh.n_charts <= most + 1


def test_parts_that_lie_on_each_other_by_little_are_pushed_apart() -> None:
    """Without a seam; a chart above the bound gets one, because a push costs distortion."""
    surface = surface_of(*shapes.wound(2 * np.pi + 0.005))
    laid = judged(as_it_lies(whole(surface)))
    assert laid.overlapping.all()
    for bound, cut in ((1.05, False), (float(np.nextafter(laid.energy[0], 0)), True)):
        atlas = as_it_lies(whole(surface))
        enforce(atlas, laid, bound, GAPS, Monitor())
        assert atlas.cut.any() == cut
        assert not judged(atlas).overlapping.any()


@pytest.mark.parametrize("height", [0.6, 0.7, 0.8])
def test_a_chart_that_is_rough_on_one_side_is_not_cut_into_dust(height: float) -> None:
    """A bump with roughness from 0 to 0.08 across it: of halves with 0.02 and 0.06 no cut brings the second
    below 0.05, and it ends in single faces."""
    points, faces = shapes.bumped_disk(800, height)
    along = (points[faces].mean(1)[:, 0] + 1) / 2
    surface = surface_of(points, faces)
    atlas = whole(dataclasses.replace(surface, roughness=Roughness(0.08 * along, 1.0)))
    laid = lay_out_fresh(atlas, None, GAPS)
    assert laid.energy[0] > 1.05
    enforce(atlas, laid, 1.05, GAPS, Monitor())
    assert not judged(atlas).bad(1.05).any()
    assert atlas.charts()[0] <= 4


def test_good_charts_and_single_cells_are_left_as_they_are() -> None:
    atlas = as_it_lies(uncut(*shapes.grid(5, 5)))
    before = atlas.corners.copy()
    enforce(atlas, judged(atlas), 1.0 + 1e-9, GAPS, Monitor())
    assert not atlas.cut.any()
    assert np.array_equal(atlas.corners, before)
    # one polygon cannot be split
    ball = shapes.hemisphere(3)
    surface = surface_of(*ball)
    surface = dataclasses.replace(surface, locked=np.ones(len(surface.edges), bool))
    atlas = whole(surface)
    laid = lay_out_fresh(atlas, None, GAPS)
    enforce(atlas, laid, 1.001, GAPS, Monitor())
    assert not atlas.cut.any()
    # and when the time is up nothing is begun
    free = uncut(*ball)
    laid = lay_out_fresh(free, None, GAPS)
    enforce(free, laid, 1.001, GAPS, Monitor(timeout=0.0))
    assert not free.cut.any()


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
