"""Boundaries as segments: their order, their sides, their lengths, and loops that lie folded out."""

import numpy as np
import pytest

from circparam.geometry.boundary import BoundarySegments, boundary_of, turned_out
from circparam.mesh.halfedge import shared_edges
from tests.support.shapes import flat_ring

SQUARE = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def segments(faces: np.ndarray, uv: np.ndarray, chart: np.ndarray) -> BoundarySegments:
    return boundary_of(faces, uv, chart, shared_edges(faces), int(chart.max()) + 1)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_second_loop_counter_clockwise_is_turned_out(scale: float) -> None:
    """A ring's hole runs clockwise; drawn wider than the outer loop it is folded out, and so are both."""
    uv, faces = flat_ring(scale, 2 * scale)
    chart = np.zeros(len(faces), np.int64)
    boundary = segments(faces, uv, chart)
    assert turned_out(boundary, 1).tolist() == [False]
    # the hole turned by hand: its segments run the other way
    s, e = boundary.start.copy(), boundary.end.copy()
    hole = np.linalg.norm(s, axis=1) < 1.5 * scale
    folded = BoundarySegments(
        boundary.half_edge,
        boundary.chart,
        np.where(hole[:, None], s * [1, -1], s),
        np.where(hole[:, None], e * [1, -1], e),
        boundary.following,
        boundary.before,
        boundary.size,
    )
    assert turned_out(folded, 1).tolist() == [True]
    # far from the origin, and beside a chart that is sound
    far = scale * (SQUARE + 1000)
    both = np.concatenate([far, uv + 1000 * scale])
    boundary = segments(
        np.r_[HALVES, faces + 4], both, np.repeat([0, 1], [len(HALVES), len(faces)])
    )
    assert turned_out(boundary, 2).tolist() == [False, False]


def test_a_slit_has_no_area_but_for_rounding() -> None:
    """Two long edges on one line far out, there and back: a loop, but not one that runs either way round."""
    uv, faces = flat_ring(1.0, 2.0)
    outer = segments(faces, uv, np.zeros(len(faces), np.int64))
    for shift in (0.0, 1e3):
        line = np.array([[0.1, 0.1], [0.3, 0.7]]) + shift / 3
        slit = np.array([line, line[::-1]])
        n = len(outer.chart)
        boundary = BoundarySegments(
            np.arange(n + 2),
            np.zeros(n + 2, np.int64),
            np.r_[outer.start, slit[:, 0]],
            np.r_[outer.end, slit[:, 1]],
            np.r_[outer.following, n + 1, n],
            np.r_[outer.before, n + 1, n],
            np.ones(1),
        )
        assert turned_out(boundary, 1).tolist() == [False]
