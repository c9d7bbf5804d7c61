"""The outer boundary of every chart, in order."""

import numpy as np
import pytest

from circparam.core.arrays import next_half_edge
from circparam.solvers.tutte.boundary import BOUNDARIES, WIDTH
from circparam.solvers.tutte.outer import SHORTEST, TutteOptions, outer_boundary
from tests.support import shapes
from tests.support.charts import patches_of


def two_charts():
    holed, disk = shapes.annulus(16, 3), shapes.bumped_disk(80)
    return patches_of(shapes.join(holed, (disk[0] + 5, disk[1])))[0]


def test_places_are_shares_of_the_length_from_zero_on():
    outer = outer_boundary(cut_mesh := two_charts())
    length = cut_mesh.edge_lengths.ravel()[outer.half_edge]
    total = np.bincount(outer.index, length)
    np.testing.assert_array_equal(outer.place[outer.start], 0)
    step = np.mod(outer.place[outer.neighbour(1)] - outer.place, 1)
    np.testing.assert_allclose(step, length / total[outer.index], atol=1e-12)


def test_a_very_short_edge_keeps_a_share_of_the_mean():
    n = 12
    t = 2 * np.pi * np.arange(n) / n
    t[1] = 1e-9
    ring = np.c_[np.cos(t), np.sin(t), 0 * t]
    faces = np.array([[n, k, (k + 1) % n] for k in range(n)])
    cut_mesh, _ = patches_of((np.vstack([ring, [[0, 0, 0]]]), faces))
    outer = outer_boundary(cut_mesh)
    length = cut_mesh.edge_lengths.ravel()[outer.half_edge]
    short = int(np.argmin(length))
    assert length[short] < 1e-8
    step = np.mod(outer.place[outer.neighbour(1)] - outer.place, 1)
    assert step[short] == pytest.approx(SHORTEST / n, rel=2e-3)


def test_virtual_faces_join_along_edges_of_one_length_and_have_the_width_asked_for():
    cut_mesh = patches_of(shapes.bumped_disk(80))[0]
    fixed = BOUNDARIES["virtual"].function(cut_mesh, TutteOptions())
    wide = fixed.cut_mesh
    a, b = wide.edges.T
    flat, length = wide.faces.ravel(), wide.edge_lengths.ravel()
    np.testing.assert_array_equal(flat[a], flat[next_half_edge(b)])
    np.testing.assert_array_equal(flat[b], flat[next_half_edge(a)])
    new = (b // 3 >= len(cut_mesh.faces)) & (a // 3 < len(cut_mesh.faces))
    np.testing.assert_allclose(length[a[new]], length[b[new]])
    radius = np.hypot(*fixed.uv.T)
    inside = np.sqrt(cut_mesh.chart_areas[0] / np.pi)
    np.testing.assert_allclose(radius, (1 + WIDTH) * inside)
