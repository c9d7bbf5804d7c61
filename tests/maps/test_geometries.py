"""Sphere, plane and hyperbolic plane: frames of tangents."""

import numpy as np
import pytest

from circparam.maps.geometries import Geometry


@pytest.mark.parametrize("curvature", [1, 0, -1])
def test_tangents_are_an_orthonormal_frame_at_every_place(curvature: int) -> None:
    geometry = Geometry(curvature)
    places = np.random.default_rng(4).normal(size=(40, 2))
    height = np.sqrt(1 + (places**2).sum(1)) if curvature else np.ones(40)
    q = geometry.normal(np.column_stack([places, height]))
    frame = geometry.tangents(q)
    metric = geometry.metric if curvature else np.ones(3)
    gram = np.einsum("nki,k,nkj->nij", frame, metric, frame)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(2), gram.shape), atol=1e-9)
    if curvature:
        np.testing.assert_allclose(np.einsum("nk,k,nki->ni", q, metric, frame), 0.0, atol=1e-9)
