"""The foldover-free energy and its descent."""

import numpy as np

from circparam.solvers.region import moving_region
from circparam.solvers.untangle import POSITIVE, FoldoverEnergy, lower
from tests.support import shapes
from tests.support.charts import patches_of, rim


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
