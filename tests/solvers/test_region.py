"""Parts of a cut mesh that move while the rest stays."""

import numpy as np
import pytest

from circparam.solvers.region import THINNEST, cut_out, moving_region
from tests.support import shapes
from tests.support.charts import patches_of


def test_groups_that_share_fixed_vertices_only_move_apart_from_each_other():
    cut_mesh, points = patches_of(shapes.grid(21, 9))
    x = points[:, 0]
    hold = np.abs(x - 0.5) < 1e-9
    part, source, fixed = cut_out(cut_mesh, np.ones(len(cut_mesh.faces), bool), hold)
    assert part.n_charts == 2
    side = x[source][~fixed] > 0.5
    np.testing.assert_array_equal(
        part.vertex_chart[~fixed] == part.vertex_chart[~fixed][0], side == side[0]
    )
    assert (np.bincount(source)[hold] == 2).all(), "each group has its own copy of them"


def test_thin_rest_triangles_are_raised_to_the_least_height_and_others_stay():
    points = np.array([[0, 0, 0], [1, 0, 0], [0.3, 1e-5, 0], [0.5, -1, 0], [0.4, 0.6, 0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 4]])
    cut_mesh, _ = patches_of((points, faces))
    uv = np.random.default_rng(0).normal(size=(cut_mesh.n_vertices, 2))
    none = np.zeros(len(uv), bool)
    region = moving_region(cut_mesh, np.ones(3, bool), none, uv)
    rest = region.cut_mesh.rest_triangles
    longest = np.linalg.norm(rest - np.roll(rest, 1, 1), axis=2).max(1)
    height = 2 * region.cut_mesh.areas / longest / longest
    assert height.min() == pytest.approx(THINNEST)
    assert (region.cut_mesh.areas > 0).all()
    fine = height > 1.01 * THINNEST
    ratio = region.cut_mesh.areas[fine] / cut_mesh.areas[fine]
    np.testing.assert_allclose(ratio, ratio[0])
