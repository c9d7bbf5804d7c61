"""Colours at places of a surface: texels, corners, the closest point of another surface."""

import numpy as np

from circparam.bake.sampling import Closest
from circparam.render.texture import bilinear
from tests.support.baking import sheet, some_places


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
