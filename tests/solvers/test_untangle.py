"""Unfolding: the energy's gradient, flips that were planted, and what must not move."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.solvers.objective import chart_energies
from circparam.solvers.region import cut_out, moving_region
from circparam.solvers.untangle import (
    POSITIVE_DETERMINANT,
    FoldoverEnergy,
    flipped,
    lower,
    untangle,
)
from tests.support import shapes
from tests.support.charts import flat_of, patches_of, rim, tangled


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("held", [False, True])
def test_planted_flips_are_turned_back_to_about_the_shape_of_before(seed, held):
    """A flat disk, whose energy is 1: Newton steps bring it near to itself; held vertices stay."""
    cut_mesh, uv = tangled(seed=seed)
    before = flipped(cut_mesh.faces, uv).sum()
    assert before
    new, report = untangle(cut_mesh, uv, rim(cut_mesh) if held else None)
    assert not flipped(cut_mesh.faces, new).any()
    assert (report.before[0], report.after[0]) == (before, 0)
    if held:
        np.testing.assert_array_equal(new[rim(cut_mesh)], uv[rim(cut_mesh)])
        assert chart_energies(cut_mesh, new)[0] < 1 + 4e-6


def test_what_is_far_from_a_flip_and_the_layout_that_is_given_stay_as_they_are():
    cut_mesh, uv = flat_of(shapes.grid(60, 60))
    middle = np.argmin(((uv - 0.5) ** 2).sum(1))
    uv[middle] += 0.05
    before = uv.copy()
    new, _ = untangle(cut_mesh, uv)
    np.testing.assert_array_equal(uv, before)
    assert not flipped(cut_mesh.faces, new).any()
    far = np.abs(uv - 0.5).max(1) > 0.25
    assert far.any()
    np.testing.assert_array_equal(new[far], uv[far])


@pytest.mark.parametrize("power", [-20, -10, 0, 10, 20])
def test_what_counts_as_flipped_does_not_depend_on_the_scale(power):
    """A sliver does only where its sign is not certain, a face that repeats a corner always."""
    for height, bad in ((1e-12, False), (2.0**-52, True), (0.0, True), (-1e-12, True)):
        uv = np.array([[0, 0], [1, 1], [0.5, 0.5 + height]]) * 2.0**power
        assert flipped(np.array([[0, 1, 2], [0, 0, 1]]), uv).tolist() == [bad, True]


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


def test_a_group_that_has_flown_apart_keeps_its_place_and_others_are_mended():
    """Two tangled disks; one is drawn out so far that it counts as flown apart from the start."""
    cut_mesh, uv = flat_of(shapes.row_of(shapes.delaunay_disk(120), 2))
    chart = cut_mesh.vertex_chart
    inner = np.flatnonzero(~rim(cut_mesh))
    chosen = np.concatenate([inner[chart[inner] == c][:4] for c in (0, 1)])
    uv[chosen] += np.random.default_rng(0).normal(0, 0.15, (8, 2))
    part = moving_region(cut_mesh, np.ones(len(cut_mesh.faces), bool), rim(cut_mesh), uv)
    x = uv[part.source].copy()
    ones = FoldoverEnergy(part, np.ones(part.cut_mesh.n_charts))
    far = chart[part.source] == 1
    x[far] *= 1e6
    apart = far[part.cut_mesh.faces].any(1)
    before = ones.determinants(x)
    assert before[apart].min() < 0
    assert before[~apart].min() < 0
    found = lower(part, x, None)
    assert (ones.determinants(found)[~apart] > POSITIVE_DETERMINANT).all()
    np.testing.assert_array_equal(found[far], x[far])


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
