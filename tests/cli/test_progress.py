"""Warnings and bars go to stderr, and nowhere where nobody would see them."""

from __future__ import annotations

import sys

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


def test_no_bar_without_a_terminal() -> None:
    with progress.listener("m.obj", False) as listener:
        assert listener is None


def test_a_bar_appears_on_a_terminal_after_the_delay(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with progress.listener("m.obj", True) as listener:
        assert listener is None
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
