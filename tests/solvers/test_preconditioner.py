"""The block matrix of all charts, with vertices that are held."""

import numpy as np

from circparam.core.linalg import Factor
from circparam.solvers import dirichlet
from circparam.solvers.pattern import VertexPattern, hold
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of


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
