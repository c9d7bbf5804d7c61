"""Parts of one chart that lie on each other are pushed apart."""

import numpy as np
import pytest

from circparam.geometry.overlap import self_overlapping
from circparam.seams.segmentation.decide import ANY_BOUND
from circparam.solvers.objective import chart_energies
from circparam.solvers.separate import push_apart
from tests.support import shapes
from tests.support.charts import flat_of, too_near

MARGIN = 0.002


@pytest.mark.parametrize("beyond", [-0.001, 0.004, 0.012])
@pytest.mark.parametrize("margin", [MARGIN, 0.0])
def test_parts_on_or_too_near_each_other_are_separated_within_the_bound(beyond, margin):
    """Without a margin no overlap is asked for, and no more."""
    cut_mesh, uv = flat_of(shapes.wound(2 * np.pi + beyond, 96, 6))
    before = uv.copy()
    assert self_overlapping(cut_mesh, uv).all() == (beyond > 0)
    assert too_near(cut_mesh, uv, MARGIN).all()
    pushed, fine = push_apart(cut_mesh, uv, margin, 1.05)
    np.testing.assert_array_equal(uv, before)
    assert fine.all()
    assert not (
        too_near(cut_mesh, pushed, margin) if margin else self_overlapping(cut_mesh, pushed)
    ).any()
    assert chart_energies(cut_mesh, pushed).max() <= 1.05


def test_without_a_bound_nothing_overflows() -> None:
    cut_mesh, uv = flat_of(shapes.wound(2 * np.pi + 0.004, 96, 6))
    pushed, fine = push_apart(cut_mesh, uv, MARGIN, ANY_BOUND)
    assert fine.all()
    assert not self_overlapping(cut_mesh, pushed).any()


def test_what_has_no_room_under_the_bound_or_lies_deep_is_not_said_to_be_separate() -> None:
    cut_mesh, uv = flat_of(shapes.wound(2 * np.pi + 0.012, 96, 6))
    assert not push_apart(cut_mesh, uv, MARGIN, 1 + 1e-9)[1].any()
    cut_mesh, uv = flat_of(shapes.wound(2 * np.pi + 1.5, 96, 6))
    assert not push_apart(cut_mesh, uv, MARGIN, 1.05)[1].any()


def test_a_chart_that_is_separate_stays_where_it_is() -> None:
    cut_mesh, uv = flat_of(shapes.wound(5.0, 96, 6))
    pushed, fine = push_apart(cut_mesh, uv, MARGIN, 1.05)
    assert fine.all()
    np.testing.assert_allclose(pushed, uv, atol=1e-12)


def test_a_separate_chart_above_the_bound_is_not_fine() -> None:
    cut_mesh, uv = flat_of(shapes.wound(5.0, 96, 6))
    energy = float(chart_energies(cut_mesh, 1.2 * uv)[0])
    assert not push_apart(cut_mesh, 1.2 * uv, MARGIN, 0.99 * energy)[1].any()
    assert push_apart(cut_mesh, 1.2 * uv, MARGIN, 1.01 * energy)[1].all()
