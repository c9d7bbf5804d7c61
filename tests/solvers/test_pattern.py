"""Matrices over the vertices of a cut mesh: the numbers of the plain assembly, whatever the order."""

import numpy as np
import pytest

from circparam.core.linalg import Factor
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet
from circparam.solvers.pattern import VertexPattern, hold
from circparam.solvers.poisson import laplacian
from circparam.solvers.preconditioner import BlockPattern
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of


def charts() -> tuple[CutMesh, np.ndarray]:
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(60), 2))
    return cut_mesh, tutte_embedding(cut_mesh, "mean-value")[0]


def two_faces_glued_twice() -> CutMesh:
    """Two edges of one face are glued to two of the other: both join vertex 0 or 2 to vertex 1."""
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    faces = np.array([[0, 1, 2], [1, 0, 2]])
    return CutMesh(faces, np.stack([corner, corner]), np.zeros(2, np.int64), np.array([[0, 3]]))


def blocks_of(cut_mesh: CutMesh, uv: np.ndarray) -> np.ndarray:
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jacobian = dirichlet.jacobians(gradients, uv[cut_mesh.faces].transpose(2, 1, 0))
    return dirichlet.edge_blocks(*dirichlet.newton_modes(jacobian), gradients)


def weights(cut_mesh: CutMesh) -> np.ndarray:
    g = cut_mesh.gradients
    return (-(g * g[:, :, [1, 2, 0]]).sum(1) * cut_mesh.areas[:, None]).T.ravel()


@pytest.mark.parametrize("order", [None, np.array([2, 0, 1])])
def test_vertices_that_two_edges_join_have_one_entry(order: np.ndarray | None) -> None:
    cut_mesh = two_faces_glued_twice()
    pattern = VertexPattern(cut_mesh, order)
    rows = np.arange(3) if order is None else order
    got = pattern.numbers(weights(cut_mesh), np.zeros(3)).toarray()
    np.testing.assert_allclose(got, laplacian(cut_mesh).toarray()[np.ix_(rows, rows)], atol=1e-12)
    blocks = np.random.default_rng(1).normal(size=(2, 2, 3, 2))
    blocks = blocks + blocks.transpose(1, 0, 2, 3)
    matrix = pattern.blocks(blocks)
    assert matrix.has_canonical_format
    got = matrix.toarray()
    both = (2 * rows[:, None] + [0, 1]).ravel()
    whole = BlockPattern(cut_mesh).assemble(blocks).toarray()
    np.testing.assert_allclose(got, whole[np.ix_(both, both)], atol=1e-7)


def test_a_solve_in_any_order_is_the_same_and_fixed_vertices_do_not_move() -> None:
    cut_mesh, uv = charts()
    blocks = blocks_of(cut_mesh, uv)
    g = np.random.default_rng(2).normal(size=uv.shape)
    fixed = np.arange(cut_mesh.n_vertices) % 5 == 0
    g[fixed] = 0.0
    found = []
    plain = VertexPattern(cut_mesh, None)
    for pattern in (plain, VertexPattern(cut_mesh, np.arange(cut_mesh.n_vertices)[::-1])):
        matrix = pattern.blocks(blocks).copy()
        hold(matrix, fixed[pattern.order])
        found.append(pattern.scatter(Factor(matrix, pattern.ordered).solve(pattern.gather(g))))
        assert np.abs(found[-1][fixed]).max() == 0
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-9)
    free = ~np.repeat(fixed, 2)
    whole = BlockPattern(cut_mesh).assemble(blocks).toarray()
    np.testing.assert_allclose(
        whole[np.ix_(free, free)] @ found[0].ravel()[free], g.ravel()[free], atol=1e-7
    )
