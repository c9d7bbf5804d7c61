"""The layout that Jacobians ask for, from one that is nearly it: the direct solve is the judge."""

import numpy as np
import pytest

from circparam.core.arrays import group_count, group_sum
from circparam.geometry.intrinsic import jacobians
from circparam.solvers.cell_poisson import CellPoisson
from circparam.solvers.poisson import from_jacobians
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import patches_of


def cells_of(cut_mesh, uv, side: float) -> np.ndarray:
    """Squares of the plane, chart by chart."""
    square = np.floor(uv / side).astype(np.int64)
    square -= square.min(0)
    key = (cut_mesh.vertex_chart * 1000 + square[:, 0]) * 1000 + square[:, 1]
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def centred(cut_mesh, uv):
    n = cut_mesh.n_charts
    count = group_count(cut_mesh.vertex_chart, n)
    mean = np.stack([group_sum(uv[:, d], cut_mesh.vertex_chart, n) / count for d in range(2)], 1)
    return uv - mean[cut_mesh.vertex_chart]


@pytest.mark.parametrize("far", [0.0, 0.4])
def test_the_direct_solve_and_conjugate_gradients_agree(far: float) -> None:
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(1500, 0.6), 2))
    uv, _ = tutte_embedding(cut_mesh, "mean-value")
    rng = np.random.default_rng(0)
    targets = np.moveaxis(jacobians(cut_mesh, uv), 0, -1)
    targets = targets + 0.2 * rng.normal(size=targets.shape)
    wanted, _ = from_jacobians(cut_mesh, targets)
    # wrong by noise on every vertex, and by a wave that is as long as a chart
    start = wanted + 0.05 * rng.normal(size=wanted.shape) + far * np.sin(wanted)
    system = CellPoisson(cut_mesh, cells_of(cut_mesh, uv, 0.2))
    found = centred(cut_mesh, system.towards(targets, start))
    size = np.ptp(wanted, axis=0).max()
    assert np.abs(found - centred(cut_mesh, wanted)).max() < 1e-2 * size
    assert np.abs(centred(cut_mesh, start) - centred(cut_mesh, wanted)).max() > 5e-2 * size
