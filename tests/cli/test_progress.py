"""Warnings and bars go to stderr, and nowhere where nobody would see them."""

from __future__ import annotations

import sys

import pytest

from circparam.cli import progress


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
    with progress.listener("m.obj", False) as listener:
        assert listener is not None
        listener("solve", 0.1, "")
        assert listener.bar is None  # type: ignore[attr-defined]
        listener("solve", 0.5, "half way")
        (task,) = listener.bar.tasks  # type: ignore[attr-defined]
        assert (task.completed, task.fields["stage"], task.fields["note"]) == (
            0.5,
            "solve",
            "half way",
        )
    assert listener.bar.finished or not listener.bar.live.is_started  # type: ignore[attr-defined]
    assert capsys.readouterr().out == ""
