"""Charts with holes, cut open along the shortest tree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import corner_classes
from circparam.solvers.holes import hole_vertices, open_holes
from tests.support import shapes
from tests.support.charts import patches_of


@given(holes=st.integers(0, 6), seed=st.integers(0, 2**20))
@settings(max_examples=20, deadline=None)
def test_opened_charts_are_disks_cut_along_a_tree(holes, seed):
    one = shapes.planar_holes(holes, seed, n=300)
    cut_mesh, _ = patches_of(shapes.join(one, (one[0] + 5, one[1]), (one[0] - 5, one[1])))
    loops = len(cut_mesh.loops.chart)
    opened = open_holes(cut_mesh)
    np.testing.assert_array_equal(opened.cut_mesh.euler(), 1)
    np.testing.assert_array_equal(opened.cut_mesh.loops.chart, np.arange(cut_mesh.n_charts))
    np.testing.assert_array_equal(opened.origin[opened.cut_mesh.faces], cut_mesh.faces)
    assert opened.cut.any() == (loops > cut_mesh.n_charts)
    # no cut edge is there for nothing: gluing any of them leaves a second boundary or joins its two sides
    for k in np.flatnonzero(opened.cut)[:5]:
        edges = np.concatenate([opened.cut_mesh.edges, cut_mesh.edges[k : k + 1]])
        _, corners = corner_classes(len(cut_mesh.faces), edges)
        glued = CutMesh(corners, cut_mesh.rest_triangles, cut_mesh.chart, edges)
        assert glued.euler().sum() < cut_mesh.n_charts or len(glued.loops.chart) > cut_mesh.n_charts


def test_the_cut_of_a_ring_is_as_long_as_the_ring_is_wide():
    cut_mesh, _ = patches_of(shapes.annulus(32, 6, 0.4))
    cut = cut_mesh.edges[open_holes(cut_mesh).cut, 0]
    assert len(cut) == 6
    assert cut_mesh.edge_lengths.ravel()[cut].sum() == pytest.approx(0.6)


def test_cuts_form_the_shortest_tree_over_the_holes():
    # a long strip with two square holes: the way from hole to hole is shorter than any other second way out
    p, f = shapes.grid(31, 11, 3.0, 1.0)
    c = p[f].mean(1)
    holed = (np.abs(c[:, 1] - 0.6) < 0.1) & (
        (np.abs(c[:, 0] - 1.2) < 0.2) | (np.abs(c[:, 0] - 1.7) < 0.2)
    )
    cut_mesh, _ = patches_of(shapes.compact(p, f[~holed]))
    assert hole_vertices(cut_mesh)[2].tolist() == [12, 12]
    cut = cut_mesh.edges[open_holes(cut_mesh).cut, 0]
    # 0.1 between the holes, 0.3 from one of them to the boundary
    assert cut_mesh.edge_lengths.ravel()[cut].sum() == pytest.approx(0.4)
