"""The outer boundary of every chart, in order."""

import numpy as np
import pytest

from circparam.solvers.tutte.outer import SHORTEST_SHARE, outer_boundary
from tests.support.charts import patches_of


def test_a_very_short_edge_keeps_a_share_of_the_mean():
    n = 12
    t = 2 * np.pi * np.arange(n) / n
    t[1] = 1e-9
    ring = np.c_[np.cos(t), np.sin(t), 0 * t]
    faces = np.array([[n, k, (k + 1) % n] for k in range(n)])
    cut_mesh, _ = patches_of((np.vstack([ring, [[0, 0, 0]]]), faces))
    outer = outer_boundary(cut_mesh)
    length = cut_mesh.edge_lengths.ravel()[outer.half_edge]
    short = int(np.argmin(length))
    assert length[short] < 1e-8
    step = np.mod(outer.place[outer.follower] - outer.place, 1)
    assert step[short] == pytest.approx(SHORTEST_SHARE / n, rel=2e-3)
