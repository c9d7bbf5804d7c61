"""Layers over very many points: what a ray from each of them would tell."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.geometry import layers
from circparam.geometry.boundary import BoundarySegments, boundary_of
from circparam.geometry.intersect import windings
from circparam.mesh.cut_mesh import CutMesh
from tests.support import shapes
from tests.support.charts import patches_of


def boundary(cut_mesh: CutMesh, uv: np.ndarray) -> BoundarySegments:
    p = cut_mesh
    return boundary_of(p.faces, uv, p.chart, p.edges, p.n_charts)


@given(st.integers(0, 10_000), st.sampled_from([0.02, 0.3, 2.0]))
def test_cells_tell_what_rays_tell(seed: int, folded: float) -> None:
    """Of layouts that fold and coil any way, and of charts beside and upon each other."""
    rng = np.random.default_rng(seed)
    parts = [shapes.annulus(40, 8, 0.4), shapes.delaunay_disk(300, seed % 7), shapes.grid(9, 40)]
    cut_mesh, _ = patches_of(shapes.join(*parts))
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = cut_mesh.rest_triangles.reshape(-1, 2)
    bend = folded * rng.normal(size=(cut_mesh.n_charts, 2, 2))[cut_mesh.vertex_chart]
    uv += np.einsum("nij,nj->ni", bend, np.sin(3 * uv)) + rng.normal(0, 0.01 * folded, uv.shape)
    uv += 3 * rng.normal(size=(cut_mesh.n_charts, 2))[cut_mesh.vertex_chart]
    points = np.concatenate([uv, uv]) + rng.normal(0, 0.5, (2 * len(uv), 2))
    chart = np.tile(cut_mesh.vertex_chart, 2)
    rim = boundary(cut_mesh, uv)
    at, _, turns = windings(rim, points, chart, own=True)
    expected = np.zeros(len(points), np.int64)
    expected[at] = turns
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layers, "FEW", 0)
        found = layers.own_layers(rim, points, chart)
    assert np.array_equal(found, expected)
