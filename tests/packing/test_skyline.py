"""Charts on the skyline of those below."""

from __future__ import annotations

import numpy as np

from circparam.packing import pack
from circparam.packing.options import PackOptions
from tests.support.packing import covered, shelf, triangles


def test_two_thousand_single_triangles():
    faces, uv, chart = triangles(2000, 1)
    options = PackOptions(1024, 2)
    packed = pack(faces, uv, chart, options)
    owner, twice = covered(faces, packed.uv, chart, 1024)
    assert twice == 0
    assert packed.share[0] > 1.1 * shelf(faces, uv, chart, options).share[0]
    centres = np.argwhere(owner >= 0)
    who = owner[owner >= 0]
    from scipy.spatial import cKDTree

    pairs = cKDTree(centres).query_pairs(2.99, output_type="ndarray")
    assert (who[pairs[:, 0]] == who[pairs[:, 1]]).all()
