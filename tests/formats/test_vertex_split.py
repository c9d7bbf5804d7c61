"""One uv a vertex: duplicates behind the input's vertices, in the order of first appearance."""

from __future__ import annotations

import numpy as np

from circparam.formats.vertex_split import split_vertices


def test_the_first_corner_of_a_vertex_keeps_it() -> None:
    vertex = np.array([0, 1, 2, 2, 1, 3])
    split = split_vertices(4, vertex, np.arange(10.0).reshape(5, 2), np.array([0, 1, 2, 4, 1, 3]))
    assert split.corner.tolist() == [0, 1, 2, 4, 1, 3]
    assert split.source.tolist() == [0, 1, 2, 3, 2]
    assert split.uv.tolist() == [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]]
    assert split.added == 1
