"""Parts of one chart that lie on each other are pushed apart; the law of the springs that do it."""

import numpy as np
import pytest
import scipy.sparse as sps

from circparam.geometry.overlap import self_overlapping
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.segmentation.decide import ANY_BOUND
from circparam.solvers.objective import chart_energies
from circparam.solvers.separate import push_apart
from tests.support import shapes
from tests.support.charts import patches_of, too_near

MARGIN = 0.002


def ring_of(turn: float, around: int = 96, along: int = 6) -> tuple[CutMesh, np.ndarray]:
    """A flat ring of this angle that rises a little, and its layout seen from above."""
    points, faces = shapes.grid(around, along)
    t, r = turn * points[:, 0], 1.0 - 0.3 * points[:, 1]
    p = np.stack([r * np.cos(t), r * np.sin(t), 1e-4 * t], 1)
    cut_mesh, places = patches_of((p, faces))
    uv = np.ascontiguousarray(places[:, :2])
    return cut_mesh, uv if np.isfinite(chart_energies(cut_mesh, uv)).all() else uv * [-1, 1]


@pytest.mark.parametrize("beyond", [0.004, 0.012])
def test_a_ring_that_overlaps_itself_a_little_is_separated_within_the_bound(beyond: float) -> None:
    cut_mesh, uv = ring_of(2 * np.pi + beyond)
    before = uv.copy()
    assert self_overlapping(cut_mesh, uv).all()
    pushed, fine = push_apart(cut_mesh, uv, MARGIN, 1.05)
    np.testing.assert_array_equal(uv, before)
    assert fine.all()
    assert not too_near(cut_mesh, pushed, MARGIN).any()
    assert chart_energies(cut_mesh, pushed).max() <= 1.05


def test_no_margin_asks_for_no_overlap_and_no_more() -> None:
    cut_mesh, uv = ring_of(2 * np.pi + 0.004)
    pushed, fine = push_apart(cut_mesh, uv, 0.0, 1.05)
    assert fine.all()
    assert not self_overlapping(cut_mesh, pushed).any()
    assert chart_energies(cut_mesh, pushed).max() <= 1.05


def test_without_a_bound_nothing_overflows() -> None:
    cut_mesh, uv = ring_of(2 * np.pi + 0.004)
    pushed, fine = push_apart(cut_mesh, uv, MARGIN, ANY_BOUND)
    assert fine.all()
    assert not self_overlapping(cut_mesh, pushed).any()


def test_ends_that_are_nearer_than_the_margin_are_separated_too() -> None:
    cut_mesh, uv = ring_of(2 * np.pi - 0.001)
    assert not self_overlapping(cut_mesh, uv).any()
    assert too_near(cut_mesh, uv, MARGIN).all()
    pushed, fine = push_apart(cut_mesh, uv, MARGIN, 1.05)
    assert fine.all()
    assert not too_near(cut_mesh, pushed, MARGIN).any()


def test_what_has_no_room_under_the_bound_or_lies_deep_is_not_said_to_be_separate() -> None:
    cut_mesh, uv = ring_of(2 * np.pi + 0.012)
    assert not push_apart(cut_mesh, uv, MARGIN, 1 + 1e-9)[1].any()
    cut_mesh, uv = ring_of(2 * np.pi + 1.5)
    assert not push_apart(cut_mesh, uv, MARGIN, 1.05)[1].any()


def test_a_chart_that_is_separate_stays_where_it_is() -> None:
    cut_mesh, uv = ring_of(5.0)
    pushed, fine = push_apart(cut_mesh, uv, MARGIN, 1.05)
    assert fine.all()
    np.testing.assert_allclose(pushed, uv, atol=1e-12)


def sparse(matrix: np.ndarray) -> sps.bsr_matrix:
    return sps.bsr_matrix(matrix, blocksize=(2, 2))


def test_a_separate_chart_above_the_bound_is_not_fine() -> None:
    cut_mesh, uv = ring_of(5.0)
    energy = float(chart_energies(cut_mesh, 1.2 * uv)[0])
    assert not push_apart(cut_mesh, 1.2 * uv, MARGIN, 0.99 * energy)[1].any()
    assert push_apart(cut_mesh, 1.2 * uv, MARGIN, 1.01 * energy)[1].all()
