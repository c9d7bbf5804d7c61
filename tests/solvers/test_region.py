"""Parts of a cut mesh that move while the rest stays."""

import numpy as np

from circparam.solvers.region import cut_out
from tests.support import shapes
from tests.support.charts import patches_of


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
