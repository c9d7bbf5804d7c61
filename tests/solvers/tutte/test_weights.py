"""Weight schemes: the plane, signs, and the formulas written out for one vertex."""

import numpy as np
import pytest
from hypothesis import given, settings

from circparam.core.linalg import HeldFactor
from circparam.geometry.intrinsic import signed_areas
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.tutte.embed import assemble, tutte_embedding
from circparam.solvers.tutte.weights import WEIGHTS, flat_rings, half_edge_weights
from tests.support import shapes, strategies
from tests.support.charts import patches_of, rim

REPRODUCING = [r.name for r in WEIGHTS if "reproduces-plane" in r.tags]
POSITIVE = [r.name for r in WEIGHTS if "positive" in r.tags]


def plane_error(shape, scheme) -> float:
    """How far the inner vertices of a flat shape move when its boundary keeps its place."""
    cut_mesh, points = patches_of(shape)
    free = ~rim(cut_mesh)
    system = HeldFactor(assemble(cut_mesh, weights_of(cut_mesh, scheme), free), ~free)
    uv = system.solve(np.zeros((len(free), 2)), points[~free][:, :2])
    return float(np.abs(uv - points[:, :2]).max())


def weights_of(cut_mesh, scheme):
    return half_edge_weights(cut_mesh, WEIGHTS[scheme].function)


@pytest.mark.parametrize("scheme", REPRODUCING)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_plane_comes_back(scheme, seed):
    assert plane_error(shapes.delaunay_square(400, seed), scheme) < 1e-9


def test_circle_reproduces_the_plane_on_equidistant_rings():
    assert plane_error(shapes.rings(5), "circle") < 1e-12


@pytest.mark.parametrize("scheme", POSITIVE)
@given(shape=strategies.disks() | strategies.holed_disks())
@settings(max_examples=25)
def test_positive_weights_are_positive_and_flip_nothing(scheme, shape):
    """Holes are closed for the solve only: their boundaries move freely."""
    cut_mesh, _ = patches_of(shape)
    inner = ~rim(cut_mesh)[cut_mesh.faces.ravel()]
    assert (weights_of(cut_mesh, scheme)[inner] > -1e-12).all()
    uv, negative = tutte_embedding(cut_mesh, scheme)
    assert len(uv) == cut_mesh.n_vertices
    assert negative.sum() == 0
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()


def fan(directions, lengths) -> CutMesh:
    """A vertex at the origin with neighbours at these angles and distances."""
    points = np.c_[lengths * np.cos(directions), lengths * np.sin(directions), 0 * lengths]
    k = len(directions)
    faces = np.stack([np.zeros(k, int), 1 + np.arange(k), 1 + (np.arange(k) + 1) % k], 1)
    return patches_of((np.vstack([[0, 0, 0], points]), faces))[0]


def outgoing(cut_mesh, scheme):
    """(neighbour, weight) of the fan's centre, in order of the neighbours."""
    w = weights_of(cut_mesh, scheme)
    h = np.flatnonzero(cut_mesh.faces.ravel() == cut_mesh.faces[0, 0])
    to = cut_mesh.faces[:, [1, 2, 0]].ravel()[h]
    return w[h][np.argsort(to)]


def test_the_formulas_written_out_for_one_vertex():
    directions = np.array([0.1, 1.0, 2.4, 3.3, 5.0])
    r = np.array([1.0, 2.0, 0.7, 1.5, 1.1])
    cut_mesh = fan(directions, r)
    after = np.diff(np.append(directions, directions[0] + 2 * np.pi))
    tangent = np.tan(after / 2) + np.tan(np.roll(after, 1) / 2)
    np.testing.assert_allclose(outgoing(cut_mesh, "circle"), tangent, rtol=1e-12)
    np.testing.assert_allclose(outgoing(cut_mesh, "mean-value"), tangent / r, rtol=1e-12)
    np.testing.assert_allclose(outgoing(cut_mesh, "uniform"), 1.0)


def floater_by_hand(directions, r):
    """Floater 1997, section 6, with a loop over the neighbours."""
    p = np.stack([r * np.cos(directions), r * np.sin(directions)], 1)
    k = len(p)
    out = np.zeros(k)
    for i in range(k):
        for s in range(k):
            t = (s + 1) % k
            if i in (s, t):
                continue
            a = np.array([[*p[i], 1], [*p[s], 1], [*p[t], 1]]).T
            mu = np.linalg.solve(a, [0, 0, 1])
            if (mu >= -1e-12).all():
                out[[i, s, t]] += mu / k
                break
    return out


def test_floater_agrees_with_the_loop_over_the_neighbours():
    generator = np.random.default_rng(3)
    for k in (4, 5, 7, 9):
        gaps = generator.uniform(0.5, 1.5, k)
        directions = np.cumsum(gaps * 2 * np.pi / gaps.sum())
        r = generator.uniform(0.5, 2.0, k)
        got = outgoing(fan(directions, r), "floater")
        np.testing.assert_allclose(got, floater_by_hand(directions, r), atol=1e-9)


def test_a_corner_wider_than_half_the_plane_keeps_floater_positive():
    # three faces round a sharp spike: one corner would take more than π once the ring is laid flat
    points = np.array([[0, 0, 0], [1, 0, 0.2], [-1, 0, 0.2], [0, 0.05, 0.3]], float)
    cut_mesh, _ = patches_of((points, np.array([[0, 1, 3], [0, 3, 2], [0, 2, 1]])))
    w = outgoing(cut_mesh, "floater")
    assert np.isfinite(w).all()
    assert (w >= 0).all()
    assert w.sum() == pytest.approx(1)
    _, _, angle = flat_rings(cut_mesh)
    assert np.diff(np.append(angle, 2 * np.pi)).max() < np.pi
