"""Run one function in a process of its own, to measure its seconds and peak memory.

The child reads its task from a pipe, notes its memory, runs, and notes the peak. The difference is the memory
of the function. Started as ``python -m circparam.compare.process``; nothing else uses that door.
"""

import contextlib
import importlib
import os
import pickle
import subprocess
import sys
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.memory import peak
from circparam.core.records import dataclass
from circparam.core.workers import environment
from circparam.errors import CircparamError, NoResultError, OutOfTimeError

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

    function: "module:name" of a function (arrays, settings) → (arrays, info), all of content that pickle can
    hold. seconds: the child is ended after it. Raises OutOfTimeError then, NoResultError if the child died
    without a word. An exception inside the function is no exception here: it is the ``error`` of the outcome.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "circparam.compare.process"],
            input=pickle.dumps((function, arrays, settings)),
            env=environment(), timeout=seconds, capture_output=True, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise OutOfTimeError(
            f"out of time: nothing after {seconds:g} seconds; give a longer --timeout"
        ) from error
    if done.returncode:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no message"]
        raise NoResultError(f"a process ended with code {done.returncode}: {last[0]}")
    return Outcome(*pickle.loads(done.stdout))


def here(function: str, arrays: Arrays, settings: dict[str, Any]) -> Outcome:
    """The same in this process: quicker for small work, but nothing is known of its memory."""
    try:
        return Outcome(*_function(function)(arrays, settings))
    except CircparamError as error:
        return Outcome(error=str(error))


def _function(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def _child() -> None:
    """Answer one task; standard output is for the answer alone."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    name, arrays, settings = pickle.loads(sys.stdin.buffer.read())
    function = _function(name)
    with contextlib.suppress(OSError):  # Linux resets the peak to the current memory
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    before = peak()
    error, out, info = None, {}, {}
    try:
        out, info = function(arrays, settings)
    except Exception as problem:
        error = " ".join(f"{problem}".split()) or type(problem).__name__
        info = {"kind": type(problem).__name__}
    after = peak()
    grown = None if before is None or after is None else max(after - before, 0)
    with answer:
        pickle.dump((out, info, grown, error), answer)


if __name__ == "__main__":
    _child()
