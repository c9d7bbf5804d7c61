"""First hits of many rays, beside a tracer that tries every face."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.arrays import unit
from circparam.geometry.rays import BoxTree, first_hits
from circparam.mesh.mesh import Mesh
from tests.support.bumps import belt, traced


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 300), st.integers(0, 1000), st.sampled_from([0.05, 1.0]))
def test_a_soup_of_faces_as_every_face_tried(faces: int, seed: int, size: float):
    """Faces that pierce each other at random, rays from anywhere: hit or not, where, and on which face."""
    rng = np.random.default_rng(seed)
    points = (rng.random((faces, 1, 3)) + size * rng.normal(size=(faces, 3, 3))).reshape(-1, 3)
    mesh = Mesh(points, np.arange(3 * faces).reshape(-1, 3))
    origin, direction = rng.random((200, 3)), unit(rng.normal(size=(200, 3)))
    reach = 0.7
    hits = first_hits(BoxTree(mesh.points[mesh.faces]), origin, direction, np.full(200, reach))
    face, t = traced(mesh, origin, direction, reach)
    assert (hits.face == face).all()
    on = face >= 0
    assert np.abs(hits.t - t)[on].max(initial=0) < 1e-9
    place = np.einsum("pk,pkc->pc", hits.bary, mesh.points[mesh.faces[hits.face]])
    assert np.abs(place - (origin + hits.t[:, None] * direction))[on].max(initial=0) < 1e-9


def test_rays_side_by_side_and_the_nearest_of_two_layers():
    """Two nested balls: the outer is met first, the nearer one where that is asked for; never a back."""
    outer, inner = belt(12, 24)[0], belt(20, 30)[0]
    points = np.concatenate([outer.points, 0.9 * inner.points])
    tree = BoxTree(points[np.concatenate([outer.faces, inner.faces + len(outer.points)])])
    face = np.repeat(np.arange(len(outer.faces)), 50)
    bary = np.random.default_rng(0).dirichlet([1, 1, 1], len(face))
    seen = np.einsum("pk,pkc->pc", bary, outer.points[outer.faces[face]])
    direction, origin = unit(seen), 0.88 * unit(seen)
    reach = np.full(len(face), 0.2)
    first = first_hits(tree, origin, direction, reach)
    assert (first.face == face).all()
    near = first_hits(tree, origin, direction, reach, nearest=True)
    on = near.face >= len(outer.faces)
    assert on.mean() > 0.97  # all but those above the inner ball's own edge
    assert (near.t[on] < first.t[on]).all()
    assert (first_hits(tree, origin, -direction, reach).face == -1).all()


def test_no_ray_slips_through_an_edge_or_a_corner():
    mesh, _ = belt(8, 16)
    tree = BoxTree(mesh.points[mesh.faces])
    inner = mesh.points.reshape(9, 17, 3)[1:-1, 1:-1].reshape(-1, 3)
    middle = (inner + mesh.points.reshape(9, 17, 3)[1:-1, 2:].reshape(-1, 3)) / 2
    for place in (inner, middle):
        hits = first_hits(tree, place, unit(place), np.full(len(place), 0.1))
        assert (hits.face >= 0).all()
        assert np.abs(hits.t).max() < 1e-9


@pytest.mark.parametrize("reach", [0.0999, 0.1001])
def test_the_reach_ends_where_it_says(reach: float):
    tree = BoxTree(np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]]))
    origin, up = np.array([[0.2, 0.2, -0.1], [0.2, 0.2, 0.1]]), np.array([[0.0, 0, 1], [0, 0, 1]])
    hits = first_hits(tree, origin, up, np.full(2, reach))
    assert (hits.face == (0 if reach > 0.1 else -1)).all()
    if reach > 0.1:
        assert hits.t.tolist() == [0.1, -0.1]
