"""Arcs of seams, and slits from a chart's boundary to where it is bent most."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.arcs import arcs_of
from circparam.seams.segmentation.slits import slit_charts
from tests.support import shapes
from tests.support.atlases import cut_where, uncut

HERE = np.array([0.25, 0.5])


def tent() -> Atlas:
    """A flat sheet with one vertex pulled up at HERE."""
    points, faces = shapes.grid(17, 17)
    points[(points[:, :2] == HERE).all(1), 2] = 0.01
    return uncut(points, faces)


def points_of(atlas: Atlas, edges: np.ndarray) -> np.ndarray:
    """(k, 2, 2) ends of edges."""
    points = atlas.surface.vertex_points[:, :2]
    a, b = (ends[edges] for ends in atlas.ends)
    return np.stack([points[a], points[b]], 1)


def test_a_slit_goes_straight_from_the_nearest_boundary_to_the_vertex_that_is_bent_most() -> None:
    atlas = tent()
    done = slit_charts(atlas, atlas.cut_mesh(), np.ones(1, bool))
    assert done.tolist() == [True]
    ends = points_of(atlas, atlas.cut)
    assert atlas.seam_length == pytest.approx(0.25, abs=2e-3)
    assert (ends[..., 1] == 0.5).all()
    assert (ends[..., 0].min(), ends[..., 0].max()) == (0.0, 0.25)


def test_no_slit_runs_along_locked_edges() -> None:
    atlas = tent()
    surface = atlas.surface
    x, y = surface.points[:, 0], surface.points[:, 1]
    locked = cut_where(surface, (y == 0.5) & (x <= 0.25))
    atlas = Atlas(dataclasses.replace(surface, locked=locked), atlas.cut)
    assert slit_charts(atlas, atlas.cut_mesh(), np.ones(1, bool)).all()
    assert not (atlas.cut & locked).any()
    assert 0.25 < atlas.seam_length < 0.4
    assert np.abs(points_of(atlas, atlas.cut) - HERE).sum(2).min() == 0
    closed = Atlas(dataclasses.replace(surface, locked=np.ones(len(locked), bool)), 0 * locked)
    assert not slit_charts(closed, closed.cut_mesh(), np.ones(1, bool)).any()
    assert not closed.cut.any()


@pytest.mark.parametrize("seed", range(4, 8))
def test_the_slit_goes_into_a_bulge_however_rough_the_surface_is(seed: int) -> None:
    """The noise bends single vertices far more than the bulge does."""
    points, faces = shapes.grid(33, 33)
    away = np.linalg.norm(points[:, :2] - HERE, axis=1)
    points[:, 2] = 0.05 * np.exp(-((away / 0.12) ** 2))
    points[:, 2] += np.random.default_rng(seed).normal(size=len(points)) * 0.002
    atlas = uncut(points, faces)
    assert slit_charts(atlas, atlas.cut_mesh(), np.ones(1, bool)).all()
    assert np.linalg.norm(points_of(atlas, atlas.cut) - HERE, axis=2).min() < 0.12


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
