"""Worker processes for independent parts of work, such as several starts of a search.

The processes are those of loky, which does not run the caller's main module again and notices workers that die.
``start`` opens them in the background while the caller still reads and prepares. They stay for the next mesh,
and end when they are idle for a while or when the caller ends. The caller works too, so N jobs are N − 1
processes. Workers change seconds, never results: the division of work does not depend on them, and the caller
does the part of a worker that does not answer.
"""

import contextlib
import os
import pickle
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from circparam.core import clock
from circparam.core.memory import keeping_freed
from circparam.core.monitor import Monitor
from circparam.core.pool import Pool, current
from circparam.core.pool import start as start
from circparam.core.pool import stop as stop

if TYPE_CHECKING:
    from concurrent.futures import Future

    from circparam.core.types import BoolArray, IntArray

PARTED_FACES = 8_000  # from this number of faces on work is done in parts
PART_FACES = 4_000  # that a part has at least, if the charts allow it
MOST_PARTS = 8  # at most: more than processes, so that none waits long for the last one
LARGE_CHARTS_PER_PART = 8  # charts of more than such a part of a part are dealt out one by one
LARGE_TASK_BYTES = 16 << 20  # bytes, from which on its arrays are worth keeping for the next ones
OVERLOOKED_SECONDS = 2.0  # seconds between checks whether a process that should answer was killed
# of the faces in one part; above it the other parts are not worth a process
LARGEST_PART_SHARE = 0.9


def cores() -> int:
    """The number of processes that may work in parallel: the cores, at most OMP_NUM_THREADS."""
    count = free_cores()
    threads = os.environ.get("OMP_NUM_THREADS", "").split(",")[0]
    return min(count, int(threads)) if threads.isdigit() and int(threads) > 0 else count


def free_cores() -> int:
    """Cores that this process may use."""
    free = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else ()
    return min(len(free) or os.cpu_count() or 1, _quota())


def _quota() -> int:
    """Cores that a container may use (Linux, cgroup v2); many where nothing bounds them."""
    with contextlib.suppress(OSError, ValueError):
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").split()
        return max(1, round(int(quota) / int(period)))
    return 1 << 16


def in_parts(label: "IntArray") -> "list[BoolArray]":
    """Faces ((m,) bool) of a few sets of charts of about the same size; all in one where there are none such.

    label: (m,) chart of each face. The division serves workers and does not depend on their number. The
    largest part comes first, because parts are handed out in turn.
    """
    import numpy as np

    m = len(label)
    if m < PARTED_FACES:
        return [np.ones(m, bool)]
    n_parts = min(MOST_PARTS, m // PART_FACES)
    size = np.bincount(label)
    order = np.argsort(-size, kind="stable")
    large = int((size > m / (LARGE_CHARTS_PER_PART * n_parts)).sum())
    # small charts in turns by falling size: A B C C B A A B …
    turn = np.arange(len(size)) % (2 * n_parts)
    of_chart = np.zeros(len(size), np.int64)
    of_chart[order] = np.minimum(turn, 2 * n_parts - 1 - turn)
    # a large one, of which there are few, to the part that has least
    load = np.bincount(of_chart[order[large:]], size[order[large:]], n_parts)
    for chart in order[:large].tolist():
        of_chart[chart] = load.argmin()
        load[of_chart[chart]] += size[chart]
    if load.max() > LARGEST_PART_SHARE * m:
        return [np.ones(m, bool)]
    part = of_chart[label]
    return [part == k for k in np.argsort(-load, kind="stable") if load[k]]


def environment() -> dict[str, str]:
    """The environment, with this package importable from wherever it was imported here."""
    here = str(Path(__file__).resolve().parents[2])
    paths = [here, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def in_processes(
    function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]], monitor: Monitor
) -> list[Any]:
    """[function(*task, monitor) for task in tasks], computed in any order by any idle process.

    Up to ``monitor.jobs`` processes work, the caller included, if ``start`` has opened them. Each has its own
    monitor with the same deadline. tasks: a sequence or an iterator, whose tasks are released as soon as they
    are sent. function: at the top level of a module. The work of the caller may send tasks to idle processes.
    """
    alone = isinstance(tasks, Sequence) and len(tasks) < 2
    pool = current() if monitor.jobs > 1 and not alone else None
    if pool is None:
        return [function(*task, monitor) for task in tasks]
    try:
        return _Shared(pool, function, tasks, monitor).run()
    except BaseException:
        stop()  # else they would continue needless work
        raise


class DeferredTask:
    """A task whose result is asked for later: done meanwhile where a process is idle, else when it is asked.

    function, task, monitor: as for ``in_processes``. Of one job it is done in this process, when asked for.
    """

    def __init__(
        self, function: Callable[..., Any], task: tuple[Any, ...], monitor: Monitor
    ) -> None:
        self._function, self._task, self._monitor = function, task, monitor
        self._pool: Pool | None = None
        self._future: Future[bytes] | None = None
        self._result: tuple[Any] | None = None

    def begin(self) -> None:
        """Give the task to a process that is idle; where none is, nothing happens."""
        pool = current() if self._monitor.jobs > 1 and self._pool is None else None
        if pool is None or not pool.claim():
            return
        packed = pickle.dumps((self._function, self._task), 5)
        self._pool, self._future = pool, _submitted(pool, packed, self._monitor)
        if self._future is None:
            pool.release()
        else:
            self._future.add_done_callback(lambda _: pool.release())

    @property
    def begun(self) -> bool:
        """Whether a process has it."""
        return self._future is not None

    def result(self) -> Any:
        """The value of the function, computed there or here, once."""
        if self._result is None:
            if self._pool is not None:
                self._result = _answered(self._pool, self._future, self._monitor)
            self._result = self._result or (self._function(*self._task, self._monitor),)
        return self._result[0]


def _submitted(pool: Pool, packed: bytes, m: Monitor) -> "Future[bytes] | None":
    """A task on its way to a process; None if the pool is broken, or at the end of the interpreter."""
    try:
        return pool.executor.submit(_work, packed, m.left, clock.left())
    except Exception:
        return None


def _answered(pool: Pool, future: "Future[bytes] | None", m: Monitor) -> tuple[Any] | None:
    """The result of a process. None without one; after a failure no process is asked again."""
    from concurrent.futures import wait

    if not pool.ready.done():  # they are not even up
        if future is not None:
            future.cancel()
        return None
    with contextlib.suppress(Exception):
        if future is not None:
            while not wait([future], OVERLOOKED_SECONDS).done:
                if pool.lost and not future.done():  # killed, which loky overlooks at times
                    raise ChildProcessError
            answer = (pickle.loads(future.result()),)
            m.late |= m.expired  # the process may have stopped because time was up
            return answer
    stop()
    return None


class _Shared:
    """One call of ``in_processes``: tasks are handed out one at a time, to the caller and to the processes."""

    def __init__(
        self,
        pool: Pool,
        function: Callable[..., Any],
        tasks: Iterable[tuple[Any, ...]],
        monitor: Monitor,
    ) -> None:
        self._pool, self._function, self._monitor = pool, function, monitor
        keep = isinstance(tasks, Sequence)
        # here and now: later the caller works on the common part of tasks. It takes the first itself.
        self._tasks: list[tuple[Any, ...] | None] = []
        self._packed: list[bytes] = []
        for k, task in enumerate(tasks):
            self._tasks.append(task if keep or k == 0 else None)
            self._packed.append(pickle.dumps((function, task), 5) if k else b"")
        self._sent: dict[int, Future[bytes] | None] = {}
        self._next = 0
        self._lock = threading.RLock()

    def run(self) -> list[Any]:
        """All results; the work of processes that do not answer is done here."""
        results: list[Any] = [None] * len(self._tasks)
        own = self._take()
        for _ in range(min(self._monitor.jobs, len(results)) - 1):
            self._send()
        while own is not None:
            results[own] = self._here(own)
            own = self._take()
        for k, future in self._sent.items():
            answer = _answered(self._pool, future, self._monitor)
            self._packed[k] = b"" if answer else self._packed[k]
            results[k] = answer[0] if answer else self._here(k)
        self._tasks, self._packed = [], []  # who waits for a process holds this until there is one
        return results

    def _here(self, k: int) -> Any:
        task, self._tasks[k] = self._tasks[k], None
        if task is None:
            task = pickle.loads(self._packed[k])[1]
            self._packed[k] = b""
        return self._function(*task, self._monitor)

    def _take(self) -> int | None:
        with self._lock:
            if self._next >= len(self._tasks):
                return None
            self._next += 1
            return self._next - 1

    def _send(self, done: "Future[bytes] | None" = None) -> None:
        """Give an idle process the next task; called again when the process has answered."""
        if done is not None:
            self._pool.release()
            if done.cancelled() or done.exception() is not None:
                return
        with self._lock:
            left = self._next < len(self._tasks)
            k = self._take() if left and self._pool.claim(self._send) else None
            if k is None:
                return
            future = self._sent[k] = _submitted(self._pool, self._packed[k], self._monitor)
        if self._tasks[k] is not None:  # else it may have to be done here
            self._packed[k] = b""
        if future is not None:
            future.add_done_callback(self._send)
        else:
            self._pool.release()


def _work(packed: bytes, seconds: float | None, last: float | None) -> bytes:
    """In a worker: one task. seconds, last: until its loops stop, and until it is broken off."""
    bounded = clock.bounded(None if last is None else time.monotonic() + last)
    with keeping_freed(len(packed) > LARGE_TASK_BYTES), bounded:
        function, task = pickle.loads(packed)
        return pickle.dumps(function(*task, Monitor(None, seconds)), 5)
