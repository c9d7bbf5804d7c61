"""Worker processes: opened in the background, kept for the next mesh, ended with their caller."""

import contextlib
import importlib
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from dataclasses import field
from typing import TYPE_CHECKING, Any

from circparam.core.imports import put_off
from circparam.core.memory import address_bound, bound_process
from circparam.core.records import dataclass

if TYPE_CHECKING:
    from concurrent.futures import Future

MAX_PROCESSES = 4  # processes, the caller included: work is done in no more parts than that
IDLE_SECONDS = 20.0  # seconds without work after which a worker ends
# bytes of address space that a worker needs: 300 MB of them are libraries
LEAST_MEMORY_BYTES = 1 << 29
WORKER_SHARE = 4  # of a bound on the address space one such part goes to all workers together
INSIDE = "CIRCPARAM_WORKER"  # set in the environment of a worker, which starts no further ones
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# one thread each: the processes are as many as the cores. A growing worker is no leaking one.
ENVIRONMENT = {
    **ONE_THREAD,
    "PYTHONSAFEPATH": "1",
    "PYTHONFAULTHANDLER": "",
    "LOKY_MAX_MEMORY_LEAK_SIZE": "1e18",
}


@dataclass(eq=False)
class Pool:
    """The processes.

    executor: of loky. ready: done when one process has finished its imports. lifeline: the processes end when
    it closes, even if this process is killed. limit: of memory, before it was shared. free: the number of idle
    processes.
    """

    executor: Any
    ready: "Future[Any]"
    lifeline: Any
    limit: tuple[int, int] | None
    free: int
    _waiting: list[Callable[[], object]] = field(default_factory=list)
    _lock: Any = field(default_factory=threading.Lock)

    @property
    def lost(self) -> bool:
        """Whether a process has ended unexpectedly."""
        return any(p.exitcode not in (None, 0) for p in dict(self.executor._processes).values())

    def claim(self, waiting: Callable[[], object] | None = None) -> bool:
        """Whether a process has nothing to do; it is taken then, until ``release``.

        waiting: called as soon as one has, where none has now.
        """
        with self._lock:
            had = self.free > 0
            self.free -= had
            if not had and waiting is not None:
                self._waiting.append(waiting)
        return had

    def release(self) -> None:
        """Free a claimed process: waiting callers are called until one takes it."""
        with self._lock:
            self.free += 1
            asked, self._waiting = self._waiting, []
        for k, waiting in enumerate(asked):
            waiting()
            with self._lock:
                if self.free < 1:
                    self._waiting = asked[k + 1 :] + self._waiting
                    return


# what ``start`` opens: processes, or None where none could be started
_opening: "Future[Pool | None] | None" = None
_owner = 0  # the process that opens them: one that is forked from it has none
_asked = 0  # the number of jobs it was asked for
_lock = threading.Lock()


def start(jobs: int, *modules: str) -> None:
    """Open processes for a number of jobs in the background; each imports the modules.

    The first process starts before any work, the others beside it. Nothing happens if enough are open, or if
    processes cannot be started here.
    """
    from concurrent.futures import Future

    global _opening, _owner, _asked
    jobs = min(jobs, MAX_PROCESSES)
    if jobs < 2 or not possible():
        return
    opening: Future[Pool | None] = Future()
    with _lock:
        previous = _own()
        if previous is not None and _asked >= jobs:
            return
        _opening, _owner, _asked = opening, os.getpid(), jobs
    _end(previous)
    threading.Thread(target=_open, args=(jobs - 1, modules, opening), daemon=True).start()


def stop() -> bool:
    """End the processes at once, busy or not. Returns whether this process has more memory now."""
    global _opening, _asked
    with _lock:
        opening, _opening, _asked = _own(), None, 0
    return _end(opening)


def _own() -> "Future[Pool | None] | None":
    return _opening if _owner == os.getpid() else None


def possible() -> bool:
    """Whether this process can start Python processes: not from a frozen or embedding program."""
    name = os.path.basename(sys.executable or "").lower()
    frozen = getattr(sys, "frozen", False) or INSIDE in os.environ
    return not frozen and ("python" in name or "pypy" in name)


def current() -> Pool | None:
    """The processes that ``start`` has opened."""
    opening = _own()
    return None if opening is None else opening.result()


def _open(count: int, modules: tuple[str, ...], opening: "Future[Pool | None]") -> None:
    """Make the executor; where that fails, for want of /dev/shm, memory or rights, all work is done here."""
    pool = None
    try:
        with contextlib.suppress(Exception):
            pool = _new_pool(count, modules)
    finally:
        opening.set_result(pool)


def _new_pool(count: int, modules: tuple[str, ...]) -> Pool | None:
    limit = address_bound()
    share = None if limit is None else limit[0] // (WORKER_SHARE * count)
    if share is not None and share < LEAST_MEMORY_BYTES:
        return None
    with quiet_start():
        import multiprocessing

        from loky import ProcessPoolExecutor

        # loky's report on an ended worker does not help a reader: the work is done here then
        warnings.filterwarnings("ignore", category=UserWarning, module=r"loky\.")
        theirs, lifeline = multiprocessing.Pipe(duplex=False)
        executor = ProcessPoolExecutor(
            count,
            timeout=IDLE_SECONDS,
            initializer=_begin,
            initargs=(theirs, share, modules),
            env={**ENVIRONMENT, INSIDE: "1"},
        )
        ready = executor.submit(os.getpid)
    if limit is not None and share is not None:
        _bound_memory(limit[0] - count * share)
    return Pool(executor, ready, lifeline, limit, count)


def _end(opening: "Future[Pool | None] | None") -> bool:
    pool = None if opening is None else opening.result()
    if pool is None:
        return False
    pool.lifeline.close()
    for pid in list(getattr(pool.executor, "_processes", ())):  # at once, not when it next listens
        with contextlib.suppress(OSError):
            os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    with contextlib.suppress(Exception):
        # half-sent data of a killed process would block the end of the program
        pool.executor._result_queue._writer.close()
    with contextlib.suppress(Exception):
        pool.executor.shutdown(wait=False)
    if pool.limit is not None:
        _bound_memory(pool.limit[0])
    return pool.limit is not None


@contextlib.contextmanager
def quiet_start() -> Iterator[None]:
    """Processes started inside hear no Ctrl-C, and import nothing from their start folder."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    mask = getattr(signal, "pthread_sigmask", None)
    old = None if mask is None else mask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if mask is not None:
            mask(signal.SIG_SETMASK, old)
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before


def _bound_memory(size: int) -> None:
    with contextlib.suppress(OSError, ValueError):
        bound_process("AS", size)


def _begin(lifeline: Any, memory: int | None, modules: tuple[str, ...]) -> None:
    """First action of a worker: listen for the end of the caller, and import the modules of its work.

    Its output goes nowhere, since that of the caller may be the mesh.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller hears it too, and ends this process
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)

    def listen() -> None:
        with contextlib.suppress(EOFError, OSError):
            lifeline.recv_bytes()
        os._exit(1)

    threading.Thread(target=listen, daemon=True).start()
    if memory is not None:
        _bound_memory(memory)
    put_off()
    _import(*modules[:1])
    threading.Thread(target=_import, args=modules[1:], daemon=True).start()


def _import(*modules: str) -> None:
    """Import modules; where one cannot be, the tasks will report it."""
    for module in modules:
        with contextlib.suppress(ImportError):
            importlib.import_module(module)
