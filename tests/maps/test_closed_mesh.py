"""Closed meshes whose edges are split, and the vertices of a file on them."""

import numpy as np

from circparam.maps.map_input import map_input_of
from circparam.mesh.mesh import Mesh
from tests.support import pairs


def test_split_edges_lie_where_they_are_asked_for() -> None:
    """All edges at once, from either end: a closed mesh of the same faces, cut at the shares."""
    mesh = map_input_of(pairs.blob(1, 1), "A").closed
    rng = np.random.default_rng(0)
    lower = np.flatnonzero(np.arange(len(mesh.twin)) < mesh.twin)
    h = np.where(rng.random(len(lower)) < 0.5, lower, mesh.twin[lower])
    share = rng.uniform(0.1, 0.9, len(h))
    split, middle = mesh.split(h, share)
    a, b = (mesh.points[v.ravel()[h]] for v in (mesh.faces, mesh.faces[:, [1, 2, 0]]))
    np.testing.assert_allclose(split.points[middle], a + share[:, None] * (b - a), atol=1e-12)
    assert split.simple
    assert len(split.faces) == 4 * len(mesh.faces)
    there = np.einsum("fkc,fcd->fkd", split.corners, mesh.points[mesh.faces[split.parent]])
    np.testing.assert_allclose(there, split.points[split.faces], atol=1e-12)
    part = np.bincount(split.origin, split.cut_mesh.areas)
    np.testing.assert_allclose(part, mesh.cut_mesh.areas, atol=1e-12)


def test_vertices_of_faces_without_area_lie_where_their_copies_lie() -> None:
    """A file that repeats a point for a face that is set aside: the point has the place of the vertex there."""
    ball = pairs.blob(1, 1)
    n = len(ball.points)
    points = np.concatenate([ball.points, ball.points[[5, 5]]])
    side = map_input_of(Mesh(points, np.concatenate([ball.faces, [[5, n, n + 1]]])), "A")
    assert (side.vertex[:n] >= 0).all()
    assert (side.vertex[n:] == side.vertex[5]).all()
