"""A warm server: a process that has imported everything once, and forks for each mesh.

Started as ``python -m circparam.batch.server fork|reuse`` by ``circparam.batch.process``, it takes pickled
tasks from standard input and answers each on standard output. With ``fork`` the mesh is done by a child, which
is watched: its time, its memory, its end. With ``reuse`` (Windows, macOS) the server does it itself, and who
asked ends the server instead. When who asked is gone, child and scratch folder go too.
"""

import contextlib
import gc
import os
import pickle
import select
import shutil
import signal
import sys
import tempfile
import time
from typing import IO, Any

from circparam.batch.mesh import unwrap_one
from circparam.batch.settings import Settings
from circparam.core.memory import bound_process, resident
from circparam.core.messages import message, send

MEMORY_LOOK_SECONDS = 0.1  # seconds between two looks at the memory of a child
PARENT_DEATH = 1  # PR_SET_PDEATHSIG


def warm_up() -> None:
    """Import all that an unwrap imports on its way: a curved mesh and one with sharp edges are unwrapped."""
    import numpy as np

    from circparam.pipeline import save, summary  # noqa: F401
    from circparam.pipeline.unwrap import unwrap

    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 2, 12), np.linspace(0, 2, 12)))
    k = np.arange(11)
    corner = (12 * k[:, None] + k).ravel()
    quads = np.stack([corner, corner + 1, corner + 13, corner + 12], 1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    hill = np.stack([u, v, 2 * np.sin(2 * u) * np.cos(v)], 1)
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    sides = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    unwrap((hill, faces), jobs=1)
    unwrap((box, np.concatenate([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]])), jobs=1)


class Server:
    """One task after the other, each in a child of its own."""

    def __init__(self, source: IO[bytes], target: IO[bytes], forks: bool) -> None:
        self.source, self.target, self.forks = source, target, forks
        self._input = source.fileno()

    def serve(self) -> None:
        """Answer until the worker closes the pipe."""
        send(self.target, pickle.dumps("ready"))
        with contextlib.suppress(EOFError, OSError):
            while True:
                task = pickle.loads(message(self.source))
                send(self.target, pickle.dumps(self.answer(task)))

    def answer(self, task: dict[str, Any]) -> dict[str, Any]:
        """The result of a task: {"end": done | timeout | memory | signal, "answer", "peak", "seconds" ...}."""
        start = time.monotonic()
        done = {"end": "done", "peak": None}
        out = self._in_child(task) if self.forks else {**done, "answer": _work(task)}
        return {**out, "seconds": time.monotonic() - start}

    def _in_child(self, task: dict[str, Any]) -> dict[str, Any]:
        reader, writer = os.pipe()
        server = os.getpid()
        with tempfile.TemporaryFile() as log:
            pid = os.fork()
            if pid == 0:
                code = 1
                try:
                    os.close(reader)
                    _become_child(log.fileno(), task["settings"].max_memory)
                    if os.getppid() != server:  # it ended before the child had asked to end with it
                        os._exit(code)
                    data = pickle.dumps(_work(task))
                    with open(writer, "wb") as stream:
                        stream.write(data)
                    code = 0
                finally:
                    os._exit(code)
            os.close(writer)
            os.set_blocking(reader, False)
            try:
                out = self._watch(pid, reader, task["settings"], task["scratch"])
            finally:
                os.close(reader)
            log.seek(0)
            said = log.read()[-2000:].decode(errors="replace").strip().splitlines()
        return {**out, "said": said[-1] if said else ""}

    def _watch(self, pid: int, reader: int, settings: Settings, scratch: str) -> dict[str, Any]:
        """Read the output of the child until it ends, or has to be ended."""
        limit, stop = settings.max_memory, settings.hard_stop
        deadline = None if stop is None else time.monotonic() + stop
        parts: list[bytes] = []
        killed = None
        while True:
            wait = MEMORY_LOOK_SECONDS if limit else 5.0
            if deadline is not None:
                wait = min(wait, max(deadline - time.monotonic(), 0.0))
            ready, _, _ = select.select([reader, self._input], [], [], wait)
            if self._input in ready:  # no task comes while one is at work: it is the end
                _kill(pid)
                shutil.rmtree(scratch, ignore_errors=True)
                os._exit(1)
            if reader in ready:
                data = os.read(reader, 1 << 20)
                if not data:
                    break
                parts.append(data)
            if deadline is not None and time.monotonic() >= deadline:
                killed = "timeout"
            elif limit and resident(pid) > limit:
                killed = "memory"
            if killed:
                _kill(pid)
                break
        _, status, usage = os.wait4(pid, 0)
        _kill(pid, group_only=True)  # whatever it has started
        peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
        out = {"peak": peak, "cpu": usage.ru_utime + usage.ru_stime, "answer": None}
        if killed:
            return {**out, "end": killed}
        if os.WIFSIGNALED(status):
            return {**out, "end": "signal", "signal": os.WTERMSIG(status)}
        if not parts:
            return {**out, "end": "signal", "signal": 0}
        return {**out, "end": "done", "answer": pickle.loads(b"".join(parts))}


def _work(task: dict[str, Any]) -> dict[str, Any]:
    return unwrap_one(task["settings"], task["source"], task["target"], task["name"])


def _become_child(log: int, max_memory: int | None) -> None:
    """A session of its own that ends with the server; bounded memory, and the first victim when memory is
    short."""
    os.setsid()
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)
    os.dup2(log, 1)
    os.dup2(log, 2)
    if sys.platform.startswith("linux"):
        import ctypes

        ctypes.CDLL(None).prctl(PARENT_DEATH, signal.SIGKILL)
        with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as stream:
            stream.write("1000")
    bound_process("CORE", 0)
    if max_memory is not None:
        bound_process("AS", max_memory)


def _kill(pid: int, group_only: bool = False) -> None:
    with contextlib.suppress(OSError):
        os.killpg(pid, signal.SIGKILL)
    if not group_only:  # before it has made its session, there is no group yet
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)


def main() -> None:
    """Serve: standard output is for answers alone."""
    # the worker gets the signal too, and ends this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    target = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    warm_up()
    gc.collect()
    gc.freeze()  # a collection in a child would touch, and so copy, every page
    Server(sys.stdin.buffer, target, sys.argv[1:] == ["fork"]).serve()


if __name__ == "__main__":
    main()
