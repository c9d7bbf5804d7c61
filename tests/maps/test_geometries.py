"""The geometry of a triangulation of a surface with handles: flat or hyperbolic, smooth at every node."""

import numpy as np
import pytest

from circparam.maps.geometries import Base, Geometry, base_of, determinants
from tests.support import shapes


def arcs_of(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(regions, ends) of a mesh whose faces are the triangles of arcs."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    edges, number = np.unique(np.stack([low, high], 1), axis=0, return_inverse=True)
    regions = (2 * number + (start > end)).reshape(-1, 3)
    ends = np.empty((2 * len(edges), 2), int)
    ends[::2], ends[1::2] = edges, edges[:, ::-1]
    return regions, ends


CASES = {
    "torus": shapes.torus(5, 4)[1],
    "genus 2": shapes.handles(2, 1)[1],
    "genus 3": shapes.handles(3, 1)[1],
    # one node, three loops, two triangles: the flat torus of equilateral triangles
    "one node": np.array([[0, 1, 2], [2, 1, 0]]),
}


def case(name: str) -> tuple[Base, np.ndarray, np.ndarray]:
    if name == "one node":
        regions, ends = np.array([[0, 2, 4], [1, 3, 5]]), np.zeros((6, 2), int)
    else:
        regions, ends = arcs_of(CASES[name])
    return base_of(regions, ends), regions, ends


@pytest.mark.parametrize("name", CASES)
def test_round_every_node_the_frames_close(name: str) -> None:
    base, regions, ends = case(name)
    place = {int(arc): (f, k) for f, r in enumerate(regions) for k, arc in enumerate(r)}
    for first in range(len(ends)):
        arc, way = first, np.eye(3)
        while True:
            f, k = place[arc]
            back = int(regions[f][k - 1])
            way = base.across[back] @ way
            arc = back ^ 1
            if arc == first:
                break
        np.testing.assert_allclose(way, np.eye(3), atol=1e-8)


@pytest.mark.parametrize("name", CASES)
def test_triangles_meet_along_their_arcs(name: str) -> None:
    base, regions, ends = case(name)
    assert (base.geometry.curvature < 0) == name.startswith("genus")
    place = {int(arc): (f, k) for f, r in enumerate(regions) for k, arc in enumerate(r)}
    for arc in range(len(ends)):
        (f, k), (g, i) = place[arc], place[arc ^ 1]
        np.testing.assert_allclose(
            base.across[arc] @ base.corners[f, k], base.corners[g, (i + 1) % 3], atol=1e-9
        )
        np.testing.assert_allclose(
            base.across[arc] @ base.corners[f, (k + 1) % 3], base.corners[g, i], atol=1e-9
        )
    a, b, c = base.corners.transpose(1, 0, 2)
    assert (determinants(a, b, c) > 0).all()


@pytest.mark.parametrize("curvature", [-1, 0, 1])
def test_tangents_are_orthonormal_and_touch_the_surface(curvature: int) -> None:
    geometry = Geometry(curvature)
    places = np.random.default_rng(0).normal(size=(50, 3))
    places[:, 2] = np.abs(places[:, 2]) + np.hypot(places[:, 0], places[:, 1]) + 0.1
    places = geometry.normal(places)
    metric = np.diag(geometry.metric)
    tangents = geometry.tangents(places)
    products = np.einsum("nia,ij,njb->nab", tangents, metric, tangents)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(2), (50, 2, 2)), atol=1e-12)
    if curvature:
        np.testing.assert_allclose(
            np.einsum("ni,ij,nja->na", places, metric, tangents), 0, atol=1e-12
        )
    assert (determinants(places, tangents[..., 0], tangents[..., 1]) > 0).all()
