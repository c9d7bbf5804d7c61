"""The block matrix of all charts, and the two-level preconditioner."""

from __future__ import annotations

import numpy as np

from circparam.solvers import dirichlet
from circparam.solvers.preconditioner import BlockPattern
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support.charts import developable


def test_the_assembled_matrix_is_symmetric_and_blind_to_translations() -> None:
    cut_mesh = developable("cone")
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jac = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
    blocks = dirichlet.edge_blocks(*dirichlet.newton_modes(jac), gradients)
    matrix = BlockPattern(cut_mesh).assemble(blocks).toarray()
    assert np.allclose(matrix, matrix.T, atol=1e-9 * np.abs(matrix).max())
    shift = np.tile([1.0, 0.0], cut_mesh.n_vertices)
    assert np.abs(matrix @ shift).max() <= 1e-7 * np.abs(matrix).max()
