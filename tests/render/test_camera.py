"""Which sides of a surface are shown, and what is up."""

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.render.camera import best_directions, up_vector
from circparam.render.scene import make_scene
from tests.support.scenes import bowl, cube, flat_quad


def test_best_views_see_the_front_of_an_open_surface():
    points, faces = bowl()
    scene = make_scene(points, faces, points[:, [2, 0]], faces)
    assert scene.normals[:, 1].min() > 0
    directions = best_directions(scene, 2)
    assert directions[0] @ [0, 1, 0] > 0
    assert directions[0] @ directions[1] < 0.82
    turned = make_scene(points, faces[:, ::-1], points[:, [2, 0]], faces[:, ::-1])
    assert best_directions(turned, 1)[0] @ [0, 1, 0] < 0
    with pytest.raises(OptionError, match="up axis"):
        best_directions(scene, 2, up="w")


def test_up_is_where_the_feet_are_not():
    """A table stands on four feet: they span the outline along the axis that points up, and along no other."""
    points, faces, uv, uv_faces = cube()
    parts = [points * [1.0, 0.05, 0.7] + [0.0, 1.0, 0.0]]
    for x in (-0.7, 0.7):
        for z in (-0.5, 0.5):
            parts.append(points * [0.06, 0.5, 0.06] + [x, 0.5, z])
    points = np.concatenate(parts)
    faces, uv_faces = (np.concatenate([f + 24 * k for k in range(5)]) for f in (faces, uv_faces))
    uv = np.concatenate([uv] * 5)
    assert np.array_equal(up_vector(make_scene(points, faces, uv, uv_faces)), [0, 1, 0])
    lying = points[:, [2, 0, 1]]
    assert np.array_equal(up_vector(make_scene(lying, faces, uv, uv_faces)), [0, 0, 1])
    assert np.array_equal(up_vector(flat_quad()), [0, 1, 0])
