"""Slits from a chart's boundary to where it is distorted most."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.seams.segmentation.layout import ChartLayouts, judge
from circparam.seams.segmentation.slits import slit_charts, slit_to, smoothed_area_distortion
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, cut_where, middles, surface_of, uncut

HERE = np.array([0.25, 0.5])


def swollen(atlas: Atlas, *centres: np.ndarray) -> ChartLayouts:
    """A flat atlas laid out as it lies, but swollen round some points."""
    as_it_lies(atlas)
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    out = uv.copy()
    for centre in centres:
        away = uv - centre
        out += 0.4 * away * np.exp(-(away**2).sum(1) / 0.01)[:, None]
    laid = judge(cut_mesh, out)
    assert np.isfinite(laid.energy).all()
    return laid


def points_of(atlas: Atlas, edges: np.ndarray) -> np.ndarray:
    """(k, 2, 2) ends of edges."""
    points = atlas.surface.vertex_points[:, :2]
    a, b = (ends[edges] for ends in atlas.ends)
    return np.stack([points[a], points[b]], 1)


def test_a_slit_goes_straight_from_the_nearest_boundary_to_the_worst_vertex() -> None:
    atlas = uncut(*shapes.grid(17, 17))
    done = slit_charts(atlas, swollen(atlas, HERE), np.ones(1, bool))
    assert done.tolist() == [True]
    ends = points_of(atlas, atlas.cut)
    assert atlas.seam_length == pytest.approx(0.25)
    assert (ends[..., 1] == 0.5).all()
    assert (ends[..., 0].min(), ends[..., 0].max()) == (0.0, 0.25)


def test_only_the_charts_named_are_slit_each_from_its_own_boundary() -> None:
    surface = surface_of(*shapes.grid(17, 17))
    for which in ([True, False], [False, True], [True, True], [False, False]):
        right = (middles(surface)[:, 0] > 0.5).astype(np.int64)
        atlas = cut_between(surface, right)
        before = atlas.cut.copy()
        laid = swollen(atlas, [0.1875, 0.5], [0.625, 0.8125])
        side = np.unique(np.c_[laid.cut_mesh.chart, right], axis=0)
        assert side.tolist() in ([[0, 0], [1, 1]], [[0, 1], [1, 0]])
        chosen = np.array(which)[side[:, 1]]
        done = slit_charts(atlas, laid, chosen)
        assert np.array_equal(done, chosen)
        new = atlas.cut & ~before
        assert atlas.cut[before].all()
        ends = points_of(atlas, new)
        left, right_ends = ends[ends[..., 0].max(1) < 0.5], ends[ends[..., 0].min(1) >= 0.5]
        assert len(left) == (3 if which[0] else 0)
        assert len(right_ends) == (2 if which[1] else 0)
        assert len(ends) == len(left) + len(right_ends)
        if which[1]:
            assert (right_ends[..., 1] == 0.8125).all()


def test_a_slit_may_start_from_an_older_one() -> None:
    """The boundary of the cut mesh counts, whether the surface ends there or not."""
    atlas = uncut(*shapes.grid(17, 17))
    x, y = atlas.surface.points[:, 0], atlas.surface.points[:, 1]
    first = cut_where(atlas.surface, (y == 0.5) & (x <= 0.5))
    atlas.cut = first.copy()
    assert slit_charts(atlas, swollen(atlas, [0.5, 0.625]), np.ones(1, bool)).all()
    new = points_of(atlas, atlas.cut & ~first)
    assert len(new) == 2
    assert (new[..., 0] == 0.5).all()
    assert (new[..., 1].min(), new[..., 1].max()) == (0.5, 0.625)


def test_no_slit_runs_along_locked_edges() -> None:
    atlas = uncut(*shapes.grid(17, 17))
    surface = atlas.surface
    x, y = surface.points[:, 0], surface.points[:, 1]
    locked = cut_where(surface, (y == 0.5) & (x <= 0.25))
    atlas = Atlas(dataclasses.replace(surface, locked=locked), atlas.cut)
    assert slit_charts(atlas, swollen(atlas, HERE), np.ones(1, bool)).all()
    assert not (atlas.cut & locked).any()
    assert 0.25 < atlas.seam_length < 0.4
    assert np.abs(points_of(atlas, atlas.cut) - HERE).sum(2).min() == 0
    closed = Atlas(dataclasses.replace(surface, locked=np.ones(len(locked), bool)), 0 * locked)
    assert not slit_charts(closed, swollen(closed, HERE), np.ones(1, bool)).any()
    assert not closed.cut.any()


def test_charts_without_inner_vertices_or_with_flips_are_left_alone() -> None:
    atlas = uncut(*shapes.grid(2, 5))
    assert not slit_charts(atlas, swollen(atlas, HERE), np.ones(1, bool)).any()
    atlas = uncut(*shapes.grid(9, 9))
    laid = swollen(atlas, HERE)
    flipped = judge(laid.cut_mesh, laid.uv * [-1, 1])
    assert not slit_charts(atlas, flipped, np.ones(1, bool)).any()
    assert not atlas.cut.any()


def opened(shape):
    surface, _ = repair(Mesh(*shape))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    cut_mesh = atlas.cut_mesh()
    place = np.zeros((cut_mesh.n_vertices, 3))
    place[cut_mesh.faces.ravel()] = surface.points[surface.faces.ravel()]
    rim = np.zeros(cut_mesh.n_vertices, bool)
    rim[cut_mesh.faces.ravel()[cut_mesh.boundary]] = True
    return atlas, cut_mesh, place, rim


def length(atlas):
    return atlas.surface.edge_lengths[atlas.cut].sum()


@pytest.mark.parametrize(("reach", "steps"), [(1.0, 3), (0.5, 2), (0.01, 1)])
def test_a_slit_is_the_shortest_way_or_the_part_of_it_that_is_wanted(reach, steps):
    atlas, cut_mesh, place, _ = opened(shapes.grid(9, 9))
    peak = np.flatnonzero(np.abs(place[:, :2] - [3 / 8, 4 / 8]).max(1) < 1e-9)
    done = slit_to(atlas, cut_mesh, peak, reach)
    assert done.tolist() == [True]
    assert atlas.cut.sum() == steps
    assert length(atlas) == pytest.approx(steps / 8)
    # it begins at the boundary: a slit that does not would leave the number of boundary loops higher
    assert atlas.cut_mesh().euler().tolist() == [1]


def test_slits_to_several_peaks_do_not_cut_anything_off():
    atlas, cut_mesh, _, rim = opened(shapes.bumped_disk(800))
    inside = np.flatnonzero(~rim)
    peaks = inside[:: len(inside) // 7]
    slit_to(atlas, cut_mesh, peaks)
    after = atlas.cut_mesh()
    assert after.n_charts == 1
    assert after.euler().tolist() == [1]
    ends = np.r_[atlas.ends[0][atlas.cut], atlas.ends[1][atlas.cut]]
    assert np.isin(peaks, ends).sum() >= 4  # others may be shut in between these


def test_the_distortion_of_areas_is_the_same_where_it_is_even():
    _, cut_mesh, place, _ = opened(shapes.grid(9, 9))
    for factor in (3.0, 1 / 3):
        field = smoothed_area_distortion(cut_mesh, factor * place[:, :2])
        np.testing.assert_allclose(field, 2 * np.log(3))
