"""Colours at places of a surface: texels, corners, the closest point of another surface."""

import numpy as np
import pytest

from circparam.bake.sampling import Closest
from circparam.geometry.closest import closest_on_triangles
from circparam.render.texture import bilinear
from tests.support.baking import sheet, some_places
from tests.support.pairs import blob


def test_bilinear_repeats_and_hits_texel_centres():
    image = np.arange(12, dtype=float).reshape(3, 4, 1)
    centres = np.array([[(x + 0.5) / 4, 1 - (y + 0.5) / 3] for y in range(3) for x in range(4)])
    assert np.allclose(bilinear(image, centres)[:, 0], np.arange(12))
    assert np.allclose(bilinear(image, centres + np.array([2.0, -3.0]))[:, 0], np.arange(12))


def test_closest_finds_points_on_a_surface_exactly():
    points, faces = sheet(9)
    points[:, 2] = 0.2 * np.sin(4 * points[:, 0])
    face, bary = some_places(len(faces), 500)
    places = np.einsum("pk,pkc->pc", bary, points[faces[face]])
    _, _, distance = Closest(points, faces).find(places)
    assert distance.max() < 1e-12


def test_samples_lie_on_their_faces_and_cover_them_evenly():
    """The nearest sample leads to the face sought: one beside its face leads elsewhere."""
    points, faces = sheet(3)
    points[:, 2] = np.sin(3 * points[:, 0])
    closest = Closest(points, faces)
    bary, apart = closest_on_triangles(np.asarray(closest.tree.data), points[faces[closest.face]])
    assert apart.max() < 1e-24
    area = np.linalg.norm(
        np.cross(*(points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))), axis=1
    )
    wanted = area / area.sum() * len(bary)
    assert np.bincount(closest.face) == pytest.approx(wanted, abs=3)
    for f in range(len(faces)):
        own = bary[closest.face == f]
        # of a uniform spread over a triangle: mean 1/3, variance 1/18
        assert own.mean(0) == pytest.approx([1 / 3] * 3, abs=0.01)
        assert own.var(0) == pytest.approx([1 / 18] * 3, abs=0.005)


def test_within_reach_the_same_is_found():
    ball = blob(2, 1)
    closest = Closest(ball.points, ball.faces)
    rng = np.random.default_rng(1)
    places = rng.normal(size=(400, 3))
    normals = places / np.linalg.norm(places, axis=1, keepdims=True)
    for look in (None, normals):
        whole = closest.find(places, look)
        some = closest.find(places, look, 0.3)
        within = whole[2] <= 0.3
        assert 0.1 < within.mean() < 0.9
        for a, b in zip(whole, some, strict=True):
            np.testing.assert_array_equal(a[within], b[within])
        assert (some[2][~within] > 0.3).all()
