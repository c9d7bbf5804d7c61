"""One dial for the search: a draft keeps all promises, more effort never costs more."""

from typing import Any

import numpy as np
import pytest

import circparam
from circparam import errors
from circparam.core.monitor import Monitor
from circparam.pipeline.configure import open_source
from circparam.pipeline.flatten import find_seams, first_layout
from circparam.pipeline.job import prepare
from circparam.pipeline.options import TIMED_SEARCHES, Options
from circparam.pipeline.searches import Drafted, cost_of, on_page
from tests.support import shapes
from tests.support.clock import Clock
from tests.support.unwrapped import cost

PAGE = {"resolution": 256, "hide_seams": 0.0}


def unwrapped(shape: shapes.Shape, **options: Any) -> circparam.Result:
    return circparam.unwrap(shape, **(PAGE | {"jobs": 1} | options))


@pytest.fixture(scope="module")
def three() -> circparam.Result:
    return unwrapped(shapes.bumpy(1), effort=3)


def test_more_effort_keeps_the_cheapest_of_all_searches(three: circparam.Result) -> None:
    found = three.effort
    assert found.searches == len(found.costs) == 3
    assert found.more == 0
    assert len(set(found.costs)) > 1  # else there is nothing to choose from
    assert found.costs[found.best] == min(found.costs)
    assert cost(three) == pytest.approx(
        min(found.costs), rel=0.02
    )  # the page is measured in texels


def test_more_effort_contains_the_searches_of_less(three: circparam.Result) -> None:
    two = unwrapped(shapes.bumpy(1), effort=2)
    assert two.effort.costs == three.effort.costs[:2]
    assert min(three.effort.costs) <= min(two.effort.costs)


def blades(seed: int, count: int = 9, corners: int = 11) -> shapes.Shape:
    """Flat pieces with long tips, each a component: the same charts in every search."""
    radius = np.random.default_rng(seed).uniform(0.3, 1.5, (count, corners))
    angle = np.arange(corners) * 2 * np.pi / corners
    tips = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * radius], -1)
    pieces = np.concatenate([np.zeros((count, 1, 3)), tips], axis=1)
    pieces[..., 0] += 4 * np.arange(count)[:, None]
    k = np.arange(corners)
    fan = np.stack([np.zeros(corners, int), 1 + k, 1 + (k + 1) % corners], 1)
    return pieces.reshape(-1, 3), (fan + (corners + 1) * np.arange(count)[:, None, None]).reshape(
        -1, 3
    )


@pytest.mark.parametrize("seed", [0, 5])
def test_the_best_of_several_searches_is_packed_with_more_work(seed: int) -> None:
    one, four = (circparam.unwrap(blades(seed), effort=effort, jobs=1) for effort in (1, 4))
    assert one.measures["charts"] == four.measures["charts"]
    assert four.measures["pack"] > one.measures["pack"]
    assert four.effort.costs[four.effort.best] < max(four.effort.costs)


def test_a_full_search_costs_no_more_than_a_draft() -> None:
    """On this torus a search alone costs more."""
    shape = shapes.noisy(*shapes.torus(50, 25), amount=0.06, seed=1)
    draft, normal = (cost(unwrapped(shape, effort=effort)) for effort in ("draft", "normal"))
    assert normal <= draft


@pytest.mark.parametrize(
    "shape",
    [shapes.bumpy(3), shapes.cube(8), shapes.noisy(*shapes.torus(50, 25), amount=0.06, seed=1)],
)
def test_where_time_is_up_a_full_search_costs_no_more_than_a_draft(shape, clock):
    """The draft comes first where a full search may not end in time, on every kind of surface."""
    options, monitor = Options(jobs=1, **PAGE), Monitor(timeout=10.0)
    job = prepare(open_source(shape, options), None, options, monitor)
    draft = Drafted.of(job, monitor, 20.0)
    clock.now += 20.0
    cascade = first_layout(job, find_seams(job, monitor), monitor)
    found, _ = on_page(cascade, draft, options, monitor)
    assert monitor.hurried
    assert cost_of(found, options) <= cost(unwrapped(shape, effort="draft")) * 1.02
    assert any("out of time" in note for note in found.notes)


@pytest.mark.parametrize(("ends", "made"), [(True, 0), (False, 1)])
def test_the_effort_made_is_that_of_the_charts_kept(ends: bool, made: int, clock: Clock) -> None:
    """So little time that a draft comes first; the clock stands, or goes on once the draft is packed."""
    packed = False

    def listener(stage: str, share: float, note: str) -> None:
        nonlocal packed
        packed |= stage == "pack"
        if packed and stage != "pack" and ends:
            clock.now = 0.5

    found = unwrapped(shapes.bumpy(3), effort=1, timeout=0.5, listener=listener)
    assert "draft" in found.seconds
    assert found.effort.made == made
    assert any("those of a draft" in note for note in found.notes) == ends


def test_time_chooses_the_effort_where_nothing_else_does(clock: Clock) -> None:
    """By a clock that counts its calls: searches are made as long as one more is likely to end."""
    clock.step = 1.0
    unwrapped(shapes.icosphere(1), effort=1, timeout=1e9)
    limit, clock.now = 3 * clock.now, 0.0
    found = unwrapped(shapes.icosphere(1), timeout=limit).effort
    assert clock.now < 1.1 * limit
    assert 1 < found.searches < TIMED_SEARCHES
    assert found.searches + found.more == TIMED_SEARCHES
    assert min(found.costs) == found.costs[found.best]


def test_an_effort_beside_a_deadline_ends_with_the_earlier_one() -> None:
    assert Options(effort=2, timeout=900.0).searches == 2
    assert Options(timeout=900.0).searches == TIMED_SEARCHES
    assert Options().searches == 1
    assert Options(effort=0.5, timeout=900.0).searches == 1


@pytest.mark.parametrize("word", ["fast", "drft", "nomal", -1, float("nan"), 1e9])
def test_an_effort_that_is_none_is_told(word: Any) -> None:
    with pytest.raises(errors.OptionError, match="--effort") as info:
        Options(effort=word)
    assert "draft" in str(info.value)


@pytest.mark.parametrize(("shape", "density"), [(shapes.cube(3), 82), (shapes.icosphere(1), 98)])
def test_a_draft_refuses_nothing_that_a_full_search_can_pack(shape, density):
    """Charts at a fixed size on pages of a fixed size: both efforts find room."""
    fixed: dict[str, Any] = {"resolution": 128, "padding": 1, "pages": 100}
    for effort in ("draft", "normal"):
        result = unwrapped(shape, effort=effort, texel_density=density, **fixed)
        assert result.status == "ok"
