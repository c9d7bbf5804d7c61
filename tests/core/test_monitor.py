"""Stages, progress and the deadline; work that has nothing to show is broken off at its last moment."""

import time

import numpy as np
import pytest
import scipy.sparse as sps

from circparam.core import clock, graph
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.errors import OutOfTimeError
from tests.support.clock import Clock


def test_seconds_of_inner_stages_count_for_themselves_only() -> None:
    monitor = Monitor()
    for _ in range(2):
        with monitor.stage("outer"), monitor.stage("inner"):
            time.sleep(0.05)
    assert monitor.seconds["inner"] >= 0.1, "they add up"
    assert monitor.seconds["outer"] < 0.05


def test_progress_goes_to_the_listener_under_the_name_of_its_stage() -> None:
    heard: list[tuple[str, float, str]] = []
    monitor = Monitor(lambda *what: heard.append(what))
    with monitor.stage("a"):
        monitor.update(0.5, "half")
        with monitor.stage("b"):
            monitor.update(1.0)
        monitor.update(0.75)
    assert heard == [
        ("a", 0.0, ""), ("a", 0.5, "half"), ("b", 0.0, ""), ("b", 1.0, ""),
        ("a", 0.5, ""), ("a", 0.75, ""),
    ]  # fmt: skip
    Monitor().update(0.5)


def test_a_stage_that_fails_is_measured_and_left() -> None:
    monitor = Monitor()
    with pytest.raises(ValueError, match="planted"), monitor.stage("a"):
        raise ValueError("planted")
    assert monitor.seconds["a"] >= 0
    monitor.deadline = 0.0
    with pytest.raises(OutOfTimeError, match="during the work"):
        monitor.check()


def test_the_deadline(clock: Clock) -> None:
    clock.now = 100.0
    monitor, unbound = Monitor(timeout=5.0), Monitor()
    for now, late in ((104.9, False), (105.0, True), (106.0, True)):
        clock.now = now
        assert monitor.expired is late
        assert not unbound.expired
        unbound.check()
        with monitor.stage("solve"):
            if late:
                with pytest.raises(OutOfTimeError, match=r"during solve.*--timeout"):
                    monitor.check()
            else:
                monitor.check()
    clock.now = 100.0
    monitor = Monitor(timeout=10.0)
    for seconds, held, short in (
        (9.0, 0.0, False),
        (10.0, 0.0, True),
        (5.5, 4.0, False),
        (6.5, 4.0, True),
    ):
        with monitor.holding(held):
            assert monitor.short(seconds) is short
    with monitor.holding(4.0):
        assert monitor.last == pytest.approx(106.7), "work without a result gets 0.7 s more"
    assert unbound.last is None
    clock.now = 108.0
    assert monitor.short(3.0)
    assert not unbound.short(1e9)
    # of 10 s from 100 on: 1.4 s of lateness are accepted where it is known how long the rest takes
    monitor.check(3.3)
    with pytest.raises(OutOfTimeError):
        monitor.check(3.5)
    assert not monitor.hurried, "nobody was told that time is up"


ONE = np.zeros(1, np.int64)
WORK = {
    "factor": lambda: Factor(sps.eye_array(3, format="csc")),
    "components": lambda: graph.components(2, ONE, ONE + 1),
    "matching": lambda: graph.matching(np.ones(1), ONE, ONE + 1, 2),
}


@pytest.mark.parametrize("name", WORK)
def test_building_blocks_look_at_the_clock(name: str) -> None:
    WORK[name]()
    with clock.bounded(None):
        WORK[name]()
    with clock.bounded(time.monotonic() + 1e6):
        WORK[name]()
        with pytest.raises(OutOfTimeError, match="--timeout"), clock.bounded(0.0):
            WORK[name]()
        WORK[name]()
    WORK[name]()


def test_what_is_left() -> None:
    assert clock.left() is None
    with clock.bounded(time.monotonic() + 100):
        rest = clock.left()
        assert 0 < rest <= 100
    assert clock.left() is None
