"""Whole batches on a real cluster: continued, poisoned, workers, clients and schedulers killed, disks full."""

import contextlib
import itertools
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import psutil
import pytest

pytest.importorskip("distributed")

import circparam
from circparam import samples
from circparam.batch.batch import Summary, run_batch, status
from circparam.batch.manifest import encode_line
from circparam.batch.run import MOST_ATTEMPTS, BatchPlan, Hooks
from circparam.core.workers import environment
from circparam.errors import InputError, NoResultError, OptionError, OutputError
from circparam.pipeline.gates import Gates
from tests.support.batch_faults import (
    QUICK,
    Poison,
    files,
    full_disk_item,
    settings,
    told,
    write_disk,
    write_set,
)

ARGS = [part for k, v in QUICK.items() for part in (f"--{k}", str(v))]
PROGRAM = [sys.executable, "-P", "-m", "circparam", "batch"]


def batch(source: Path, out: Path, **keywords: Any) -> Summary:
    """Run a batch of quick unwraps on a worker of its own, or as the keywords say."""
    hooks = keywords.pop("hooks", None)
    given = keywords.pop("settings", None) or settings(out)
    plan = BatchPlan([str(source)], given, **{"workers": 1, **keywords})
    if {"scheduler", "scheduler_file"} & set(keywords):
        plan = replace(plan, workers=None)
    return run_batch(plan, hooks)


@cache
def alone(mesh: bytes) -> bytes:
    """The file that an unwrap on its own makes of a mesh."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "m.obj"
        path.write_bytes(mesh)
        circparam.unwrap(str(path), str(path), overwrite=True, **QUICK)
        return path.read_bytes()


def expect_quiet(source: Path, out: Path, count: int) -> None:
    """Every file has one line, and the bytes of an unwrap on its own; nothing else is there."""
    found = told(out)
    assert len(found) == count
    assert files(out) == set(found)
    for name, line in found.items():
        assert (line["status"], line["exit"]) == ("ok", 0), line
        assert (out / name).read_bytes() == alone((source / name).read_bytes())


QUIET: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
SHELL = 'mount -t tmpfs none /dev/shm && "$@"; code=$?; ls /dev/shm; exit $code'
PRIVATE = ["unshare", "--mount", "sh", "-c", SHELL]


def private_semaphores() -> list[str]:
    """What runs a command with semaphores of its own and lists them at the end, where that is allowed."""
    words = [*PRIVATE, "sh", "true"]
    if shutil.which("unshare") is None or subprocess.run(words, check=False, **QUIET).returncode:
        return []
    return [*PRIVATE, "sh"]


def test_a_batch_and_its_continuation(tmp_path: Path) -> None:
    """On a cluster of its own, which leaves nothing in temporary folders; then there is nothing to do."""
    source, out, scratch = write_set(tmp_path / "src", 3), tmp_path / "out", tmp_path / "scratch"
    scratch.mkdir()
    command = [*PROGRAM, str(source), "-o", str(out), "-q", "-j", "1", *ARGS]
    ended = subprocess.run(
        [*private_semaphores(), *command], env={**environment(), "TMPDIR": str(scratch)},
        capture_output=True, check=False, text=True,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    assert list(scratch.iterdir()) == []
    expect_quiet(source, out, 3)
    own = {"manifest.jsonl", "report.csv", "report.html"}
    assert {p.name for p in out.iterdir()} == {"a", "b", *own}
    assert status(str(out))["counts"] == {"ok": 3}
    before = (out / "manifest.jsonl").read_bytes()

    # continued: nothing to do
    again = batch(source, out)
    assert (again.done, again.skipped, again.counts) == (0, 3, {"ok": 3})
    assert (out / "manifest.jsonl").read_bytes() == before


def test_what_changed_is_done_and_a_torn_line_is_mended(shared: str, tmp_path: Path) -> None:
    source, out = write_set(tmp_path / "src", 4), tmp_path / "out"
    states: list[Any] = []
    summary = batch(source, out, scheduler=shared, hooks=Hooks(listener=states.append))
    assert (summary.done, summary.skipped, summary.finished) == (4, 0, True)
    assert states[-1].total == 4
    first = (out / "manifest.jsonl").read_bytes()
    (out / "manifest.jsonl").write_bytes(first[:-20])  # the last line is torn
    write_disk(source / "b" / "new.obj")
    notes: list[str] = []
    lines: list[dict[str, Any]] = []
    summary = batch(
        source, out, scheduler=shared, hooks=Hooks(on_line=lines.append, note=notes.append)
    )
    torn = json.loads(first.splitlines()[-1])["name"]
    assert sorted(line["name"] for line in lines) == sorted(["b/new.obj", torn])
    assert "incomplete last line" in notes[0]
    assert (summary.done, summary.skipped) == (2, 3)
    expect_quiet(source, out, 5)


def write_poison(folder: Path, good: int, each: dict[str, int]) -> Path:
    write_set(folder, good)
    for kind, count in each.items():
        for k in range(count):
            write_disk(folder / kind / f"{kind}{k}.obj")
    return folder


def write_broken(folder: Path, count: int) -> None:
    """Files that begin as meshes of the samples do, and are none."""
    folder.mkdir()
    rng, paths = random.Random(7), [samples.path(name) for name in samples.names()]
    for k, path in zip(range(count), itertools.cycle(paths)):
        data = path.read_bytes()[:3000]
        junk = (b"", data[:40], rng.randbytes(500), data.replace(b"1", b"x")[:200] + b"\0\xff")
        (folder / f"{k}{path.suffix}").write_bytes(junk[k % 4])


@pytest.mark.parametrize(
    ("good", "each", "broken"),
    [
        (4, {"crash": 1, "hang": 1, "hungry": 1}, 1),
        pytest.param(100, {"crash": 3, "hang": 2, "hungry": 2}, 20, marks=pytest.mark.slow),
    ],
)
def test_a_poisoned_set(good, each, broken, shared, tmp_path):
    source, out = write_poison(tmp_path / "src", good, each), tmp_path / "out"
    write_broken(source / "broken", broken)
    given = settings(out, Poison(), timeout=2.0, max_memory=3 << 30)
    summary = batch(source, out, scheduler=shared, settings=given)
    found = told(out)
    causes = {name: line["error"] for name, line in found.items() if line["status"] == "failed"}
    assert summary.counts == {"ok": good, "failed": len(causes)}
    assert len(causes) == broken + sum(each.values())
    said = {"crash": "SIGSEGV", "hang": "--timeout", "hungry": "memory", "broken": ""}
    for name, cause in causes.items():
        assert said[name.split("/")[0]] in cause
        assert len(cause) > 10
        assert name.split("/")[0] != "broken" or found[name]["exit"] == 3
    page = (out / "report.html").read_text()
    assert all(name in page for name in list(causes)[:5])
    assert files(out) == {n for n in found if n not in causes}


def started(pid: int, kind: str) -> list[int]:
    """Processes of a kind that a process has started."""
    with contextlib.suppress(psutil.NoSuchProcess):
        found = psutil.Process(pid).children()
        return [p.pid for p in found if any(kind in word for word in p.cmdline())]
    return []


@pytest.mark.slow
def test_a_mesh_that_is_ended_again_and_again_is_given_up(tmp_path: Path) -> None:
    source, out = write_poison(tmp_path / "src", 2, {"killed": 1}), tmp_path / "out"
    summary = batch(source, out, settings=settings(out, Poison()))
    found = told(out)
    assert summary.counts == {"ok": 2, "failed": 1}
    assert [line["attempts"] for line in found.values() if line["exit"]] == [MOST_ATTEMPTS]
    assert "SIGKILL" in str(found["killed/killed0.obj"]["error"])


class Killer:
    """Kills one worker after each of so many lines."""

    def __init__(self, after: set[int]) -> None:
        self.after, self.lines, self.killed = after, 0, 0
        self.random = random.Random(3)

    def __call__(self, line: dict[str, Any]) -> None:
        self.lines += 1
        if self.lines in self.after:
            workers = started(os.getpid(), "spawn_main")
            if workers:
                os.kill(self.random.choice(workers), signal.SIGKILL)
                self.killed += 1


@pytest.mark.parametrize(
    ("count", "after"), [(5, {1}), pytest.param(60, {5, 11, 17, 30, 44}, marks=pytest.mark.slow)]
)
def test_workers_are_killed(count: int, after: set[int], shared: str, tmp_path: Path) -> None:
    source, out = write_set(tmp_path / "src", count), tmp_path / "out"
    killer = Killer(after)
    summary = batch(source, out, scheduler=shared, hooks=Hooks(on_line=killer))
    assert killer.killed == len(after)
    assert summary.counts == {"ok": count}
    expect_quiet(source, out, count)


def start_batch(source: Path, out: Path, scratch: Path) -> subprocess.Popen[bytes]:
    scratch.mkdir(exist_ok=True)
    return subprocess.Popen(
        [*PROGRAM, str(source), "--out", str(out), *ARGS, "--workers", "1"], cwd=out.parent,
        env={**environment(), "TMPDIR": str(scratch)}, stderr=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip


def becomes(so: Callable[[], bool]) -> bool:
    """Wait until something is so; False if it is not within a minute or two."""
    pause = threading.Event()
    return any(so() or pause.wait(0.02) for _ in range(4000))


def wait_for(reached: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    """Until something is so; a process that ends before is a failure."""
    assert becomes(lambda: reached() or process.poll() is not None)
    assert reached(), process.communicate()


def has_lines(out: Path, count: int) -> bool:
    """Whether the manifest is there with so many lines."""
    return (out / "manifest.jsonl").exists() and count_lines(out) >= count


def count_lines(out: Path) -> int:
    path = out / "manifest.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


@pytest.mark.parametrize(
    "moments", [[1], pytest.param([0, 1, 7, 20, 33], marks=pytest.mark.slow)], ids=["once", "five"]
)
def test_the_client_is_killed_and_continued(moments, shared, tmp_path):
    """Its warm server ends with it."""
    count = 3 if len(moments) == 1 else 40
    source, out, scratch = write_set(tmp_path / "src", count), tmp_path / "out", tmp_path / "tmp"
    for moment in moments:
        with start_batch(source, out, scratch) as process:
            wait_for(lambda moment=moment: has_lines(out, moment), process)
            wait_for(lambda pid=process.pid: started(pid, "batch.server"), process)
            (server,) = started(process.pid, "batch.server")
            process.kill()
            process.communicate()
        assert becomes(lambda server=server: not Path(f"/proc/{server}").exists())
        assert list(scratch.iterdir()) == []
    summary = batch(source, out, scheduler=shared)
    assert summary.counts == {"ok": count}
    expect_quiet(source, out, count)


# the command line, with Ctrl-C so many times as soon as the second file of this run is done
CTRL_C = """
import os, signal, sys
from circparam.cli import batch_progress, main

times = int(sys.argv.pop(1))

class Screen(batch_progress.Screen):
    def line(self, line):
        super().line(line)
        self.lines = getattr(self, "lines", 0) + 1
        if self.lines == 2:
            for _ in range(times):
                os.kill(os.getpid(), signal.SIGINT)

batch_progress.Screen = Screen
main()
"""


def test_ctrl_c_once_and_twice(shared: str, tmp_path: Path) -> None:
    source, out = write_set(tmp_path / "src", 9), tmp_path / "out"
    seen = 0
    for times, where in ((1, ["--scheduler", shared]), (2, ["--workers", "1"])):
        command = ["-c", CTRL_C, str(times), "batch", str(source), "--out", str(out), *ARGS]
        ended = subprocess.run(
            [sys.executable, "-P", *command, *where], env=environment(), check=False,
            capture_output=True, cwd=tmp_path,
        )  # fmt: skip
        assert ended.returncode == 130, ended.stderr
        assert b"stopping" in ended.stderr
        assert b"Traceback" not in ended.stderr
        lines = count_lines(out)
        assert seen + 2 <= lines < 9
        seen = lines
        if times == 1:
            assert b"the same command continues" in ended.stderr
            assert files(out) == set(told(out))  # what ran was finished
    assert batch(source, out, scheduler=shared).counts == {"ok": 9}
    expect_quiet(source, out, 9)


@dataclass(frozen=True)
class Begun(Gates):
    """Gates that note in a folder that a mesh has been begun, and wait there for a word through a pipe."""

    folder: str = ""

    def missed(self, report: dict[str, Any]) -> list[str]:
        (Path(self.folder) / os.path.basename(report["input"])).touch()
        with open(Path(self.folder).parent / "go", "rb"):
            return []


def stopped(due: Callable[[Any], bool]) -> Hooks:
    """Hooks that ask the batch to stop as soon as its progress is ``due`` for it."""
    asks: list[Callable[[], None]] = []

    def started(ask: Callable[[], None]) -> contextlib.AbstractContextManager[None]:
        asks.append(ask)
        return contextlib.nullcontext()

    return Hooks(listener=lambda progress: asks[0]() if due(progress) else None, started=started)


def test_what_has_begun_gets_its_line_whatever_the_scheduler_knows(shared, tmp_path):
    """Workers tell the scheduler what they are at twice a second: a batch must not rely on it."""
    source, out, begun = write_set(tmp_path / "src", 12), tmp_path / "out", tmp_path / "begun"
    begun.mkdir()
    os.mkfifo(tmp_path / "go")
    pipes: list[int] = []

    def both_at_work(_: Any) -> bool:
        if pipes or len(list(begun.iterdir())) < 2:
            return False
        pipes.append(os.open(tmp_path / "go", os.O_RDWR))
        return True

    given, hooks = settings(out, Begun(folder=str(begun))), stopped(both_at_work)
    summary = batch(source, out, scheduler=shared, settings=given, hooks=hooks, last=600.0)
    os.close(pipes[0])
    assert not summary.finished
    known = {p.name for p in begun.iterdir()}
    assert {os.path.basename(name) for name in told(out)} == known
    assert {os.path.basename(name) for name in files(out)} == known
    assert 2 <= len(known) < 12


def test_a_stop_while_there_are_no_workers(lone_scheduler, tmp_path):
    source, out = write_set(tmp_path / "src", 3), tmp_path / "out"
    notes: list[str] = []

    def all_submitted(progress: Any) -> bool:
        notes.append(progress.note)
        return len(notes) == 2

    hooks = stopped(all_submitted)
    summary = batch(source, out, scheduler_file=str(lone_scheduler[1]), hooks=hooks)
    assert (summary.finished, summary.done) == (False, 0)
    assert "no workers" in notes[-1]


@contextlib.contextmanager
def ended(*command: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of Dask's command line that is ended with the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{command[0]}", *command[1:], "--no-dashboard"],
        env=environment(), **QUIET,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def lone_scheduler(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """A scheduler process of its own on the loopback, without workers: (scheduler, its file)."""
    where = tmp_path / "scheduler.json"
    place = ("--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(where))
    with ended("dask_scheduler", *place) as server:
        wait_for(where.exists, server)
        yield server, where


def test_a_scheduler_that_runs_and_then_ends(lone_scheduler, shared, tmp_path):
    server, where = lone_scheduler
    source, out = write_set(tmp_path / "src", 6), tmp_path / "out"
    place = ("--scheduler-file", str(where), "--local-directory", str(tmp_path / "w"))

    def end(line: dict[str, Any]) -> None:
        server.kill()

    with (
        ended("dask_worker", *place, "--nthreads", "2", "--no-nanny"),
        pytest.raises(NoResultError, match=r"has ended with .* not done: give the same command"),
    ):
        batch(source, out, scheduler_file=str(where), hooks=Hooks(on_line=end))
    assert count_lines(out) >= 1
    assert batch(source, out, scheduler=shared).counts == {"ok": 6}
    expect_quiet(source, out, 6)


def test_no_scheduler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source, out = write_set(tmp_path / "src", 1), tmp_path / "out"
    monkeypatch.setattr("circparam.batch.cluster.ANSWER_SECONDS", 1.0)
    with pytest.raises(OptionError, match=r"--scheduler tcp://127.0.0.1:9: no answer within 1 s"):
        batch(source, out, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(OptionError, match=r"--scheduler-file .*nowhere: cannot be read"):
        batch(source, out, scheduler_file=str(tmp_path / "nowhere"))


def test_the_disk_is_full_for_a_while(shared, tmp_path, monkeypatch):
    monkeypatch.setattr("circparam.batch.run.LOOK_SECONDS", 0.1)
    monkeypatch.setattr("circparam.batch.run.PAUSE_SECONDS", 0.1)
    source, out = write_set(tmp_path / "src", 4), tmp_path / "out"
    (source / "FULL").touch()
    notes: list[str] = []

    def listen(progress: Any) -> None:
        notes.append(progress.note)
        if notes.count("the disk is full: waiting for room") >= 2:
            (source / "FULL").unlink(missing_ok=True)

    summary = batch(
        source, out, scheduler=shared, task=full_disk_item, hooks=Hooks(listener=listen)
    )
    assert not (source / "FULL").exists()
    assert summary.counts == {"ok": 4}
    expect_quiet(source, out, 4)


def test_refused_before_any_work(tmp_path: Path) -> None:
    source, out = write_set(tmp_path / "src", 2), tmp_path / "out"
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no mesh files are there"):
        batch(tmp_path / "empty", out)
    write_disk(out / "a" / "m001.obj")
    with pytest.raises(OptionError, match="exists and no batch has written there"):
        batch(source, out)
    assert not (out / "manifest.jsonl").exists()
    (out / "manifest.jsonl").write_bytes(
        encode_line({"name": "x", "status": "ok"})
    )  # a batch's folder
    (out / "f").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        batch(source, out / "f")


def test_a_stop_does_not_wait_for_a_mesh_that_takes_long(tmp_path: Path) -> None:
    """The gate of its mesh waits for a word that never comes."""
    source, out, begun = write_set(tmp_path / "src", 3), tmp_path / "out", tmp_path / "begun"
    begun.mkdir()
    os.mkfifo(tmp_path / "go")
    given = settings(out, Begun(folder=str(begun)))
    hooks = stopped(lambda _: bool(list(begun.iterdir())))
    summary = batch(source, out, workers=1, settings=given, hooks=hooks, last=0.0)
    assert (summary.finished, summary.done) == (False, 0)
    assert files(out) == set()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="signals and sessions")
def test_a_batch_that_is_ended_leaves_nothing_either(tmp_path: Path) -> None:
    source, out, scratch = write_set(tmp_path / "src", 2), tmp_path / "out", tmp_path / "scratch"
    with start_batch(source, out, scratch) as process:
        wait_for(lambda: any(out.glob(".circparam-batch/*/*")), process)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=60)
    assert b"Traceback" not in error
    assert list(scratch.iterdir()) == []
    assert files(out) <= set(told(out))
