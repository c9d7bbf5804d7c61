"""Closed meshes whose edges are split, and the vertices of a file on them."""

import numpy as np

from circparam.maps.map_input import map_input_of
from circparam.mesh.mesh import Mesh
from tests.support import pairs


def test_vertices_of_faces_without_area_lie_where_their_copies_lie() -> None:
    """A file that repeats a point for a face that is set aside: the point has the place of the vertex there."""
    ball = pairs.blob(1, 1)
    n = len(ball.points)
    points = np.concatenate([ball.points, ball.points[[5, 5]]])
    side = map_input_of(Mesh(points, np.concatenate([ball.faces, [[5, n, n + 1]]])), "A")
    assert (side.vertex[:n] >= 0).all()
    assert (side.vertex[n:] == side.vertex[5]).all()
