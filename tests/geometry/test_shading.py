"""Normals and tangents of known surfaces."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.shading import corner_normals, frames
from tests.support.baking import sheet


def random_turn(seed: int) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 99), st.booleans(), st.floats(0.2, 5))
def test_frames_of_a_plane_are_its_axes(seed: int, mirrored: bool, stretch: float):
    """t along growing u, the bitangent along growing v, mirrored or not, however the uv are scaled."""
    points, faces = sheet(3)
    uv = points[:, :2] * [(-1 if mirrored else 1), stretch]
    turn = random_turn(seed)
    corners = (points @ turn.T)[faces]
    normal = corner_normals(corners, faces)
    found = frames(corners, uv[faces], faces, normal)
    assert np.allclose(normal, turn[:, 2])
    assert np.allclose(found.tangent, -turn[:, 0] if mirrored else turn[:, 0])
    assert np.allclose(found.bitangent, turn[:, 1])
    assert (found.sign == (-1 if mirrored else 1)).all()


def test_uv_without_a_direction_still_have_a_frame():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    labels = np.array([[0, 1, 2]])
    space = frames(corners, np.zeros((1, 3, 2)), labels, corner_normals(corners, labels))
    assert np.allclose(np.linalg.norm(space.tangent, axis=2), 1)
    assert np.allclose((space.tangent * space.normal).sum(2), 0)
