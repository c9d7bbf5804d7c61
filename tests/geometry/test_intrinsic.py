"""Angles, Jacobians, Laplacians and frames: formulas against angles, known triangles and affine maps."""

import numpy as np
import pytest

from circparam.core.arrays import FloatArray
from circparam.geometry.gradient_transfer import spread
from circparam.geometry.intrinsic import (
    corner_angles,
    corner_products,
    cotangents,
    signed_areas,
    tan_half_angles,
)
from circparam.geometry.shading import corner_normals, frames
from circparam.mesh.cut_mesh import CutMesh
from tests.support import shapes
from tests.support.atlases import middles, uncut


def loose(triangles: object) -> CutMesh:
    """Triangles (m, 3, 2) that share no vertex, a chart each."""
    rest = np.asarray(triangles, float)
    m = len(rest)
    return CutMesh(np.arange(3 * m).reshape(m, 3), rest, np.arange(m), np.zeros((0, 2), int))


def test_angles_of_known_triangles() -> None:
    cut_mesh = loose([[[0, 0], [4, 0], [0, 3]], [[0, 0], [2, 0], [1, np.sqrt(3)]]])
    angles = corner_angles(cut_mesh)
    np.testing.assert_allclose(angles[0], [np.pi / 2, np.arctan2(3, 4), np.arctan2(4, 3)])
    np.testing.assert_allclose(angles[1], np.pi / 3)
    dot, cross = corner_products(cut_mesh)
    np.testing.assert_allclose(dot[0], [0, 16, 9], atol=1e-12)
    np.testing.assert_allclose(cross[0], 12)
    np.testing.assert_allclose(tan_half_angles(cut_mesh)[0], [1, 1 / 3, 1 / 2])
    np.testing.assert_allclose(cotangents(cut_mesh)[0], [0, 4 / 3, 3 / 4], atol=1e-15)


def test_half_angles_keep_their_digits_at_needles_and_caps() -> None:
    cut_mesh = loose([[[0, 0], [1, 0], [1, 1e-9]], [[0, 0], [1, 0], [-1, 1e-9]]])
    t = tan_half_angles(cut_mesh)[:, 0]
    assert t[0] == pytest.approx(5e-10, rel=1e-12)
    assert t[1] == pytest.approx(2e9, rel=1e-6)
    np.testing.assert_allclose(corner_angles(cut_mesh).sum(1), np.pi)


def test_signed_areas_follow_the_winding() -> None:
    uv = np.array([[1.0, 1.0], [4.0, 1.0], [1.0, 3.0]])
    assert signed_areas(np.array([[0, 1, 2], [2, 1, 0], [0, 0, 1]]), uv).tolist() == [3, -3, 0]


def test_uv_without_a_direction_still_have_a_frame():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    labels = np.array([[0, 1, 2]])
    space = frames(corners, np.zeros((1, 3, 2)), labels, corner_normals(corners, labels))
    assert np.allclose(np.linalg.norm(space.tangent, axis=2), 1)
    assert np.allclose((space.tangent * space.normal).sum(2), 0)


def bent(points: FloatArray, angle: float) -> FloatArray:
    """A flat sheet over 0..1 bent up by an angle along the line x = ½."""
    out = points.copy()
    beyond = np.maximum(points[:, 0] - 0.5, 0)
    out[:, 0] = np.minimum(points[:, 0], 0.5) + beyond * np.cos(angle)
    out[:, 2] = beyond * np.sin(angle)
    return out


def test_spread_unrolls_a_bent_sheet_from_what_is_known() -> None:
    points, faces = shapes.grid(9, 5)
    angle = 0.8
    atlas = uncut(bent(points, angle), faces)
    middle = middles(atlas.surface)
    known = middle[:, 0] < 0.2
    gradients = np.zeros((len(known), 2, 3))
    gradients[known] = [[1, 0, 0], [0, 1, 0]]
    found, have = spread(atlas, gradients, known)
    assert have.all()
    beyond = middle[:, 2] > 0
    assert beyond.any()
    across = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0]])
    wanted = np.where(beyond[:, None, None], across, np.eye(3)[:2])
    np.testing.assert_allclose(found, wanted, atol=1e-9)
