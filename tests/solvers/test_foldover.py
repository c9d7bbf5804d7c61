"""The foldover-free energy and its descent."""

import numpy as np
import pytest

from circparam.solvers.foldover import POSITIVE, FoldoverEnergy, lower
from circparam.solvers.region import moving_region
from tests.support import shapes
from tests.support.charts import patches_of, rim, tangled


@pytest.mark.parametrize("epsilon", [1.0, 1e-3])
def test_the_gradient_is_that_of_the_energy(epsilon):
    cut_mesh, uv = tangled(60)
    part = moving_region(cut_mesh, np.ones(len(cut_mesh.faces), bool), np.zeros(len(uv), bool), uv)
    problem = FoldoverEnergy(part, np.full(part.n_groups, epsilon))
    x = uv[part.source]
    _, gradient = problem.energy(x)
    direction = np.random.default_rng(1).normal(size=x.shape)
    h = 1e-7 * epsilon
    up, down = problem.energy(x + h * direction)[0], problem.energy(x - h * direction)[0]
    assert (gradient * direction).sum() == pytest.approx(((up - down) / (2 * h)).sum(), rel=1e-4)


def whole(shape):
    """(region of everything with nothing held but its first vertex, flat layout of its vertices)."""
    cut_mesh, points = patches_of(shape)
    uv = points[:, :2]
    part = moving_region(cut_mesh, np.ones(len(cut_mesh.faces), bool), np.zeros(len(uv), bool), uv)
    return part, uv[part.source]


def test_energies_of_known_maps_whatever_the_area():
    """An isometry has D = 1: (2 + λ 2) / χ, χ = 1 without ε; the mean over a group is that of each face."""
    for scale in (1.0, 10.0):
        points, faces = shapes.delaunay_disk(50)
        part, x = whole((points * scale, faces))
        n = np.ones(part.n_groups)
        assert FoldoverEnergy(part, 0 * n).energy(x)[0] == pytest.approx(4 * n)
        assert FoldoverEnergy(part, n).energy(x)[0] == pytest.approx(8 / (1 + np.sqrt(2)) * n)
        mirrored = FoldoverEnergy(part, n).energy(x * [-1, 1])[0]
        assert mirrored == pytest.approx(8 / (np.sqrt(2) - 1) * n)
        # twice as large: 8 + 1 + 16 over 4
        assert FoldoverEnergy(part, 0 * n).energy(2 * x)[0] == pytest.approx(25 / 4 * n)


@pytest.mark.parametrize("epsilon", [1.0, 1e-2, 1e-5])
def test_the_barrier_is_smooth_and_keeps_its_digits(epsilon):
    part, _ = whole(shapes.grid(3, 3))
    problem = FoldoverEnergy(part, np.full(part.n_groups, epsilon))
    det = np.resize([-1e3, -1.0, 0.0, 1.0, 1e3], len(part.cut_mesh.faces))
    chi, root = problem.barrier(det)
    np.testing.assert_allclose(root, np.hypot(epsilon, det))
    assert (chi > 0).all()
    np.testing.assert_allclose(chi * (root - det) * 2, epsilon**2, rtol=1e-3, atol=1e-7)
    assert chi[2] == pytest.approx(epsilon / 2)
    assert chi[0] == pytest.approx(epsilon**2 / 4000, rel=1e-6)
    assert chi[4] == pytest.approx(1000, rel=1e-6)


def test_lowering_turns_every_face_upright_and_moves_nothing_that_is_held():
    cut_mesh, uv = tangled(200)
    hold = rim(cut_mesh)
    part = moving_region(cut_mesh, np.ones(len(cut_mesh.faces), bool), hold, uv)
    x = uv[part.source]
    ones = FoldoverEnergy(part, np.ones(part.n_groups))
    assert ones.determinants(x).min() < 0
    found = lower(part, x, None)
    assert ones.determinants(found).min() > POSITIVE
    np.testing.assert_array_equal(found[part.fixed], x[part.fixed])
    # what is upright already stays as it is
    np.testing.assert_array_equal(lower(part, found, None), found)


def test_a_group_that_has_flown_apart_keeps_its_place_and_others_are_mended():
    """Two tangled disks; one is drawn out so far that it counts as flown apart from the start."""
    cut_mesh, points = patches_of(shapes.row_of(shapes.delaunay_disk(120), 2))
    uv = points[:, :2].copy()
    chart = cut_mesh.vertex_chart
    inner = np.flatnonzero(~rim(cut_mesh))
    chosen = np.concatenate([inner[chart[inner] == c][:4] for c in (0, 1)])
    uv[chosen] += np.random.default_rng(0).normal(0, 0.15, (8, 2))
    part = moving_region(cut_mesh, np.ones(len(cut_mesh.faces), bool), rim(cut_mesh), uv)
    x = uv[part.source].copy()
    ones = FoldoverEnergy(part, np.ones(part.n_groups))
    far = chart[part.source] == 1
    x[far] *= 1e6
    apart = far[part.faces].any(1)
    before = ones.determinants(x)
    assert before[apart].min() < 0
    assert before[~apart].min() < 0
    found = lower(part, x, None)
    assert (ones.determinants(found)[~apart] > POSITIVE).all()
    np.testing.assert_array_equal(found[far], x[far])
