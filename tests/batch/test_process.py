"""One mesh in a process of its own: the bytes of ``unwrap``, and whatever harm it does stays there."""

import contextlib
import os
import pickle
import re
import signal
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam.batch.index import Item
from circparam.batch.mesh import unwrap_one
from circparam.batch.process import (
    GoneError,
    WarmServer,
    close_servers,
    server_environment,
    warm_server,
)
from circparam.batch.settings import Settings, pack_settings, settings_of
from circparam.batch.task import do_item
from circparam.core import workers
from circparam.core.messages import send
from circparam.errors import OptionError
from circparam.pipeline.options import Options
from tests.support.batch_faults import QUICK, Poison, files, settings, write_disk


@pytest.fixture(scope="module", autouse=True)
def _end_servers() -> Iterator[None]:
    yield
    close_servers()


def do(path: Path, given: Settings, name: str | None = None) -> dict[str, Any]:
    item = Item(1, str(path), name or path.name, path.stat().st_size, "mark")
    return do_item(pack_settings(replace(given, run="r")), item)


def test_the_bytes_are_those_of_unwrap(tmp_path: Path) -> None:
    mesh = write_disk(tmp_path / "m.obj")
    out = tmp_path / "out"
    extras = {"map": "{}.npz", "export-seams": "seams/{}.txt", "preview": "{}.png"}
    line = do(mesh, settings(out, extras=extras), "x/m.obj")
    circparam.unwrap(str(mesh), str(tmp_path / "one.obj"), **QUICK)
    assert (out / "x" / "m.obj").read_bytes() == (tmp_path / "one.obj").read_bytes()
    assert (line["status"], line["exit"], line["error"]) == ("ok", 0, None)
    assert line["output"] == str(out / "x" / "m.obj")
    assert line["output_bytes"] == (out / "x" / "m.obj").stat().st_size
    assert line["source_hash"].startswith("sha256:")
    assert line["measures"]["faces"] == 18
    assert line["peak_memory"] > 1 << 20
    assert sorted(line["files"]) == ["seams/x/m.txt", "x/m.npz", "x/m.png"]
    written = {"x/m.obj", *line["files"]}
    assert {f for f in files(out) if f.startswith(".")} == set()
    assert files(out) == written


def test_a_server_is_used_again_and_its_child_knows_nothing_of_the_last_mesh(tmp_path):
    pids = set()
    for k in range(3):
        with warm_server(True) as server:
            pids.add(server.pid)
        assert do(write_disk(tmp_path / f"m{k}.obj", 2 + k), settings(tmp_path / "o"))["exit"] == 0
    assert len(pids) == 1


def test_a_mesh_opens_no_processes_of_its_own(tmp_path: Path) -> None:
    """A batch has a mesh at work on each core already, and --jobs is no option of it."""
    workers.stop()
    mesh = str(write_disk(tmp_path / "large.obj", 30))  # alone it would open some
    (tmp_path / "o").mkdir()
    for jobs in (None, 4):
        given = settings(tmp_path, method="isometric", cut="charts", jobs=jobs)
        out = unwrap_one(given, mesh, str(tmp_path / "o" / "m.obj"), "m.obj")
        assert (out["code"], out["error"]) == (0, None)
        assert workers.current() is None


HARM = {
    "crash.obj": (1, "crashed \\(SIGSEGV\\)", None),
    "killed.obj": (5, "ended by SIGKILL", "ended"),
    "hang.obj": (7, "ended after 1.5 s, 1.5 x --timeout", None),
    "hungry.obj": (5, "out of memory|of memory: give a larger", None),
    "fault.obj": (1, "internal error: RuntimeError: a fault of the program", None),
}


@pytest.mark.parametrize("name", HARM)
def test_harm_stays_where_it_is(name: str, tmp_path: Path) -> None:
    given = settings(tmp_path / "o", Poison(), timeout=1.0, max_memory=3 << 30)
    code, text, again = HARM[name]
    line = do(write_disk(tmp_path / name), given)
    assert (line["status"], line["exit"], line.get("again")) == ("failed", code, again)
    with contextlib.suppress(KeyError):
        assert "fault of the program" in line["trace"]
    assert re.search(text, line["error"])
    assert files(tmp_path / "o") == set()
    assert do(write_disk(tmp_path / "good.obj"), given)["status"] == "ok"


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_a_server_that_is_reused_is_ended_from_outside(tmp_path: Path) -> None:
    """What stands in for forks on Windows and macOS."""
    given = settings(tmp_path / "o", Poison(), fork=False)
    short = settings(tmp_path / "o", Poison(), fork=False, timeout=1.0)
    assert do(write_disk(tmp_path / "m.obj"), given)["status"] == "ok"
    assert do(write_disk(tmp_path / "crash.obj"), given)["again"] == "ended"
    line = do(write_disk(tmp_path / "hang.obj"), short)
    assert (line["exit"], line["status"]) == (7, "failed")
    assert files(tmp_path / "o") == {"m.obj"}


def hanging(tmp_path: Path) -> tuple[dict[str, Any], Path]:
    """A task for a server that never ends, and its scratch folder."""
    scratch = tmp_path / "s"
    scratch.mkdir()
    task: dict[str, Any] = {"settings": settings(tmp_path / "o", Poison()), "name": "hang.obj"}
    task["source"] = str(write_disk(tmp_path / "hang.obj"))
    return task | {"target": str(scratch / "hang.obj"), "scratch": str(scratch)}, scratch


def test_a_server_that_is_killed_takes_its_child_along(tmp_path: Path) -> None:
    server, (task, _) = WarmServer(True), hanging(tmp_path)
    children = Path(f"/proc/{server.pid}/task/{server.pid}/children")
    failed: list[BaseException] = []

    def ask() -> None:
        try:
            server.ask(task, None, None)
        except GoneError as error:
            failed.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    while not (child := children.read_text().split()):  # it has been forked
        thread.join(0.05)
    os.kill(server.pid, signal.SIGKILL)
    thread.join(20)
    assert failed
    pause = threading.Event()
    assert any(not Path(f"/proc/{child[0]}").exists() or pause.wait(0.05) for _ in range(400))
    server.close()


def test_a_server_whose_worker_has_gone_cleans_up(tmp_path: Path) -> None:
    process, pause = WarmServer(True)._process, threading.Event()
    task, scratch = hanging(tmp_path)
    send(process.stdin, pickle.dumps(task))
    while not (scratch / "hang.obj").exists():
        pause.wait(0.01)
    process.stdin.close()
    assert process.wait(20) == 1
    assert not scratch.exists()


def test_another_version_is_refused(tmp_path: Path) -> None:
    given = settings(tmp_path / "o")
    line = do(write_disk(tmp_path / "m.obj"), replace(given, version="9.9"))
    assert line == {"refused": circparam.__version__, "name": "m.obj"}
    assert settings_of(pack_settings(given)).version == circparam.__version__


def test_patterns_of_further_files() -> None:
    for name in ("all.png", "/tmp/{}.png", "../{}.png"):
        with pytest.raises(OptionError, match="give a name under --out with"):
            settings("o", extras={"preview": name})


def test_the_key_is_that_of_the_bytes() -> None:
    base = settings("o")
    assert base.key() == settings("p", timeout=3.0, overwrite=True).key()
    assert base.key() != settings("o", padding=2).key()
    assert base.key() != settings("o", extras={"map": "{}.npz"}).key()
    assert base.key() != replace(base, version="9").key()
    pins = [Options(method="lscm", pins=np.full((2, 3), k)) for k in (0.0, 0.0, 1.0)]
    keys = [replace(base, options=options).key() for options in pins]
    assert keys[0] == keys[1] != keys[2]


def test_a_server_pays_no_heed_to_how_dask_wants_memory_given_back(monkeypatch):
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "65536")
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    found = server_environment()
    assert "MALLOC_TRIM_THRESHOLD_" not in found
    assert found["OMP_NUM_THREADS"] == "1"
    assert found["PATH"] == os.environ["PATH"]
