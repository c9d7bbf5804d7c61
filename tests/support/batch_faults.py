"""Meshes that do harm, tasks that fail, and small sets of files for batches; workers import this module."""

import errno
import os
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from circparam.batch.index import Item
from circparam.batch.manifest import read_lines
from circparam.batch.settings import Settings
from circparam.batch.task import do_item
from circparam.cli import exits
from circparam.pipeline.gates import Gates
from circparam.pipeline.options import Options
from tests.support import shapes
from tests.support.writers import obj

QUICK = {"method": "circle", "cut": "none", "resolution": 64, "padding": 1}


@dataclass(frozen=True)
class Poison(Gates):
    """Gates that are judged in the process of the mesh: the name of a file says what harm it does there."""

    def missed(self, report: dict[str, Any]) -> list[str]:
        name = os.path.basename(report["input"])
        if name.startswith("crash"):
            os.kill(os.getpid(), signal.SIGSEGV)
        if name.startswith("killed"):
            os.kill(os.getpid(), signal.SIGKILL)
        if name.startswith("hang"):
            signal.pause()
        if name.startswith("hungry"):
            np.ones(1 << 33)
        if name.startswith("fault"):
            raise RuntimeError("a fault of the program")
        return []


def settings(out: Path | str, gates: Gates | None = None, **keywords: Any) -> Settings:
    """Settings of a quick unwrap."""
    known = {k: keywords.pop(k) for k in ("max_memory", "extras", "fork") if k in keywords}
    options = Options(**{**QUICK, **keywords})
    return Settings(options, gates or Gates(), str(out), exits.exit_of, **known)


def write_disk(path: Path, n: int = 3) -> Path:
    """A flat square of 2 n² faces as OBJ."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(obj(*shapes.grid(n + 1, n + 1)))
    return path


def write_set(folder: Path, count: int) -> Path:
    """So many small meshes in a small tree."""
    for k in range(count):
        write_disk(folder / ("a" if k % 2 else "b") / f"m{k:03d}.obj", 2 + k % 3)
    return folder


def full_disk_item(data: bytes, item: Item) -> dict[str, Any]:
    """A task on a disk that is full as long as the file FULL lies beside the sources."""
    if not (Path(item.source).parents[1] / "FULL").exists():
        return do_item(data, item)

    def full(*_: object) -> NoReturn:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    real, os.replace = os.replace, full
    try:
        # the child has its own os.replace: what fails is putting the result in its place
        return do_item(data, item)
    finally:
        os.replace = real


def empty_item(data: bytes, item: Item) -> dict[str, Any]:
    """A task that does nothing."""
    return {
        "name": item.target, "source": item.source, "source_bytes": item.size, "status": "ok",
        "exit": 0, "attempts": item.attempt, "seconds": 0.0,
    }  # fmt: skip


def told(out: Path) -> dict[str, dict[str, Any]]:
    """Name → its only line in the manifest of a folder; more than one is a failure."""
    found = list(read_lines(out / "manifest.jsonl"))
    names = [line["name"] for line in found]
    assert len(names) == len(set(names)), "a file has several lines"
    return {line["name"]: line for line in found}


def files(out: Path) -> set[str]:
    """Names of all files under a folder but the report and the manifest."""
    own = {"manifest.jsonl", "report.html", "report.csv"}
    found = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()}
    return found - own
