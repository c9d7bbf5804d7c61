"""Run one function in a process of its own, to measure its seconds and peak memory.

The child reads its arrays, notes its memory, runs, and notes the peak. The difference is the memory of the
function. Started as ``python -m circparam.compare.process FOLDER``; nothing else uses that door.
"""

import contextlib
import importlib
import json
import subprocess
import sys
import tempfile
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.memory import peak
from circparam.core.records import dataclass
from circparam.core.workers import environment
from circparam.errors import CircparamError, NoResultError, OutOfTimeError, OutputError

Arrays = dict[str, np.ndarray[Any, Any]]


@dataclass(frozen=True, eq=False)
class Outcome:
    """The answer of a child. arrays and info: as the function returned them. peak_bytes: peak memory minus the
    memory after reading the input; None if the system does not report it. error: one line, or None.
    """

    arrays: Arrays = field(default_factory=dict)
    info: dict[str, Any] = field(default_factory=dict)
    peak_bytes: int | None = None
    error: str | None = None


def run(
    function: str, arrays: Arrays, settings: dict[str, Any], seconds: float | None = None
) -> Outcome:
    """Call ``function`` in a new process.

    function: "module:name" of a function (arrays, settings) → (arrays, info), both of plain content.
    arrays: handed over as they are. settings: anything JSON can hold. seconds: the child is ended after it.
    Raises OutOfTimeError then, NoResultError if the child died without a word. An exception inside the
    function is no exception here: it is the ``error`` of the outcome.
    """
    with tempfile.TemporaryDirectory(prefix="circparam-") as name:
        folder = Path(name)
        try:
            _save(folder / "input.npz", arrays)
            (folder / "task.json").write_text(json.dumps([function, settings]), encoding="utf-8")
        except OSError as error:
            raise OutputError(
                f"{folder}: the mesh cannot be handed to a process ({error.strerror or error}): "
                "name a folder with room in TMPDIR"
            ) from None
        command = [sys.executable, "-P", "-m", "circparam.compare.process", name]
        try:
            done = subprocess.run(
                command, env=environment(), timeout=seconds, capture_output=True, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise OutOfTimeError(
                f"out of time: nothing after {seconds:g} seconds; give a longer --timeout"
            ) from error
        answer = folder / "answer.json"
        if not answer.exists():
            last = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no message"]
            raise NoResultError(f"a process ended with code {done.returncode}: {last[0]}")
        said = json.loads(answer.read_text(encoding="utf-8"))
        out = _load(folder / "output.npz") if said["error"] is None else {}
    return Outcome(out, said["info"], said["peak_bytes"], said["error"])


def here(function: str, arrays: Arrays, settings: dict[str, Any]) -> Outcome:
    """The same in this process: quicker for small work, but nothing is known of its memory."""
    module, name = function.split(":")
    call = getattr(importlib.import_module(module), name)
    try:
        out, info = call(arrays, settings)
    except CircparamError as error:
        return Outcome(error=str(error))
    return Outcome(out, info)


def _save(path: Path, arrays: Arrays) -> None:
    with path.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def _load(path: Path) -> Arrays:
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _child(folder: Path) -> None:
    arrays = _load(folder / "input.npz")
    function, settings = json.loads((folder / "task.json").read_text(encoding="utf-8"))
    module, name = function.split(":")
    call = getattr(importlib.import_module(module), name)
    with contextlib.suppress(OSError):  # Linux resets the peak to the current memory
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    before = peak()
    error, out, info = None, {}, {}
    try:
        out, info = call(arrays, settings)
    except Exception as problem:
        error = " ".join(f"{problem}".split()) or type(problem).__name__
        info = {"kind": type(problem).__name__}
    after = peak()
    grown = None if before is None or after is None else max(after - before, 0)
    _save(folder / "output.npz", out)
    said = {"info": info, "peak_bytes": grown, "error": error}
    (folder / "answer.json").write_text(json.dumps(said), encoding="utf-8")


if __name__ == "__main__":
    _child(Path(sys.argv[1]))
