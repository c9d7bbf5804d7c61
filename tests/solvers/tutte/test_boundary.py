"""Boundaries: where the fixed vertices lie, and that nothing collapses on them."""

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.geometry.intrinsic import signed_areas
from circparam.solvers.tutte.boundary import BOUNDARIES
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.tutte.outer import TutteOptions, outer_boundary
from tests.support import shapes
from tests.support.charts import patches_of


def lay(name, shape, **options):
    cut_mesh, _ = patches_of(shape)
    return cut_mesh, BOUNDARIES[name].function(cut_mesh, TutteOptions(**options))


@pytest.mark.parametrize("spacing", ["arc-length", "uniform"])
def test_a_circle_has_the_area_of_the_chart_and_the_spacing_asked_for(spacing):
    cut_mesh, boundary = lay("circle", shapes.bumped_disk(500), spacing=spacing)
    radius = np.hypot(*boundary.uv.T)
    np.testing.assert_allclose(np.pi * radius**2, cut_mesh.chart_areas[0])
    steps = np.mod(np.diff(np.arctan2(boundary.uv[:, 1], boundary.uv[:, 0])), 2 * np.pi)
    ring = outer_boundary(cut_mesh, spacing)
    length = cut_mesh.edge_lengths.ravel()[ring.half_edge]
    wanted = np.ones_like(length) if spacing == "uniform" else length
    np.testing.assert_allclose(steps, (2 * np.pi * wanted / wanted.sum())[:-1], rtol=1e-9)


def test_very_short_boundary_edges_stay_apart():
    points, faces = shapes.delaunay_disk(100)
    cut_mesh, _ = patches_of((points, faces))
    v = cut_mesh.faces.ravel()[cut_mesh.boundary[:1]]
    near = np.flatnonzero((np.abs(points - points[v]) < 1e-12).all(1))
    assert len(near) == 1
    end = cut_mesh.faces[:, [1, 2, 0]].ravel()[cut_mesh.boundary[0]]
    other = points[end]
    points = points.copy()
    points[near[0]] = other + 1e-11 * (points[near[0]] - other)
    cut_mesh, _ = patches_of((points, faces))
    uv, _ = tutte_embedding(cut_mesh)
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()


def test_the_virtual_ring_is_a_wider_disk_and_frees_the_boundary():
    cut_mesh, boundary = lay("virtual", shapes.bumped_disk(400))
    np.testing.assert_array_equal(boundary.cut_mesh.euler(), [1])
    assert (boundary.cut_mesh.areas > 0).all()
    assert len(boundary.cut_mesh.boundary) == len(cut_mesh.boundary)
    assert boundary.vertices.min() >= cut_mesh.n_vertices
    uv, _ = tutte_embedding(cut_mesh, "mean-value", TutteOptions("virtual"))
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()
    real = cut_mesh.faces.ravel()[cut_mesh.boundary]
    assert np.ptp(np.hypot(*uv[real].T)) > 1e-3 * np.hypot(*uv[real].T).mean()


def test_an_unknown_spacing_is_refused():
    with pytest.raises(OptionError, match="spacing"):
        lay("circle", shapes.grid(), spacing="even")
