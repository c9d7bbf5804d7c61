"""A budget counted in operations, ended by the deadline."""

from __future__ import annotations

from circparam.packing.budget import Budget


def test_a_budget_is_over_when_nothing_is_left() -> None:
    budget = Budget(3.0, lambda: False)
    assert budget.spend(1.0)
    assert budget.left == 2.0
    assert budget.spend(1.5)
    assert not budget.over
    assert not budget.spend(0.5)  # exactly used up
    assert budget.left == 0.0
    assert budget.over
    assert not budget.late
    assert not budget.spend(0.0)


def test_a_deadline_ends_a_budget_that_is_left() -> None:
    budget = Budget(3.0, lambda: True)
    assert budget.late
    assert budget.over
    assert not budget.spend(1.0)
    assert budget.left == 2.0
