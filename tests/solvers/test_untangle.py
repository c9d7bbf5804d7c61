"""Unfolding: the energy's gradient, flips that were planted, and what must not move."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.solvers.objective import chart_energies
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.untangle import flipped, untangle
from tests.support import shapes
from tests.support.charts import patches_of, rim, tangled


@pytest.mark.parametrize("seed", range(4))
def test_planted_flips_are_turned_back(seed):
    cut_mesh, uv = tangled(seed=seed)
    assert flipped(cut_mesh.faces, uv).any()
    new, report = untangle(cut_mesh, uv)
    assert not flipped(cut_mesh.faces, new).any()
    assert report.before[0] == flipped(cut_mesh.faces, uv).sum()
    assert report.after[0] == 0


def test_what_is_far_from_a_flip_stays_where_it_is():
    cut_mesh, points = patches_of(shapes.grid(60, 60))
    uv = points[:, :2].copy()
    middle = np.argmin(((uv - 0.5) ** 2).sum(1))
    uv[middle] += 0.05
    new, _ = untangle(cut_mesh, uv)
    assert not flipped(cut_mesh.faces, new).any()
    far = np.abs(uv - 0.5).max(1) > 0.25
    assert far.any()
    np.testing.assert_array_equal(new[far], uv[far])


def test_held_vertices_stay():
    cut_mesh, uv = tangled()
    new, _ = untangle(cut_mesh, uv, rim(cut_mesh))
    np.testing.assert_array_equal(new[rim(cut_mesh)], uv[rim(cut_mesh)])
    assert not flipped(cut_mesh.faces, new).any()


def test_a_chart_without_flips_is_returned_as_it_is():
    cut_mesh, points = patches_of(shapes.row_of(shapes.delaunay_disk(100), 2))
    uv = points[:, :2].copy()
    inner = np.flatnonzero(~rim(cut_mesh) & (cut_mesh.vertex_chart == 1))
    uv[inner[0]] += 5
    before = uv.copy()
    new, report = untangle(cut_mesh, uv)
    np.testing.assert_array_equal(uv, before)
    own = cut_mesh.vertex_chart == 0
    np.testing.assert_array_equal(new[own], uv[own])
    assert report.after.tolist() == [0, 0]
    assert report.before[0] == 0


def test_a_sliver_counts_as_flipped_only_where_its_sign_is_not_certain():
    uv = np.array([[0, 0], [1, 0], [0.5, 1e-12], [0.5, -1e-12], [0.5, 0.0]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 0, 1]])
    assert flipped(faces, uv).tolist() == [False, True, True, True]
    plain, _ = tutte_embedding(patches_of(shapes.grid())[0])
    assert np.isfinite(plain).all()


@pytest.mark.parametrize("power", [-20, -10, 0, 10, 20])
def test_what_counts_as_flipped_does_not_depend_on_the_scale(power):
    faces = np.array([[0, 1, 2]])
    for height, bad in ((1e-12, False), (2.0**-52, True), (0.0, True), (-1e-12, True)):
        uv = np.array([[0, 0], [1, 1], [0.5, 0.5 + height]]) * 2.0**power
        assert flipped(faces, uv).tolist() == [bad]


def test_what_was_moved_gets_its_shape_back():
    """A flat disk, untangled: Newton steps bring it near to itself, whose energy is 1, where that is asked."""
    for seed in range(3):
        cut_mesh, uv = tangled(seed=seed)
        new, _ = untangle(cut_mesh, uv, rim(cut_mesh))
        assert chart_energies(cut_mesh, new)[0] < 1 + 4e-6


def test_no_region_is_needed_where_nothing_is_flipped_and_none_is_tried_out_of_time():
    cut_mesh, points = patches_of(shapes.delaunay_disk(80))
    new, report = untangle(cut_mesh, points[:, :2])
    assert report.rings == 0
    np.testing.assert_array_equal(new, points[:, :2])
    cut_mesh, uv = tangled(150)
    new, report = untangle(cut_mesh, uv, monitor=Monitor(timeout=-1.0))
    np.testing.assert_array_equal(new, uv)
    assert report.rings == 0
    assert report.after.tolist() == report.before.tolist() != [0]
    assert untangle(cut_mesh, uv)[1].rings > 0
