"""Small holes closed while seams are decided, components that need no seam, and a chart alone on its page."""

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.multires.holes import close_small_holes, complexity, without_fans
from circparam.seams.segmentation.decide import whole_components
from tests.support import shapes
from tests.support.atlases import surface_of


def wavy(shape: shapes.Shape, height: float) -> shapes.Shape:
    p, f = shape
    low, high = p.min(0), p.max(0)
    q = (p - low) / (high - low).max()
    q[:, 2] = height * np.sin(9 * q[:, 0]) * np.cos(8 * q[:, 1])
    return q, f


@pytest.mark.parametrize("per_hole", [2, 4])
def test_every_small_hole_is_closed_by_faces_without_folds(per_hole: int) -> None:
    surface = surface_of(*wavy(shapes.holed_sheet(25, per_hole), 0.1))
    assert complexity(surface) == 26
    closed = close_small_holes(surface)
    assert complexity(closed) == 1
    m = len(surface.faces)
    assert np.array_equal(closed.faces[:m], surface.faces)
    assert len(np.unique(closed.edges)) == closed.edges.size
    assert (np.diff(closed.edges[:, 0]) > 0).all()
    # the two half-edges of every edge run against each other
    flat, along = closed.faces.ravel(), closed.faces[:, [1, 2, 0]].ravel()
    i, j = closed.edges.T
    assert np.array_equal(flat[i], along[j])
    assert np.array_equal(along[i], flat[j])
    # the faces over the holes lie as the sheet does
    up = surface.normals[:, 2].mean()
    assert (closed.normals[m:, 2] * up > 0).all()
    box = np.ptp(surface.points[:, :2], axis=0).prod()
    flat_area = np.abs(closed.normals[:, 2] * closed.areas).sum()
    assert flat_area == pytest.approx(box, rel=1e-9)


def test_what_no_fan_covers_stays_open() -> None:
    # the boundary of a saddle-shaped hole whose fan would look back at itself, and one that is long
    surface = surface_of(*shapes.annulus(80, 3))
    assert len(close_small_holes(surface).faces) == len(surface.faces)
    assert close_small_holes(surface_of(*shapes.icosphere(1))).faces.shape == (80, 3)


def test_seams_go_back_to_the_surface_itself() -> None:
    surface = surface_of(*shapes.holed_sheet(9, 4))
    closed = close_small_holes(surface)
    atlas = Atlas(closed, np.zeros(len(closed.edges), bool))
    rng = np.random.default_rng(0)
    chosen = rng.random(len(closed.edges)) < 0.1
    atlas.cut = chosen
    back = without_fans(atlas, surface)
    assert len(back.cut) == len(surface.edges)
    ends = {tuple(e) for e in closed.edges[chosen]}
    assert all((tuple(e) in ends) == c for e, c in zip(surface.edges, back.cut, strict=True))


def test_components_that_are_good_charts_stay_whole() -> None:
    flat, bumpy = shapes.grid(8, 8), shapes.bumped_disk(400, height=2.0)
    surface = surface_of(*shapes.join(flat, bumpy))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    whole = whole_components(atlas, 1.01)
    assert np.array_equal(np.unique(surface.source[whole]), np.arange(len(flat[1])))
    lengths = np.linalg.norm(np.diff(atlas.corners[whole][:, [0, 1]], axis=1), axis=2)
    assert lengths.min() > 0
    assert not whole_components(atlas, 1.0 + 1e-15)[~whole].any()
