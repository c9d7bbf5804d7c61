"""One call of a function in a process of its own: for its peak memory, its crashes, or bounds on what it takes.

The child reads its task from a pipe, notes its memory, runs, and notes the peak. The difference is the memory
of the function. Started as ``python -m circparam.core.own_process``; nothing else uses that door. The answer is
JSON and arrays and never a pickle: the function may have read files that nobody has checked.
"""

import contextlib
import importlib
import io
import json
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.memory import bound_process, peak
from circparam.core.messages import message, send
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
    function: str,
    arrays: Arrays,
    settings: dict[str, Any],
    seconds: float | None = None,
    *,
    bounds: Mapping[str, int] | None = None,
    variables: Mapping[str, str] | None = None,
) -> Outcome:
    """Call ``function`` in a new process.

    function: "module:name" of a function (arrays, settings) → (arrays, info). It gets what pickle can hold, and
    its info is what JSON can hold. seconds: the child is ended after it. bounds: see ``bound_process``.
    variables: of its environment. Raises OutOfTimeError after ``seconds``, NoResultError if the child died
    without a word, OSError where it cannot be started. An exception inside the function is no exception here:
    it is the ``error`` of the outcome.
    """
    words = [f"{kind}={most}" for kind, most in (bounds or {}).items()]
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "circparam.core.own_process", *words],
            input=pickle.dumps((function, arrays, settings)),
            env={**environment(), **(variables or {})},
            timeout=seconds,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            check=False,
        )
        answer = io.BytesIO(done.stdout)
        said, packed = json.loads(message(answer)), io.BytesIO(message(answer))
    except subprocess.TimeoutExpired as error:
        raise OutOfTimeError(
            f"out of time: nothing after {seconds:g} seconds; give a longer --timeout"
        ) from error
    except EOFError:
        raise NoResultError(f"a process ended with code {done.returncode}") from None
    with np.load(packed, allow_pickle=False) as out:
        return Outcome({name: out[name] for name in out.files}, **said)


def here(function: str, arrays: Arrays, settings: dict[str, Any]) -> Outcome:
    """The same in this process: quicker for small work, but nothing is known of its memory."""
    try:
        return Outcome(*_function(function)(arrays, settings))
    except CircparamError as error:
        return Outcome(error=str(error))


def _function(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def main() -> None:
    """In the process: one task on stdin, its answer on stdout."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asks hears it too, and ends this process
    target = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # compiled code may print
    for kind, _, most in (word.partition("=") for word in sys.argv[1:]):
        with contextlib.suppress(ImportError, OSError, ValueError):
            bound_process(kind, int(most))
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
    packed = io.BytesIO()
    np.savez(packed, allow_pickle=False, **out)
    said = {"info": info, "peak_bytes": grown, "error": error}
    send(target, json.dumps(said).encode())
    send(target, packed.getvalue())


if __name__ == "__main__":
    main()
