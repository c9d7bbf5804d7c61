"""The symmetric Dirichlet energy: face by face, its derivatives, and of many charts as one objective."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core.arrays import FloatArray
from circparam.core.linalg import Factor
from circparam.solvers import dirichlet
from circparam.solvers.objective import Objective, chart_energies, in_units_of_faces
from circparam.solvers.pattern import VertexPattern, hold
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of
from tests.support.shapes import areas


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
def test_energies_do_not_depend_on_the_unit(size):
    points, faces = shapes.bumped_disk(100)
    one, places = patches_of((points, faces))
    other, _ = patches_of((size * points, faces))
    uv = places[:, :2]
    np.testing.assert_allclose(chart_energies(other, size * uv), chart_energies(one, uv), rtol=1e-9)
    scaled, u, scale = in_units_of_faces(other, size * uv)
    assert scaled.areas.mean() == pytest.approx(1)
    np.testing.assert_allclose(u * scale, size * uv)


# one factor of all; a factor for each small chart of a large system; iteration; the last two beside each other
SYSTEMS = {"one": [60, 60], "small": [700] * 5, "large": [1600, 1700], "both": [300, 3000]}


@pytest.mark.parametrize("sizes", SYSTEMS.values(), ids=SYSTEMS)
@pytest.mark.parametrize("proxy", [False, True])
def test_directions_descend_and_move_no_chart_as_a_whole(sizes, proxy):
    """Whatever solves the system; each chart goes about where it goes alone."""
    disks = [
        (p + np.array([3.0 * k, 0, 0]), f)
        for k, (p, f) in enumerate(map(shapes.delaunay_disk, sizes))
    ]
    cut_mesh, points = patches_of(shapes.join(*disks))
    uv = points[:, :2] * [1.5, 0.8]
    objective = Objective(cut_mesh, None, 0.0)
    jacobian = objective.energies(uv)[1]
    g = objective.gradient(jacobian, uv)
    d = objective.direction(uv, jacobian, g, proxy)
    chart = cut_mesh.vertex_chart
    assert (np.bincount(chart, (g * d).sum(1)) < 0).all()
    for k in range(2):
        assert np.abs(np.bincount(chart, d[:, k])).max() < 1e-9 * np.abs(d).max() * len(d)
    for k in range(len(sizes)):
        part, vertices, faces = cut_mesh.subset(np.arange(len(sizes)) == k)
        alone = Objective(part, None, 0.0)
        own = alone.direction(uv[vertices], jacobian[:, :, faces], g[vertices], proxy)
        assert np.abs(d[vertices] - own).max() < 0.05 * np.abs(own).max()


@given(st.integers(0, 10_000))
@settings(max_examples=40)
def test_the_largest_step_is_where_a_face_first_collapses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array([[0.0, 1.0, 0.2], [0.0, 0.1, 1.0]])[:, :, None] + rng.normal(
        scale=0.1, size=(2, 3, 30)
    )
    direction = rng.normal(size=(2, 3, 30))
    t = dirichlet.largest_step(corners, direction)

    def area(s: FloatArray) -> FloatArray:
        return 2 * areas((corners + s * direction).transpose(2, 1, 0))

    hit = np.isfinite(t)
    reached = np.where(hit, t, 0.0)
    assert (np.abs(area(reached)) <= 1e-9 * (1 + reached**2))[hit].all()  # rounding of far corners
    for share in (0.1, 0.5, 0.9, 0.99):
        assert (area(np.where(hit, share * t, share * 50.0)) > 0).all()


@pytest.mark.parametrize("bad", [[[1, 0], [0, -1]], [[1, 1], [1, 1]], [[0, 0], [0, 0]]])
def test_flipped_and_collapsed_faces_have_infinite_energy(bad: list[list[float]]) -> None:
    j = np.array(bad, float)[:, :, None]
    for blend in (0.0, 0.5, 1.0):
        assert dirichlet.energy(j, blend)[0] == np.inf


def hessian(cut_mesh, uv):
    """A projected Hessian."""
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jac = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
    blocks = dirichlet.edge_blocks(*dirichlet.newton_modes(jac), gradients)
    return VertexPattern(cut_mesh, None).block_rows(blocks)


def test_held_vertices_stay_and_the_others_move_as_the_system_without_them_says():
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(500), 2))
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    matrix = hessian(cut_mesh, uv)
    fixed = np.arange(len(uv)) % 7 == 0
    g = np.where(fixed[:, None], 0.0, np.random.default_rng(0).normal(size=uv.shape))
    free = np.repeat(~fixed, 2)
    alone = Factor(matrix.tocsr()[free][:, free]).solve(g[~fixed].ravel()).reshape(-1, 2)
    hold(matrix, fixed)
    found = Factor(matrix).solve(g.ravel()).reshape(-1, 2)
    assert not found[fixed].any()
    np.testing.assert_allclose(found[~fixed], alone, atol=1e-9 * np.abs(alone).max())
