"""Warm servers inside a worker: one for each thread that asks, started when the first mesh comes."""

import atexit
import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from circparam.core.memory import resident
from circparam.core.messages import message, send
from circparam.core.pool import ONE_THREAD
from circparam.core.workers import environment

START_SECONDS = 120.0  # seconds that a server may take to import everything
REPORT_SECONDS = 30.0  # seconds that a server has, after the hard stop of a mesh, to report it
TICK_SECONDS = 0.1
_SERVERS: "list[WarmServer]" = []
_LOCK = threading.Lock()


class GoneError(Exception):
    """The server has ended, or does not answer: not the fault of the mesh, as far as is known."""


def server_environment() -> dict[str, str]:
    """The environment of a server: one thread, and the default memory settings of the C library.

    Dask has its workers return freed memory from 64 KiB on. Every array would then be paged in anew, which took
    a third of the time of a mesh.
    """
    return {k: v for k, v in environment().items() if k != "MALLOC_TRIM_THRESHOLD_"} | ONE_THREAD


class WarmServer:
    """One warm server process."""

    def __init__(self, forks: bool) -> None:
        self.forks, self.busy = forks, True
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "circparam.batch.server", "fork" if forks else "reuse"],
            env=server_environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is not for it
        )
        _SERVERS.append(self)
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()
        self._answer(time.monotonic() + START_SECONDS, None)

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def ask(self, task: dict[str, Any], stop: float | None, limit: int | None) -> dict[str, Any]:
        """The result of a mesh (see ``Server.answer``). stop: seconds, limit: bytes, where it is reused.

        Raises GoneError.
        """
        start = time.monotonic()
        if self._process.stdin is None:
            raise GoneError
        try:
            send(self._process.stdin, pickle.dumps(task))
        except OSError:
            raise GoneError from None
        deadline = None if stop is None else start + stop + (REPORT_SECONDS if self.forks else 0.0)
        end = self._answer(deadline, None if self.forks else limit)
        if isinstance(end, dict):
            return end
        self.close()
        if self.forks:
            raise GoneError
        return {"end": end, "answer": None, "peak": None, "seconds": time.monotonic() - start}

    def _answer(self, deadline: float | None, limit: int | None) -> Any:
        """The next answer; 'timeout' or 'memory' where a bound was crossed. Raises GoneError."""
        while True:
            try:
                answer = self._answers.get(timeout=TICK_SECONDS if limit or deadline else None)
            except queue.Empty:
                if deadline is not None and time.monotonic() >= deadline:
                    return "timeout"
                if limit and resident(self.pid) > limit:
                    return "memory"
                continue
            if answer is None:
                raise GoneError
            return answer

    def _listen(self) -> None:
        stream = self._process.stdout
        with contextlib.suppress(EOFError, OSError, ValueError, pickle.PickleError):
            while stream is not None:
                self._answers.put(pickle.loads(message(stream)))
        self._answers.put(None)

    def close(self) -> None:
        """End the server, and its current mesh."""
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()  # a server with a child ends that first
        try:
            self._process.wait(0.0 if not self.forks else 1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


@contextlib.contextmanager
def warm_server(forks: bool) -> Iterator[WarmServer]:
    """A free server, started where there is none; a server that has ended is not used again."""
    with _LOCK:
        _SERVERS[:] = [s for s in _SERVERS if s.alive]
        server = next((s for s in _SERVERS if s.forks == forks and not s.busy), None)
        if server is not None:
            server.busy = True
    server = server or WarmServer(forks)
    try:
        yield server
    finally:
        server.busy = False


def close_servers() -> None:
    """End all servers, and the meshes that they are at."""
    for server in _SERVERS:
        server.close()


atexit.register(close_servers)
if hasattr(os, "register_at_fork"):  # a fork of the worker does not share its servers
    os.register_at_fork(after_in_child=_SERVERS.clear)
