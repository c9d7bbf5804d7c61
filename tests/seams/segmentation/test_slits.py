"""Slits: the shortest way from a boundary to a place inside."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.seams.segmentation.slits import slit_to, smoothed_area_distortion
from tests.support import shapes


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
    atlas, cut_mesh, place, rim = opened(shapes.grid(9, 9))
    peak = np.flatnonzero(np.abs(place[:, :2] - [3 / 8, 4 / 8]).max(1) < 1e-9)
    done = slit_to(atlas, cut_mesh, peak, rim, reach)
    assert done.tolist() == [True]
    assert atlas.cut.sum() == steps
    assert length(atlas) == pytest.approx(steps / 8)
    # it begins at the boundary: a slit that does not would leave the number of boundary loops higher
    assert atlas.cut_mesh().euler().tolist() == [1]


def test_a_slit_leads_where_it_may():
    atlas, cut_mesh, place, rim = opened(shapes.grid(9, 9))
    peak = np.flatnonzero(np.abs(place[:, :2] - [3 / 8, 4 / 8]).max(1) < 1e-9)
    slit_to(atlas, cut_mesh, peak, rim & (place[:, 0] > 0.99))
    assert length(atlas) == pytest.approx(5 / 8)
    nowhere = slit_to(atlas, cut_mesh, peak, np.zeros_like(rim))
    assert nowhere.tolist() == [False]
    assert length(atlas) == pytest.approx(5 / 8)


def test_a_slit_from_a_hole_to_the_outer_boundary_opens_a_ring():
    atlas, cut_mesh, place, rim = opened(shapes.annulus(24, 5))
    radius = np.hypot(place[:, 0], place[:, 1])
    inner = rim & (radius < radius[rim].mean())
    peak = np.flatnonzero(inner)[:1]
    assert cut_mesh.euler().tolist() == [0]
    slit_to(atlas, cut_mesh, peak, rim & ~inner)
    after = atlas.cut_mesh()
    assert after.euler().tolist() == [1]
    assert after.n_charts == 1


def test_slits_to_several_peaks_do_not_cut_anything_off():
    atlas, cut_mesh, _, rim = opened(shapes.bumped_disk(800))
    inside = np.flatnonzero(~rim)
    peaks = inside[:: len(inside) // 7]
    slit_to(atlas, cut_mesh, peaks, rim)
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
