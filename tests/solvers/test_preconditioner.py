"""The block matrix of all charts, and the two-level preconditioner."""

import numpy as np

from circparam.core.linalg import conjugate_gradients, solve
from circparam.solvers import dirichlet
from circparam.solvers.pattern import VertexPattern, hold
from circparam.solvers.preconditioner import CoarseSpace, TwoLevel, aggregates
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of


def hessian(cut_mesh, uv):
    """A projected Hessian."""
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jac = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
    blocks = dirichlet.edge_blocks(*dirichlet.newton_modes(jac), gradients)
    return VertexPattern(cut_mesh, None).block_rows(blocks)


def layout():
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(500), 2))
    return cut_mesh, tutte_embedding(cut_mesh, "mean-value")[0]


def balanced(cut_mesh, g):
    """Forces that move no chart as a whole, which no energy resists."""
    chart = cut_mesh.vertex_chart
    mean = np.stack([np.bincount(chart, x) for x in g.T], 1) / np.bincount(chart)[:, None]
    return g - mean[chart]


def test_conjugate_gradients_with_two_levels_equal_a_direct_solve():
    cut_mesh, uv = layout()
    matrix = hessian(cut_mesh, uv)
    g = balanced(cut_mesh, np.random.default_rng(0).normal(size=uv.shape))
    direct = solve(matrix, g.ravel()).reshape(-1, 2)
    np.testing.assert_allclose(matrix @ direct.ravel(), g.ravel(), atol=1e-6)
    coarse = CoarseSpace(matrix, aggregates(cut_mesh, uv), uv)
    precondition = TwoLevel(matrix, coarse)
    x = conjugate_gradients(matrix, g.ravel(), precondition, 1e-12, 2000).reshape(-1, 2)
    error = balanced(cut_mesh, x - direct)
    assert np.abs(error).max() < 1e-5 * np.abs(direct).max()
    rough = conjugate_gradients(matrix, g.ravel(), precondition, 1e-2, 2000)
    assert rough @ g.ravel() > 0, "a descent direction"
    gap = [np.abs(matrix @ y - g.ravel()).max() for y in (x.ravel(), rough)]
    assert gap[0] < 1e-3 * gap[1], "the tolerance is heeded"


def test_held_vertices_stay_and_the_others_move_as_the_system_without_them_says():
    cut_mesh, uv = layout()
    matrix = hessian(cut_mesh, uv)
    fixed = np.arange(len(uv)) % 7 == 0
    g = np.where(fixed[:, None], 0.0, np.random.default_rng(0).normal(size=uv.shape))
    free = np.repeat(~fixed, 2)
    alone = solve(matrix.tocsr()[free][:, free], g[~fixed].ravel()).reshape(-1, 2)
    hold(matrix, fixed)
    found = solve(matrix, g.ravel()).reshape(-1, 2)
    assert not found[fixed].any()
    np.testing.assert_allclose(found[~fixed], alone, atol=1e-9 * np.abs(alone).max())
