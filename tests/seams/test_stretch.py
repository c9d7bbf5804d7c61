"""The stretch of the level of a large surface: which of several atlases is held."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.seams import stretch
from circparam.seams.cost import COST
from circparam.seams.options import SeamOptions
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, middles, surface_of


def halves(step: int, scale: float) -> tuple[Atlas, Atlas]:
    """A sheet in two halves, twice: cut straight, and with a step of some edges. scale: of the layout in x."""
    surface = surface_of(*shapes.grid(20, 20))
    x, y = (np.unique(surface.points[:, k]) for k in (0, 1))
    at = middles(surface)
    both = []
    for ahead in (0, step):
        label = at[:, 0] > np.where(at[:, 1] > y[10], x[10 + ahead], x[10])
        both.append(as_it_lies(cut_between(surface, label.astype(int))))
        both[-1].corners[:, :, 0] *= scale
    return both[0], both[1]


def held(
    tried: list[Atlas], monkeypatch: pytest.MonkeyPatch
) -> tuple[Atlas, Atlas | None, list[float]]:
    """What is found where seams for the stretch make the straight cut the dearer one; costs of what they were
    asked for."""
    asked: list[float] = []
    straight = tried[0].cut.copy()

    def hold(
        atlas: Atlas, limits: object, monitor: Monitor, slits: bool = True, splits: bool = True
    ) -> None:
        if slits:
            asked.append(COST.seams(atlas))
            if np.array_equal(atlas.cut, straight):
                y = middles(atlas.surface)[:, 1]
                atlas.cut |= cut_between(atlas.surface, (y > np.median(y)).astype(int)).cut

    monkeypatch.setattr(stretch, "limit_stretch", hold)
    best, other = stretch.best_held(tried, 1.05, SeamOptions(), Worker(1), Monitor())
    return best, other, asked


def test_where_weights_hold_it_the_cheapest_alone_is_gone_through(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, second = halves(1, 1.0)
    assert COST.seams(first) < COST.seams(second) < 1.1 * COST.seams(first)
    best, other, asked = held([first, second], monkeypatch)
    assert other is second
    assert asked == [COST.seams(first)]
    assert COST.seams(best) > COST.seams(second)


def test_where_seams_are_needed_another_that_costs_hardly_more_may_be_the_best(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, second = halves(1, 9.0)
    best, other, asked = held([first, second], monkeypatch)
    assert np.array_equal(best.cut, second.cut)
    assert other is first
    assert asked == [COST.seams(first), COST.seams(second)]


def test_one_that_costs_far_more_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = halves(8, 9.0)
    assert COST.seams(second) > 1.1 * COST.seams(first)
    _, other, asked = held([first, second], monkeypatch)
    assert other is second
    assert asked == [COST.seams(first)]
    assert held([first], monkeypatch)[1] is None
