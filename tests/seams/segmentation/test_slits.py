"""Slits from the boundary of a chart towards a vertex."""

import dataclasses

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.slits import slit_to
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_where, uncut

HERE = np.array([0.25, 0.5])


def vertex_at(atlas: Atlas, place: np.ndarray) -> np.ndarray:
    """(1,) the vertex of the cut mesh at a place of a flat atlas."""
    as_it_lies(atlas)
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    return np.array([((uv - place) ** 2).sum(1).argmin()])


def slit(atlas: Atlas, place: np.ndarray) -> np.ndarray:
    """(1,) bool: the one chart of a flat atlas was cut open towards a place."""
    peak = vertex_at(atlas, place)
    return slit_to(atlas, atlas.cut_mesh(), peak)


def points_of(atlas: Atlas, edges: np.ndarray) -> np.ndarray:
    """(k, 2, 2) ends of edges."""
    points = atlas.surface.vertex_points[:, :2]
    a, b = (ends[edges] for ends in atlas.ends)
    return np.stack([points[a], points[b]], 1)


def test_a_slit_goes_straight_from_the_nearest_boundary_to_a_vertex() -> None:
    atlas = uncut(*shapes.grid(17, 17))
    done = slit(atlas, HERE)
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
    assert slit(atlas, HERE).all()
    assert not (atlas.cut & locked).any()
    assert 0.25 < atlas.seam_length < 0.4
    assert np.abs(points_of(atlas, atlas.cut) - HERE).sum(2).min() == 0
    closed = Atlas(
        dataclasses.replace(surface, locked=np.ones(len(locked), bool)), np.zeros(len(locked), bool)
    )
    assert not slit(closed, HERE).any()
    assert not closed.cut.any()
