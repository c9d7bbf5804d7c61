"""However many processes work, and whatever happens to them, the result is the same; a bound on the memory
is judged before the work."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import threading
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam.core import workers
from circparam.core.memory import address_space
from circparam.core.monitor import Monitor
from circparam.core.pool import current
from circparam.errors import NoResultError
from circparam.pipeline import jobs
from circparam.pipeline.configure import open_source
from circparam.pipeline.options import Options
from circparam.pipeline.unwrap import unwrap_document
from tests.support import parts, shapes
from tests.support.processes import pids

QUICK: dict[str, Any] = {"effort": "draft"}
pytestmark = pytest.mark.usefixtures("no_workers_left")
ROOT = Path(__file__).parents[2]


def ready(n: int) -> None:
    """Processes that are up before there is anything to do."""
    workers.start(n, *jobs.MODULES)
    pool = current()
    pool.ready.result()


def mesh(level: int = 3) -> tuple[np.ndarray, np.ndarray]:
    p, f = shapes.icosphere(level)
    return p * (1 + 0.4 * np.sin(3 * p[:, :1])), f


def cpu_seconds(pid: int) -> float:
    """Processor time that a process has used (Linux); 0 where it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@cache
def alone() -> bytes:
    """The layout that one process makes."""
    return circparam.unwrap(mesh(), jobs=1, format="glb", **QUICK).uv.tobytes()


def assembly() -> tuple[np.ndarray, np.ndarray]:
    """A ball beside a bracket: charts that are grown, and charts that are unrolled."""
    ball, part = mesh(1), parts.bracket()
    return shapes.join(ball, (part.points + np.array([9.0, 0, 0]), part.faces))


@pytest.mark.parametrize(("made", "searches"), [(lambda: mesh(2), 2), (assembly, 1)])
def test_the_bytes_do_not_depend_on_the_number_of_processes(made: Any, searches: int) -> None:
    """Searches with their cuts for the page and prices of what is seen; processes are up before work is."""
    ready(3)
    pool = current()
    asked: dict[str, Any] = {"effort": searches, "format": "glb", "resolution": 256}
    one, shared = (circparam.unwrap(made(), jobs=jobs, **asked) for jobs in (1, 3))
    assert shared.uv.tobytes() == one.uv.tobytes()
    assert (shared.effort, shared.measures) == (one.effort, one.measures)
    assert 0 < float(one.measures["seam_visible"] or 0) < 1
    assert len(set(one.effort.costs)) == (searches if searches > 1 else 0)
    assert current() is pool is not None, "they stay for the next mesh"


UNGUARDED = """
import hashlib, os, sys
print("run", flush=True)
import circparam
from circparam.core.pool import current
from circparam.core.monitor import Monitor
from circparam.pipeline import jobs
from circparam.pipeline.configure import open_source
from circparam.pipeline.unwrap import unwrap_document
from tests.pipeline.test_jobs import QUICK, mesh
jobs.start_for(circparam.Options(jobs=2), 1000)
pool = current()
print(pool is not None and pool.ready.result() > 0)
print(hashlib.sha256(circparam.unwrap(mesh(), jobs=2, format='glb', **QUICK).uv.tobytes()).hexdigest())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="folders that cannot be written to")
def test_a_script_without_a_guard_whose_home_cannot_be_written_to(tmp_path: Path) -> None:
    """It is not run again by the processes, which work all the same; so does a number of threads of its own."""
    script, home = tmp_path / "script.py", tmp_path / "home"
    script.write_text(UNGUARDED)
    home.mkdir(mode=0o500)
    names = ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "LOKY_TEMP_FOLDER")
    own = {name: os.fspath(home / "none") for name in names}
    done = subprocess.run(
        [sys.executable, os.fspath(script)],
        env={**os.environ, **own, "OMP_NUM_THREADS": "3", "PYTHONPATH": os.fspath(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    digest = hashlib.sha256(alone()).hexdigest()
    assert done.stdout.split() == ["run", "True", digest]
    assert not any(home.iterdir())


def test_the_same_bytes_when_workers_are_killed() -> None:
    """As by a system that is out of memory: once they have something to do."""
    ready(2)
    pool = current()
    assert pool is not None
    before = {pid: cpu_seconds(pid) for pid in pids(pool)}

    def murder() -> None:
        while not over.is_set():
            for pid in before:
                if cpu_seconds(pid) > before[pid]:
                    os.kill(pid, signal.SIGKILL)
                    killed.set()
                    return
            over.wait(0.005)

    over, killed = threading.Event(), threading.Event()
    murderer = threading.Thread(target=murder)
    murderer.start()
    try:
        shared = circparam.unwrap(mesh(), jobs=2, format="glb", **QUICK)
    finally:
        over.set()
        murderer.join()
    assert killed.is_set()
    assert shared.uv.tobytes() == alone()


def test_processes_are_started_only_for_work_that_is_worth_it(tmp_path: Path) -> None:
    circparam.unwrap(shapes.cube(2), jobs=2, **QUICK)
    assert current() is None, "a small mesh"
    jobs.start_for(Options(cut="none", jobs=2), 10**6)
    jobs.start_for(Options(jobs=1), 10**6)
    assert current() is None, "nothing to share"
    file = tmp_path / "m.obj"
    least = jobs.PROCESS_FACES * jobs.FACE_BYTES
    file.write_bytes(b"#" * (least - 1))
    for path in (file, tmp_path, tmp_path / "none.obj", "-"):
        jobs.start_for_file(Options(jobs=2), os.fspath(path))
    assert current() is None
    file.write_bytes(b"#" * least)
    jobs.start_for_file(Options(jobs=2, effort="draft"), os.fspath(file))
    assert current() is None, "a draft of a small mesh hands out nothing"
    jobs.start_for_file(Options(jobs=2), os.fspath(file))
    assert current() is not None


@pytest.mark.parametrize("held", [True, False])
def test_memory_that_workers_hold_is_given_back_where_it_is_missing(held, monkeypatch):
    """Out of memory beside workers, the work is done once more without them, where they hold any."""

    def short(stage: str, *_: object) -> None:
        if stage == "repair" and monitor.jobs > 1:
            raise MemoryError

    monkeypatch.setattr(workers, "stop", lambda: held)
    document = open_source(shapes.cube(2), Options())
    monitor = Monitor(listener=short, jobs=2)
    if held:
        assert unwrap_document(document, None, Options(**QUICK), monitor).status == "ok"
        assert monitor.jobs == 1
    else:
        with pytest.raises(MemoryError):
            unwrap_document(document, None, Options(**QUICK), monitor)


FACES = 1_000_000


def judged(monkeypatch: pytest.MonkeyPatch, limit: float | None, **options: object) -> int:
    """The jobs that are left under such a bound."""
    monkeypatch.setattr(jobs, "memory_limit", lambda: limit)
    monitor = Monitor(jobs=2)
    jobs.fit_memory("scan.ply", FACES, Options(**options), monitor)
    return monitor.jobs


def test_workers_go_before_the_work_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    held, need = address_space(), jobs.UNWRAP_FACE_BYTES * FACES
    enough = 4 / 3 * (held + need)  # for a worker too, which gets a quarter
    for limit, left in ((None, 2), (1.02 * enough, 2), (0.98 * enough, 1), (held + 0.7 * need, 1)):
        assert judged(monkeypatch, limit) == left


def test_what_has_no_chance_is_refused_with_a_size_that_would_do(monkeypatch):
    with pytest.raises(NoResultError) as caught:
        judged(monkeypatch, address_space() + 0.6 * jobs.UNWRAP_FACE_BYTES * FACES)
    said = re.fullmatch(
        r"scan\.ply: 1,000,000 faces take about ([\d.]+) GB, and the bound is [\d.]+ GB: "
        r"give --max-memory ([\d.]+)G or more, or a smaller mesh",
        str(caught.value),
    )
    assert judged(monkeypatch, float(said[2]) * 1e9) == 1
    # the model knows charts alone
    assert judged(monkeypatch, 1.0, cut="none") == 2
