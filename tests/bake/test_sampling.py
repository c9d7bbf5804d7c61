"""The closest point of a surface."""

import numpy as np

from circparam.bake.sampling import Closest
from tests.support.baking import sheet, some_places


def test_closest_finds_points_on_a_surface_exactly():
    points, faces = sheet(9)
    points[:, 2] = 0.2 * np.sin(4 * points[:, 0])
    face, bary = some_places(len(faces), 500)
    places = np.einsum("pk,pkc->pc", bary, points[faces[face]])
    _, _, distance = Closest(points, faces).find(places)
    assert distance.max() < 1e-12
