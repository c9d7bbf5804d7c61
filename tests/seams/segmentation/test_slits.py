"""Slits from a chart's boundary to where it is distorted most."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.layout import ChartLayouts, judge
from circparam.seams.segmentation.slits import slit_charts
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_where, uncut

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
