"""A second process for work in parts that do not depend on each other, such as several starts of a search.

Threads would share one interpreter lock, and a pool from the standard library would run the caller's main
module again. So the worker is a process of its own, ``python -m circparam.core.workers MODULE``, that imports
MODULE while the caller still prepares, takes pickled tasks and answers each. It changes seconds, never
results: whatever keeps it from answering, the caller does that part of the work itself.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any

import numpy as np

from circparam.core.arrays import BoolArray, IntArray
from circparam.core.monitor import Monitor

HALVED = 8_000  # from this number of faces on work is done in two halves
LENGTH = 8  # bytes that say how long what follows is


def cores() -> int:
    """Processes that may work side by side: as many as cores, and no more than OMP_NUM_THREADS says."""
    free = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else ()
    count = len(free) or os.cpu_count() or 1
    threads = os.environ.get("OMP_NUM_THREADS", "").split(",")[0]
    return min(count, int(threads)) if threads.isdigit() and int(threads) > 0 else count


def in_halves(label: IntArray) -> list[BoolArray]:
    """Faces ((m,) bool) of two sets of charts of about the same size; all in one where there are none such.

    label: (m,) chart of each face. It is for the sake of a worker, and the same whether there is one or not.
    """
    size = np.bincount(label)
    order = np.argsort(-size, kind="stable")
    # in turns by falling size: A B B A A B B A …
    first = np.isin(np.arange(len(size)) % 4, (0, 3))
    chosen = np.zeros(len(size), bool)
    chosen[order[first]] = True
    half = chosen[label]
    if len(label) < HALVED or not 0.25 < half.mean() < 0.75:
        return [np.ones(len(label), bool)]
    return [half, ~half]


def environment() -> dict[str, str]:
    """The environment, with this package importable from wherever it was imported here."""
    here = str(Path(__file__).resolve().parents[2])
    paths = [here, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


class Worker:
    """A context within which ``map`` has a second process, where there is a core for it.

    module: imported by the process as soon as it starts. worth_it: False for work too small to share.
    """

    def __init__(self, module: str, worth_it: bool = True) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        if not worth_it or cores() < 2 or getattr(sys, "frozen", False) or not sys.executable:
            return
        command = [sys.executable, "-P", "-m", "circparam.core.workers", module]
        with contextlib.suppress(OSError):
            self._process = subprocess.Popen(
                command,
                env=environment(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process, whatever it is doing."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        process.wait()

    def map(
        self, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], monitor: Monitor
    ) -> list[Any]:
        """[function(*task, monitor) for task in tasks], every second one by the process.

        function: at the top level of a module. The process has a monitor of its own with the same deadline.
        """
        results: list[Any] = [None] * len(tasks)
        theirs = list(range(1, len(tasks), 2)) if self._process is not None else []
        with ThreadPoolExecutor(1) as pool:
            answer: Future[list[Any]] | None = None
            try:
                if theirs:
                    left = None if monitor.deadline is None else monitor.deadline - time.monotonic()
                    task = pickle.dumps((function, [tasks[k] for k in theirs], left))
                    answer = pool.submit(self._ask, task)
                for k in range(len(tasks)):
                    if k not in theirs:
                        results[k] = function(*tasks[k], monitor)
                given = self._given(answer)
            except BaseException:
                self.close()  # else the pool would wait for its answer
                raise
        for k, result in zip(theirs, given, strict=False):
            results[k] = result
        for k in theirs[len(given) :]:
            results[k] = function(*tasks[k], monitor)
        return results

    def _ask(self, task: bytes) -> list[Any]:
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            raise EOFError
        # stdin stays open: its end tells the process that the caller is gone
        process.stdin.write(len(task).to_bytes(LENGTH, "little") + task)
        process.stdin.flush()
        answer: list[Any] = pickle.loads(_message(process.stdout))
        return answer

    def _given(self, answer: Future[list[Any]] | None) -> list[Any]:
        """What the process answered; nothing where it could not, and no more is asked of it then."""
        if answer is None:
            return []
        try:
            return answer.result()
        except (OSError, EOFError, ValueError, pickle.PickleError, ImportError, AttributeError):
            self.close()
            return []


def _message(stream: IO[bytes]) -> bytes:
    size = int.from_bytes(_exactly(stream, LENGTH), "little")
    return _exactly(stream, size)


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data


def _serve() -> None:
    """Answer tasks from standard input; end at once when the caller is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller hears it too, and ends this process
    source, target = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr
    for name in sys.argv[1:]:
        importlib.import_module(name)
    messages: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def listen() -> None:
        with contextlib.suppress(EOFError):
            while True:
                messages.put(_message(source))
        os._exit(1)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        function, tasks, seconds = pickle.loads(messages.get())
        answer = pickle.dumps([function(*task, Monitor(None, seconds)) for task in tasks])
        target.write(len(answer).to_bytes(LENGTH, "little") + answer)
        target.flush()


if __name__ == "__main__":
    _serve()
