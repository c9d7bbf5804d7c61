"""The surface cut open: lengths, loops, Euler characteristics, parts and closed holes."""

import numpy as np
import pytest

from circparam.geometry.intrinsic import corner_angles, vertex_angle_sums
from circparam.mesh.cut_mesh import close_holes, rest_triangles_of
from tests.support import shapes
from tests.support.atlases import surface_of
from tests.support.charts import patches_of


def test_rest_triangles_keep_all_lengths() -> None:
    p = np.random.default_rng(0).normal(size=(30, 3, 3))
    flat = rest_triangles_of(p)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        np.testing.assert_allclose(
            np.linalg.norm(flat[:, a] - flat[:, b], axis=1),
            np.linalg.norm(p[:, a] - p[:, b], axis=1),
        )
    assert not flat[:, 0].any()
    assert (flat[:, 1, 0] > 0).all()
    assert not flat[:, 1, 1].any()
    assert (flat[:, 2, 1] > 0).all()


def test_loops_run_along_the_boundary_and_the_longest_is_the_outer_one() -> None:
    cut_mesh, points = patches_of(shapes.row_of(shapes.annulus(12, 3, 0.5), 2))
    loops = cut_mesh.loops
    assert loops.chart.tolist() == [0, 0, 1, 1]
    assert np.diff(loops.start).tolist() == [12] * 4
    side = 2 * np.sin(np.pi / 12)
    radius = points[:, :2].copy()
    flat, ahead = cut_mesh.faces.ravel(), cut_mesh.faces[:, [1, 2, 0]].ravel()
    for k in range(4):
        h = loops.half_edges[loops.start[k] : loops.start[k + 1]]
        np.testing.assert_array_equal(ahead[h], flat[np.roll(h, -1)])
        assert h[0] == h.min()
        assert (loops.loop_of[loops.start[k] : loops.start[k + 1]] == k).all()
        span = np.ptp(radius[flat[h]], axis=0).max() / 2
        assert loops.length[k] == pytest.approx(12 * side * span)
        assert loops.outer[k] == (span > 0.75)


def test_some_charts_alone_are_what_they_were() -> None:
    cut_mesh, _ = patches_of(shapes.row_of(shapes.annulus(8, 2), 3))
    part, vertices, faces = cut_mesh.subset(np.array([True, False, True]))
    assert part.n_charts == 2
    assert set(cut_mesh.chart[faces].tolist()) == {0, 2}
    np.testing.assert_array_equal(vertices[part.faces], cut_mesh.faces[faces])
    np.testing.assert_array_equal(part.rest_triangles, cut_mesh.rest_triangles[faces])
    np.testing.assert_array_equal(part.euler(), [0, 0])
    assert part.n_vertices == len(vertices) == 2 * cut_mesh.n_vertices // 3
    inside = cut_mesh.chart[cut_mesh.edges[:, 0] // 3] != 1
    before = cut_mesh.edges[inside]
    np.testing.assert_array_equal(3 * faces[part.edges // 3] + part.edges % 3, before)


def test_holes_are_closed_by_flat_fans() -> None:
    cut_mesh, _ = patches_of(shapes.annulus(24, 3, 0.5))
    closed, middle = close_holes(cut_mesh)
    assert closed.euler().tolist() == [1]
    assert len(closed.loops.chart) == 1
    assert middle.tolist() == [cut_mesh.n_vertices]
    np.testing.assert_array_equal(closed.faces[: len(cut_mesh.faces)], cut_mesh.faces)
    assert len(closed.faces) - len(cut_mesh.faces) == 24
    assert (closed.areas > 0).all()
    sums = vertex_angle_sums(closed, corner_angles(closed))
    assert sums[middle[0]] == pytest.approx(2 * np.pi, rel=0.02)
    # both half-edges of an edge have one length
    lengths = closed.edge_lengths.ravel()
    np.testing.assert_allclose(lengths[closed.edges[:, 0]], lengths[closed.edges[:, 1]])
    same, none = close_holes(patches_of(shapes.grid())[0])
    assert len(none) == 0
    assert same.euler().tolist() == [1]


def test_a_surface_opened_again_has_its_shapes_and_nothing_that_a_solve_left() -> None:
    surface = surface_of(*shapes.icosphere(2))
    cut = np.zeros(len(surface.edges), bool)
    first = surface.cut_mesh(cut)
    areas = first.areas
    first.eliminated_in(np.arange(first.n_vertices))
    again = surface.cut_mesh(cut.copy())
    assert again.areas is areas
    assert again.elimination is None
    cut[0] = True
    assert surface.cut_mesh(cut).n_vertices == first.n_vertices
    assert len(surface.cut_mesh(cut).edges) == len(first.edges) - 1
