"""Warnings and bars go to stderr, and nowhere where nobody would see them."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circparam
from circparam.cli import progress
from tests.support import shapes


def test_a_warning_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    progress.warn("careful")
    progress.warn("careful", quiet=True)
    assert capsys.readouterr() == ("", "circparam: warning: careful\n")
    progress.note("done so")
    progress.note("done so", quiet=True)
    assert capsys.readouterr() == ("", "circparam: note: done so\n")


def test_no_bar_without_a_terminal() -> None:
    with progress.listener("m.obj", False) as listener:
        assert isinstance(listener, progress.Status)


def test_a_bar_appears_on_a_terminal_after_the_delay(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with progress.listener("m.obj", True) as listener:
        assert isinstance(listener, progress.Status)
    clock = iter([0.0, progress.DELAY - 0.1, progress.DELAY, progress.DELAY + 1])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock, 99.0))
    with progress.listener("m.obj", False, (2, 6)) as listener:
        assert listener is not None
        listener("solve", 0.1, "")
        assert listener.bar is None  # type: ignore[attr-defined]
        listener("solve", 0.5, "half way")
        (task,) = listener.bar.tasks  # type: ignore[attr-defined]
        assert (task.fields["stage"], task.fields["note"]) == ("solve", "half way")
        assert task.description == "m.obj (2 of 6)"
        place = task.completed
        assert 0 < place < 1
        listener("read", 1.0, "")
        assert task.completed == place, "never back"
        listener("write", 1.0, "")
        assert task.completed == pytest.approx(1.0)
    assert listener.bar.finished or not listener.bar.live.is_started  # type: ignore[attr-defined]
    assert capsys.readouterr().out == ""


@given(st.lists(st.tuples(st.sampled_from([*progress.COSTS, "?"]), st.floats(-1, 2)), max_size=30))
def test_progress_never_runs_back(steps: list[tuple[str, float]]) -> None:
    forward = progress.Forward()
    told = [0.0] + [forward(*step) for step in steps]
    assert told == sorted(told)
    assert told[-1] <= 1
    names = list(progress.COSTS)
    late = max((names.index(s) for s, f in steps if s in names), default=0)
    before = sum(list(progress.COSTS.values())[:late])
    assert told[-1] * sum(progress.COSTS.values()) >= before - 1e-9, "every stage before it is done"


def test_every_stage_of_an_unwrap_has_a_cost() -> None:
    forward, heard, told = progress.Forward(), [], []

    def listen(stage: str, fraction: float, note: str) -> None:
        heard.append(stage)
        told.append(forward(stage, fraction))

    circparam.unwrap(shapes.icosphere(2), listener=listen, effort=0.01)
    assert set(heard) <= set(progress.COSTS)
    assert {"charts", "pack", "verify"} <= set(heard)
    assert told[-1] > 0.8


@pytest.mark.parametrize("costs", [progress.COSTS, progress.LARGE_COSTS])
def test_the_time_left_is_right_where_stages_take_what_they_should(
    costs: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the first fifth it is within a factor of two, also where a stage takes half as long again."""
    rng, now = np.random.default_rng(0), [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    for _ in range(20):
        now[0] = 0.0
        status = progress.Status("m.ply")
        taken = {name: cost * rng.uniform(0.7, 1.4) for name, cost in costs.items()}
        whole = sum(taken.values())
        for name, seconds in taken.items():
            for part in (0.0, 0.5):
                status(name, part, "")
                share = status.forward.fraction
                known = costs is progress.COSTS or status.forward.costs is costs
                if now[0] >= whole / 5 and known and whole - now[0] > 0.05 * whole:
                    left = now[0] * (1 - share) / share
                    assert 0.5 <= left / (whole - now[0]) <= 2
                    assert f"about {left:.0f} s left" in status.line()
                now[0] += seconds / 2


def test_no_time_is_told_before_anything_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    status = progress.Status("m.ply")
    assert "left" not in status.line()
    status("read", 0.5, "")
    assert status.line().startswith("m.ply: read, 0 % done")
    assert progress.memory() > 10**7
