"""The worker process changes seconds, never results, and is gone when the work is over."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from circparam.core import workers
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker


def square(x: int, where: str, monitor: Monitor) -> tuple[int, int]:
    """x² and the process that found it; dies in any other process than ``where`` unless that is empty."""
    if where and str(os.getpid()) != where:
        os._exit(3)
    return x * x, os.getpid()


def deadline(monitor: Monitor) -> bool:
    return monitor.deadline is not None


@pytest.fixture(autouse=True)
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "cores", lambda: 2)


def test_every_second_task_is_done_beside() -> None:
    with Worker("tests.core.test_workers") as beside:
        got = beside.map(square, [(k, "") for k in range(5)], Monitor())
    assert [value for value, _ in got] == [0, 1, 4, 9, 16]
    own = [pid == os.getpid() for _, pid in got]
    assert own == [True, False, True, False, True]


def test_what_a_dead_helper_leaves_is_done_here() -> None:
    with Worker("tests.core.test_workers") as beside:
        got = beside.map(square, [(k, str(os.getpid())) for k in range(4)], Monitor())
    assert got == [(k * k, os.getpid()) for k in range(4)]


@pytest.mark.parametrize("why", ["one core", "small work", "no such module"])
def test_without_a_helper_all_is_done_here(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if why == "one core":
        monkeypatch.setattr(workers, "cores", lambda: 1)
    module = "no.such.module" if why == "no such module" else "tests.core.test_workers"
    with Worker(module, why != "small work") as beside:
        got = beside.map(square, [(k, "") for k in range(3)], Monitor())
    assert got == [(k * k, os.getpid()) for k in range(3)]


def test_the_helper_has_the_same_deadline() -> None:
    for seconds in (None, 100.0):
        with Worker("tests.core.test_workers") as beside:
            got = beside.map(deadline, [(), ()], Monitor(None, seconds))
        assert got == [seconds is not None] * 2


def test_the_process_ends_with_the_context() -> None:
    with Worker("tests.core.test_workers") as beside:
        process = beside._process
        assert process is not None
        assert process.poll() is None
    assert process.poll() is not None


def test_cores_are_bounded_by_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert workers.cores() == 1
    monkeypatch.setenv("OMP_NUM_THREADS", "nonsense")
    assert workers.cores() >= 1


CALLER = """
import sys, time
from circparam.core import workers
workers.cores = lambda: 2
from circparam.core.monitor import Monitor
from tests.core.test_workers import wait
beside = workers.Worker("tests.core.test_workers")
print(beside._process.pid, flush=True)
beside.map(wait, [(60.0,), (60.0,)], Monitor())
"""


def wait(seconds: float, monitor: Monitor) -> None:
    time.sleep(seconds)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_no_helper_outlives_a_killed_caller() -> None:
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        [sys.executable, "-c", CALLER], cwd=root, stdout=subprocess.PIPE, text=True
    ) as caller:
        assert caller.stdout is not None
        pid = int(caller.stdout.readline())
        caller.send_signal(signal.SIGKILL)
        caller.wait()
    end = time.monotonic() + 30
    while _runs(pid):
        assert time.monotonic() < end, "the worker goes on without its caller"
        np.random.default_rng(0).random(100_000).sort()


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not (state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] == "Z")


def test_a_helper_answers_again_and_again() -> None:
    with Worker("tests.core.test_workers") as beside:
        for x in range(3):
            (first, own), (second, other) = beside.map(square, [(x, ""), (x + 1, "")], Monitor())
            assert (first, second) == (x * x, (x + 1) ** 2)
            assert own == os.getpid() != other


def test_the_process_runs_a_module_that_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command names the module as a string, and every failure of the process is made good in silence."""
    commands: list[list[str]] = []

    def popen(command: list[str], **_: object) -> None:
        commands.append(command)
        raise OSError

    monkeypatch.setattr(subprocess, "Popen", popen)
    Worker("tests.core.test_workers").close()
    (command,) = commands
    name = command[command.index("-m") + 1]
    assert name == workers.__name__
    assert importlib.util.find_spec(name) is not None
