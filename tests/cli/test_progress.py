"""Warnings and bars go to stderr, and nowhere where nobody would see them."""

import contextlib
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circparam
from circparam.cli import progress
from tests.support import shapes
from tests.support.command_line import Terminal


def test_lines_for_people_and_none_with_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a terminal there is no bar; no time is told before anything is known."""
    for quiet in (False, True):
        progress.say("warning", "careful", quiet)
        progress.say("note", "done so", quiet)
    said = "circparam: warning: careful\ncircparam: note: done so\n"
    assert capsys.readouterr() == ("", said)
    with progress.listener("m.obj", False) as listener:
        assert isinstance(listener, progress.Status)
        assert "left" not in listener.line()
        listener("read", 0.5, "")
        assert listener.line().startswith("m.obj: read, 0 % done")
        assert float(listener.line().split()[-2]) > 10  # MB


def test_a_program_hears_each_per_cent_once(monkeypatch, capsys):
    monkeypatch.setenv("CIRCPARAM_PROGRESS", "1")
    with progress.listener("m.obj", False) as listener:
        for stage in ("read", "charts", "charts", "write"):
            for share in (0.0, 0.001, 0.5, 1.0):
                listener(stage, share, "")
    lines = capsys.readouterr().err.splitlines()
    told = [int(line.split()[2]) for line in lines]
    assert told == sorted(set(told))
    assert told[-1] >= 99
    assert all(line.startswith("circparam: progress: ") for line in lines)
    with progress.listener("m.obj", True) as listener:
        listener("write", 1.0, "")
    assert capsys.readouterr().err == ""


def test_a_bar_appears_on_a_terminal_after_the_delay(clock, capsys):
    with (
        contextlib.redirect_stderr(Terminal()),
        progress.listener("m.obj", True) as quiet,
        progress.listener("m.obj", False, (2, 6)) as listener,
    ):
        assert isinstance(quiet, progress.Status)
        clock.now = progress.DELAY_SECONDS - 0.1
        listener("solve", 0.1, "")
        assert listener.bar is None
        clock.now = progress.DELAY_SECONDS
        listener("solve", 0.5, "half way")
        (task,) = listener.bar.tasks
        assert (task.fields["stage"], task.fields["note"]) == ("solve", "half way")
        assert task.description == "m.obj (2 of 6)"
        place = task.completed
        assert 0 < place < 1
        listener("read", 1.0, "")
        assert task.completed == place, "never back"
        listener("write", 1.0, "")
        assert task.completed == pytest.approx(1.0)
    assert listener.bar.finished or not listener.bar.live.is_started
    assert capsys.readouterr().out == ""


STAGES = [name for group in progress.GROUPS for name in group]


@given(
    st.integers(1, 60),
    st.lists(st.tuples(st.sampled_from([*STAGES, "search", "?"]), st.floats(-1, 2)), max_size=30),
)
def test_progress_never_runs_back(searches: int, steps: list[tuple[str, float]]) -> None:
    forward = progress.Forward(searches)
    told = [0.0] + [forward(*step) for step in steps]
    assert told == sorted(told)
    assert told[-1] <= 1


def test_searches_say_how_many_are_done() -> None:
    heard: list[float] = []

    def listen(stage: str, fraction: float, note: str) -> None:
        if stage == "search":
            heard.append(fraction)

    circparam.unwrap(shapes.cube(1), listener=listen, effort=3, jobs=1, pack_splits=0)
    assert sorted({*heard}) == [0.0, 0.5, 1.0]


def test_what_is_told_follows_the_work() -> None:
    """By a clock that counts the calls of functions, no share of the work is told far too early."""
    calls, steps = [0], [(0, 0.0)]

    def count(frame: object, event: str, argument: object) -> None:
        calls[0] += 1

    forward, before = progress.Forward(), sys.getprofile()

    def listen(stage: str, fraction: float, note: str) -> None:
        steps.append((calls[0], forward(stage, fraction)))

    points, faces = shapes.icosphere(3)
    rough = points * (1 + 0.3 * np.sin(5 * points[:, :1]))
    circparam.unwrap((rough, faces), effort=0)  # what it imports is no part of the work
    sys.setprofile(count)
    try:
        circparam.unwrap((rough, faces), listener=listen, jobs=1)
    finally:
        sys.setprofile(before)
    work, told = np.array(steps).T
    work /= work[-1]
    assert (told - work).max() < 0.3  # packing takes a third of a run, here over half
    assert told[-1] > 0.9


@pytest.mark.parametrize("groups", [progress.GROUPS, progress.OTHER_RUNS["level"]])
def test_the_time_left_is_right_where_stages_take_what_they_should(groups, clock):
    """After the first fifth it is within a factor of two, also where a stage takes half as long again."""
    rng = np.random.default_rng(0)
    costs = {name: cost for group in groups for name, cost in group.items()}
    for _ in range(20):
        clock.now = 0.0
        status = progress.Status("m.ply")
        taken = {name: cost * rng.uniform(0.7, 1.4) for name, cost in costs.items()}
        whole = sum(taken.values())
        for name, seconds in taken.items():
            for part in (0.0, 0.5, 1.0):
                status(name, part, "")
                share = status.forward.fraction
                known = groups is progress.GROUPS or status.forward.groups is groups
                if clock.now >= whole / 5 and known and whole - clock.now > 0.05 * whole:
                    left = clock.now * (1 - share) / share
                    assert 0.5 <= left / (whole - clock.now) <= 2
                    assert f"about {left:.0f} s left" in status.line()
                clock.now += seconds / 2 if part < 1 else 0.0
