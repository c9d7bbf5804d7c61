"""Worker processes change seconds, never results, and are gone when the work is over."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.core import pool as pool_module
from circparam.core import workers
from circparam.core.monitor import Monitor
from circparam.core.pool import Pool, current
from circparam.core.workers import DeferredTask, in_processes
from tests.support.processes import ROOT, pids, printed

HERE = "tests.core.test_workers"
pytestmark = pytest.mark.usefixtures("no_workers_left")


def square(x: int, where: str, monitor: Monitor) -> tuple[int, int]:
    """x² and the process that found it; dies in any other process than ``where`` unless that is empty."""
    if where and str(os.getpid()) != where:
        os.kill(os.getpid(), signal.SIGKILL)
    return x * x, os.getpid()


def fail(where: int, error: type[Exception], monitor: Monitor) -> int:
    if os.getpid() != where:
        raise error
    return where


def surroundings(monitor: Monitor) -> tuple[bool, str, str, bool, int]:
    """Whether time is bounded, threads, __main__'s file, whether there may be further workers, the process."""
    main = str(getattr(sys.modules["__main__"], "__file__", ""))
    threads, bounded = os.environ["OMP_NUM_THREADS"], monitor.deadline is not None
    return bounded, threads, main, pool_module.possible(), os.getpid()


def opened(jobs: int = 2, module: str = HERE) -> Pool:
    """Workers that are up, so that they get tasks however slow the machine is."""
    workers.start(jobs, module)
    pool = current()
    pool.ready.result()
    return pool


def until_gone(left: list[int]) -> None:
    """Until none of some processes runs; they have a minute."""
    end = time.monotonic() + 60
    while any(_runs(pid) for pid in left):
        assert time.monotonic() < end, "a worker goes on without its caller"
        np.random.default_rng(0).random(100_000).sort()


def test_tasks_are_done_here_and_beside_in_order_by_so_many() -> None:
    pool = opened(3)
    for jobs in (1, 3):
        got = in_processes(square, [(k, "") for k in range(7)], Monitor(jobs=jobs))
        assert [value for value, _ in got] == [k * k for k in range(7)]
        found = {pid for _, pid in got}
        assert os.getpid() in found
        assert found - {os.getpid()} <= set(pids(pool))
        assert (len(found) > 1) == (jobs > 1)
    for fewer in (1, 2, 3):
        workers.start(fewer, HERE)
        assert current() is pool, "as many, or more than enough, stay"
    assert opened(4, "no.such.module") is not pool
    assert in_processes(square, [(k, "") for k in range(3)], Monitor(jobs=2))[2][0] == 4


def test_what_is_asked_for_later_is_done_meanwhile_where_a_process_is_idle() -> None:
    pool = opened(2)
    first, second = (DeferredTask(square, (k, ""), Monitor(jobs=2)) for k in (3, 4))
    first.begin()
    assert pool.free == 0
    second.begin()  # none is idle: nothing happens
    assert (first.begun, second.begun) == (True, False)
    assert first.result()[0] == 9
    assert first.result()[1] in pids(pool)
    assert first.begun
    assert first.result() is first.result()
    assert second.result() == (16, os.getpid())
    alone = DeferredTask(square, (5, ""), Monitor(jobs=1))
    alone.begin()
    assert alone.result() == (25, os.getpid())
    lost = DeferredTask(square, (6, str(os.getpid())), Monitor(jobs=2))  # dies in the process
    while pool.free < 1:
        os.sched_yield()
    lost.begin()
    assert lost.result() == (36, os.getpid())
    assert current() is None


@pytest.mark.parametrize("seconds", [-1.0, 1000.0])
def test_what_a_process_was_too_late_for_is_known_here(seconds: float) -> None:
    opened(2)
    monitor = Monitor(None, seconds, 2)
    later = DeferredTask(square, (3, ""), monitor)
    later.begin()
    assert not monitor.late
    later.result()
    assert monitor.late is (seconds < 0)
    monitor = Monitor(None, seconds, 2)
    got = in_processes(square, [(1, ""), (2, "")], monitor)
    assert got[1][1] != os.getpid()
    assert monitor.late is (seconds < 0)


@pytest.mark.parametrize("when", ["at work", "at work one by one", "idle"])
def test_what_a_dead_worker_leaves_is_done_here_and_the_next_mesh_has_new_ones(when: str) -> None:
    pool, here = opened(), os.getpid()
    if when == "idle":
        for pid in pids(pool):
            os.kill(pid, signal.SIGKILL)
    tasks = [(k, "" if when == "idle" else str(here)) for k in range(4)]
    for _ in range(2):  # the second time there is no worker any more
        given = iter(tasks) if "one" in when else tasks  # tasks of an iterator are not kept
        assert in_processes(square, given, Monitor(jobs=2)) == [(k * k, here) for k in range(4)]
    assert current() is None
    opened()
    (_, own), (_, other) = in_processes(square, [(1, ""), (2, "")], Monitor(jobs=2))
    assert own == here != other


@pytest.mark.parametrize("error", [MemoryError, TimeoutError])
def test_what_fails_in_a_worker_is_done_here(error: type[Exception]) -> None:
    """Out of memory there says nothing of this process; an error that is one is raised here as well."""
    opened()
    assert in_processes(fail, [(os.getpid(), error)] * 2, Monitor(jobs=2)) == [os.getpid()] * 2
    opened()
    with pytest.raises(error):
        in_processes(fail, [(0, error)] * 2, Monitor(jobs=2))
    assert current() is None


@pytest.mark.parametrize(
    "why",
    ["sys.frozen = True", "sys.executable = '/opt/modeller/modeller'", "os.environ[INSIDE] = '1'"],
)
def test_where_no_worker_can_be_had_all_is_done_here(why: str) -> None:
    """In a frozen program, in another program, inside a worker."""
    script = f"""
import os, sys
from circparam.core import workers
from circparam.core.pool import INSIDE, current
from circparam.core.monitor import Monitor
from {HERE} import square
{why}
workers.start(2, {HERE!r})
assert current() is None
got = workers.in_processes(square, [(k, "") for k in range(3)], Monitor(jobs=2))
assert got == [(k * k, os.getpid()) for k in range(3)]
"""
    printed(script)


def test_a_worker_has_the_same_deadline_one_thread_and_not_the_main_module(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    opened()
    for seconds in (None, 100.0):
        here, there = in_processes(surroundings, [(), ()], Monitor(None, seconds, 2))
        bounded, threads, main, further, pid = there
        assert here[0] == bounded == (seconds is not None)
        assert (threads, further) == ("1", False)
        assert "pytest" not in main
        assert pid != os.getpid()


def test_other_programs_import_the_package_from_where_it_is_here(tmp_path, monkeypatch):
    monkeypatch.delenv("PYTHONPATH", raising=False)
    words = [sys.executable, "-P", "-c", f"import {workers.__name__} as w; print(w.__file__)"]
    env = workers.environment()
    found = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == workers.__file__


@pytest.mark.skipif(sys.platform != "linux", reason="bounds on the address space")
def test_memory_is_shared_out_and_given_back() -> None:
    script = f"""
import os, resource
from circparam.core import workers
from circparam.core.pool import current
from pathlib import Path
def bound(): return resource.getrlimit(resource.RLIMIT_AS)[0]
for size in (8 << 30, 1 << 30):
    resource.setrlimit(resource.RLIMIT_AS, (size, resource.RLIM_INFINITY))
    workers.start(3, {HERE!r})
    pool = current()
    own, theirs = bound(), []
    if pool is not None:
        pool.ready.result()
        for pid in pool.executor._processes:
            text = Path(f"/proc/{{pid}}/limits").read_text()
            theirs += [line.split()[3] for line in text.splitlines() if "address" in line]
    print(size, own, *theirs[:1], workers.stop(), bound())
"""
    large, small = (line.split() for line in printed(script).splitlines())
    assert large == [str(8 << 30), str(6 << 30), str(1 << 30), "True", str(8 << 30)]
    assert small == [str(1 << 30), str(1 << 30), "False", str(1 << 30)], "too little to share"


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores can't be chosen")
def test_cores_are_those_that_are_free_and_at_most_the_threads(monkeypatch):
    every = os.sched_getaffinity(0)
    for free, threads, most in (
        ({min(every)}, None, 1), (every, None, len(every)), (every, "1", 1), (every, "nonsense", len(every)),
    ):  # fmt: skip
        monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
        if threads:
            monkeypatch.setenv("OMP_NUM_THREADS", threads)
        os.sched_setaffinity(0, free)
        try:
            assert 1 <= workers.cores() <= most
            assert workers.cores() <= workers.free_cores() <= len(free)
        finally:
            os.sched_setaffinity(0, every)


@pytest.mark.parametrize(
    ("said", "most"), [("100000 100000", 1), ("20000 100000", 1), ("max 100000", None), ("", None)]
)
def test_a_container_bounds_the_cores(said, most, monkeypatch):
    """What its control group grants (cgroup v2); all that are free where nothing is said."""
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: said)
    free = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    assert workers.free_cores() == (most or free)


@settings(max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([1, 400, 7_999, 8_000, 20_000, 70_000]),
    st.integers(1, 60),
    st.sampled_from([0.0, 1.0, 4.0]),
)
def test_parts_hold_whole_charts_each_once(seed: int, m: int, charts: int, uneven: float) -> None:
    share = np.arange(1, charts + 1.0) ** -uneven
    label = np.random.default_rng(seed).choice(charts, m, p=share / share.sum())
    parts = workers.in_parts(label)
    assert 1 <= len(parts) <= workers.MOST_PARTS
    assert [part.sum() for part in parts] == sorted((part.sum() for part in parts), reverse=True)
    assert (np.sum(parts, axis=0) == 1).all()
    for part in parts:
        assert part.any()
        assert not np.isin(label[part], label[~part]).any()
    if len(parts) > 1:
        assert m >= workers.PARTED_FACES
        assert max(part.mean() for part in parts) <= workers.LARGEST_PART_SHARE
    sizes = np.bincount(label)
    if m >= workers.MOST_PARTS * workers.PART_FACES and sizes.max() <= m / 16:
        assert len(parts) == workers.MOST_PARTS
        assert max(part.sum() for part in parts) <= m / workers.MOST_PARTS + sizes.max()


CALLER = """
import sys
from circparam.core import workers
from circparam.core.monitor import Monitor
from tests.support.processes import pids
from tests.core.test_workers import opened, wait
pool = opened()
print(*pool.executor._processes, flush=True)
if {signals}:
    from circparam.cli import signals, group
    with signals.installed():
        try:
            workers.in_processes(wait, [(60.0,), (60.0,)], Monitor(jobs=2))
        finally:
            print("over", flush=True)
workers.in_processes(wait, [(60.0,), (60.0,)], Monitor(jobs=2))
"""


def wait(seconds: float, monitor: Monitor) -> None:
    print("waiting", flush=True)
    time.sleep(seconds)


def test_busy_workers_end_when_they_are_stopped() -> None:
    pool = opened()
    left = pids(pool)
    busy = DeferredTask(wait, (90.0,), Monitor(jobs=2))
    busy.begin()
    assert busy.begun
    workers.stop()
    until_gone(left)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", ["SIGKILL", "SIGINT", "SIGTERM"])
def test_no_worker_outlives_its_caller(number: str) -> None:
    words = [sys.executable, "-c", CALLER.format(signals=number != "SIGKILL")]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(words, cwd=ROOT, text=True, **pipes) as caller:
        pids = [int(word) for word in caller.stdout.readline().split()]
        assert caller.stdout.readline() == "waiting\n"
        caller.send_signal(getattr(signal, number))
        caller.wait()
    assert pids
    until_gone(pids)


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not (state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] == "Z")


CUT_SHORT = """
import sys, time
from circparam.core import pool
pool.start(2)
pool.current().ready.result()
pool.current().executor.submit(bytes, 300_000_000)
time.sleep(float(sys.argv[1]))
pool.stop()
"""


@pytest.mark.parametrize("seconds", ["0.02", "0.1", "0.2"])
def test_a_result_that_is_cut_short_keeps_no_program_from_ending(seconds: str) -> None:
    """A process is killed while it sends: the thread that receives must not wait for the rest."""
    printed(CUT_SHORT, seconds)
