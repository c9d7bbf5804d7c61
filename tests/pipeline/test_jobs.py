"""However many processes work, and whatever happens to them, the result is the same."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.core import workers
from circparam.core.pool import current
from circparam.errors import OptionError
from circparam.pipeline import jobs
from circparam.pipeline.options import Options
from circparam.seams import charts
from circparam.seams.hard.regions import DOUBTFUL
from tests.support import shapes

QUICK = {"effort": 1}
ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def none_left() -> Iterator[None]:
    yield
    workers.stop()


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the functions whose tasks processes get; they are up first, however slow the machine is."""
    names: list[str] = []
    send = workers._Shared._send

    def told(self: workers._Shared, done: Future[bytes] | None = None) -> None:
        self._pool.ready.result()
        before = len(self._sent)
        send(self, done)
        names.extend([self._function.__name__] * (len(self._sent) - before))

    monkeypatch.setattr(workers._Shared, "_send", told)
    monkeypatch.setattr(jobs, "FACES", 100)
    return names


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[bool]]:
    """By the names of functions, whether tasks that are asked for later were begun when they were to be."""
    names: dict[str, list[bool]] = {}
    begin = workers.DeferredTask.begin

    def told(self: workers.DeferredTask) -> None:
        begin(self)
        names.setdefault(self._function.__name__, []).append(self.begun)

    monkeypatch.setattr(workers.DeferredTask, "begin", told)
    return names


def ready(n: int) -> None:
    """Processes that are up before there is anything to do."""
    workers.start(n, *jobs.MODULES)
    pool = current()
    assert pool is not None
    pool.ready.result()


def mesh(level: int = 3) -> tuple[np.ndarray, np.ndarray]:
    p, f = shapes.icosphere(level)
    return p * (1 + 0.4 * np.sin(3 * p[:, :1])), f


def unwrapped(source: tuple[np.ndarray, np.ndarray], folder: Path, n: int) -> bytes:
    out = folder / f"{n}.glb"
    circparam.unwrap(source, out, jobs=n, format=None, **QUICK)
    return out.read_bytes()


def test_the_same_bytes_where_a_part_of_the_charts_is_relaxed_beside(
    tmp_path: Path, sent: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "PARTED", 800)
    monkeypatch.setattr(workers, "PART_FACES", 300)
    outs = [unwrapped(mesh(), tmp_path, n) for n in (1, 2, 3, 4)]
    assert outs[0] == outs[1] == outs[2]
    assert "settle_part" in sent


def test_the_same_bytes_where_prices_and_figures_are_found_beside(
    tmp_path: Path, sent: list[str], begun: dict[str, list[bool]]
) -> None:
    """By what is seen of a mesh, for the seams of its proxy and for the report."""
    outs = [unwrapped(mesh(4), tmp_path, n) for n in (1, 2)]
    assert outs[0] == outs[1]
    # asked for at once, and again where no process has begun when the starts have merged
    assert begun["asked_beside"] == [False, False, True, True]
    assert begun["first_part"] == [True]


def test_the_same_bytes_where_a_small_mesh_is_shared(
    tmp_path: Path, sent: list[str], begun: dict[str, list[bool]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both ways to its charts, what is looked at for cuts, and those that are made."""
    monkeypatch.setattr(charts, "hardness", lambda s: np.full(len(s.faces), DOUBTFUL))
    outs = []
    for n in (1, 2, 3):
        if n > 1:
            ready(n)
        outs.append(unwrapped(mesh(), tmp_path, n))
        assert begun["one_way"] == [n > 1], "the smaller one"
        assert {"looked_at", "made_cut"} <= set(sent) or n == 1
        sent.clear()
        begun.clear()
    assert outs[0] == outs[1] == outs[2]


UNGUARDED = """
import hashlib, os, sys
print("run", flush=True)
import circparam
from circparam.core.pool import current
from circparam.pipeline import jobs
from tests.pipeline.test_jobs import QUICK, mesh
jobs.FACES = 100
jobs.start_for(circparam.Options(jobs=2), 1000)
pool = current()
print(pool is not None and pool.ready.result() > 0)
print(hashlib.sha256(circparam.unwrap(mesh(), jobs=2, **QUICK).uv.tobytes()).hexdigest())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="folders that cannot be written to")
@pytest.mark.parametrize("threads", ["1", "3"])
def test_a_script_without_a_guard_whose_home_cannot_be_written_to(
    threads: str, tmp_path: Path
) -> None:
    """It is not run again by the processes, which work all the same; so does a number of threads of its own."""
    script, home = tmp_path / "script.py", tmp_path / "home"
    script.write_text(UNGUARDED)
    home.mkdir(mode=0o500)
    names = ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "LOKY_TEMP_FOLDER")
    own = {name: os.fspath(home / "none") for name in names}
    done = subprocess.run(
        [sys.executable, os.fspath(script)],
        env={**os.environ, **own, "OMP_NUM_THREADS": threads, "PYTHONPATH": os.fspath(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    alone = circparam.unwrap(mesh(), jobs=1, **QUICK)
    digest = hashlib.sha256(alone.uv.tobytes()).hexdigest()
    assert done.stdout.split() == ["run", "True", digest]
    assert not any(home.iterdir())


def test_no_more_processes_than_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(workers, "start", lambda jobs, *_: asked.append(jobs))
    for free in (1, 2, 3, 9):
        monkeypatch.setattr(workers, "free_cores", lambda free=free: free)
        jobs.start_for(Options(jobs=4), 10**6)
    assert asked == [2, 2, 3, 4], "two where they were asked for"


def test_the_same_bytes_when_workers_are_killed(
    tmp_path: Path, sent: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a system that is out of memory: just after they were given something to do."""
    whole = unwrapped(mesh(), tmp_path, 1)
    send = workers._Shared._send
    killed = []

    def murderous(self: workers._Shared, done: Future[bytes] | None = None) -> None:
        send(self, done)
        for pid in list(self._pool.executor._processes or ()):
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    monkeypatch.setattr(workers._Shared, "_send", murderous)
    assert unwrapped(mesh(), tmp_path, 2) == whole
    assert killed


def test_processes_are_started_only_for_work_that_is_worth_it(tmp_path: Path) -> None:
    circparam.unwrap(shapes.cube(2), jobs=2, **QUICK)
    assert current() is None, "a small mesh"
    jobs.start_for(Options(cut="none", jobs=2), 10**6)
    jobs.start_for(Options(jobs=1), 10**6)
    assert current() is None, "nothing to share"
    file = tmp_path / "m.obj"
    file.write_bytes(b"#" * (jobs.BYTES - 1))
    for path in (file, tmp_path, tmp_path / "none.obj", "-"):
        jobs.start_for_file(Options(jobs=2), os.fspath(path))
    assert current() is None
    file.write_bytes(b"#" * jobs.BYTES)
    jobs.start_for_file(Options(jobs=2), os.fspath(file))
    assert current() is not None


def test_they_stay_for_the_next_mesh(sent: list[str]) -> None:
    pools = []
    for _ in range(2):
        circparam.unwrap(mesh(), jobs=2, **QUICK)
        pools.append(current())
    assert pools[0] is pools[1] is not None


@pytest.mark.parametrize("number", [0, -1, True])
def test_a_number_of_jobs_is_a_positive_one(number: object) -> None:
    with pytest.raises(OptionError, match="jobs"):
        Options(jobs=number)  # type: ignore[arg-type]


def test_all_cores_unless_something_else_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("circparam.pipeline.options.cores", lambda: 7)
    assert Options().processes == 7
    assert Options(jobs=3).processes == 3
    assert jobs.monitor_of(Options(jobs=3, timeout=9.0), None).jobs == 3
    assert "jobs" not in Options().given()


def test_memory_that_workers_hold_is_given_back_where_it_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Out of memory beside workers, the work is done once more without them."""
    from circparam.pipeline import unwrap as spine

    tries = []
    prepare = spine.prepare

    def short(*args: object) -> object:
        tries.append(args[3].jobs)  # type: ignore[attr-defined]
        if len(tries) == 1:
            raise MemoryError
        return prepare(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(spine, "prepare", short)
    monkeypatch.setattr(workers, "stop", lambda: True)
    assert circparam.unwrap(shapes.cube(2), jobs=2, **QUICK).status == "ok"
    assert tries == [2, 1]
    tries.clear()
    monkeypatch.setattr(workers, "stop", lambda: False)
    with pytest.raises(MemoryError):
        circparam.unwrap(shapes.cube(2), jobs=2, **QUICK)
