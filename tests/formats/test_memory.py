"""Meshes that come from memory: copied, checked, with the uv that came with them."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.memory import from_arrays, from_trimesh
from tests.support.formats_tools import (
    grid,
)


def test_arrays_are_copied_and_checked() -> None:
    points, faces = grid(3)
    points = points.astype(float)
    uv = points[:, :2].copy()
    doc = from_arrays(points, faces, uv)
    points[0] = 99
    uv[0] = 99
    assert doc.mesh.points[0].tolist() == [0, 0, 0]
    given = doc.uv()
    assert given is not None
    assert given.uv[0].tolist() == [0, 0]
    for bad in (uv[:, :1], uv[:3]):
        with pytest.raises(InputError):
            from_arrays(points, faces, bad)
    with pytest.raises(InputError):
        from_arrays(points, faces + 100)


def test_trimesh_objects() -> None:
    import trimesh

    points, faces = grid(3)
    uv = np.random.default_rng(0).random((9, 2))
    mesh = trimesh.Trimesh(
        points, faces, process=False, visual=trimesh.visual.TextureVisuals(uv=uv)
    )
    doc = from_trimesh(mesh)
    np.testing.assert_array_equal(doc.mesh.points, points)
    np.testing.assert_array_equal(doc.mesh.faces, faces)
    given = doc.uv()
    assert given is not None
    np.testing.assert_array_equal(given.uv, uv)
    with pytest.raises(InputError, match="no faces"):
        from_trimesh(trimesh.PointCloud(points))
    scene = trimesh.Scene([mesh])
    scene.apply_translation([1, 0, 0])
    np.testing.assert_allclose(from_trimesh(scene).mesh.points, points + np.array([1, 0, 0]))
