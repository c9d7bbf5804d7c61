"""Layers over very many points."""

import numpy as np

from circparam.geometry.boundary import boundary_of
from circparam.geometry.layers import BLOCK_POINTS, own_layers
from circparam.mesh.halfedge import shared_edges


def test_points_have_the_layers_that_their_own_chart_lays_on_them() -> None:
    """A square and one twice as wide in one place: each point counts its own alone."""
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    uv = np.concatenate([square, 2 * square])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    faces = np.concatenate([faces, faces + 4])
    boundary = boundary_of(faces, uv, np.array([0, 0, 1, 1]), shared_edges(faces), 2)
    rng = np.random.default_rng(1)
    points, chart = (
        rng.uniform(-1, 3, (BLOCK_POINTS + 500, 2)),
        rng.integers(0, 2, BLOCK_POINTS + 500),
    )
    inside = ((points > 0) & (points < 1 + chart[:, None])).all(1)
    np.testing.assert_array_equal(own_layers(boundary, points, chart), inside)
