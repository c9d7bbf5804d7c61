"""Normals and tangents of known surfaces."""

import numpy as np

from circparam.geometry.shading import corner_normals, frames


def test_uv_without_a_direction_still_have_a_frame():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    labels = np.array([[0, 1, 2]])
    space = frames(corners, np.zeros((1, 3, 2)), labels, corner_normals(corners, labels))
    assert np.allclose(np.linalg.norm(space.tangent, axis=2), 1)
    assert np.allclose((space.tangent * space.normal).sum(2), 0)
