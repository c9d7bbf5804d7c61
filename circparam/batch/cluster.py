"""The engine: a Dask client on a cluster of this machine, or on one that runs already."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import sys
import tempfile
from typing import Any

from circparam._version import __version__
from circparam.batch.store import EXTRA
from circparam.core.messages import message
from circparam.core.workers import environment
from circparam.errors import OptionError

ANSWER = 10.0  # seconds that a scheduler has for its first answer


class LostError(Exception):
    """The scheduler has gone."""


def cores() -> int:
    """Cores that this process may use."""
    free = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else ()
    return len(free) or os.cpu_count() or 1


class Cluster:
    """A context with a ``client``. workers: of a cluster on this machine; else the scheduler's address or file.

    Raises OptionError where Dask is missing, the scheduler does not answer, or a worker has another version.
    """

    def __init__(
        self,
        workers: int | None = None,
        scheduler: str | None = None,
        scheduler_file: str | None = None,
    ) -> None:
        try:
            import distributed
        except ImportError:
            raise OptionError(f"circparam batch: {EXTRA}") from None
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        self._process: subprocess.Popen[bytes] | None = None
        self.scheduler = scheduler or scheduler_file
        known: dict[str, Any] = {"timeout": ANSWER, "set_as_default": False}
        try:
            if self.scheduler is None:
                known["address"] = self._start(workers or cores())
            elif scheduler is not None:
                known["address"] = scheduler
            else:
                known["scheduler_file"] = scheduler_file
            self.client = distributed.Client(name="circparam-batch", **known)
        except (OSError, ValueError, ImportError) as error:
            self._end()
            flag = "--scheduler" if scheduler else "--scheduler-file"
            said = " ".join(str(error).split()) or type(error).__name__
            raise OptionError(
                f"{flag} {self.scheduler}: no answer within {ANSWER:g} s ({said}): is the scheduler running?"
            ) from None
        except BaseException:
            self._end()
            raise
        try:
            self._check_versions()
        except BaseException:
            self.kill()
            raise

    def _start(self, workers: int) -> str:
        """Start a cluster on this machine; returns its address."""
        with tempfile.TemporaryFile() as log:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "circparam.batch.local", str(workers)],
                env=environment(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,
            )
            self._process = process
            try:
                if process.stdout is None:
                    raise EOFError
                return message(process.stdout).decode()
            except EOFError:
                log.seek(0)
                said = log.read()[-2000:].decode(errors="replace").strip().splitlines()[-1:] or [
                    "no word"
                ]
                self._end()
                raise OptionError(f"the cluster on this machine did not start: {said[0]}") from None

    def _check_versions(self) -> None:
        """Refuse workers without circparam, or with another version of it."""

        def probe() -> str:  # travels by value: nothing of it has to be there
            try:
                from circparam._version import __version__ as found
            except ImportError:
                return ""
            return str(found)

        for worker, found in self.client.run(probe, on_error="ignore").items():
            refuse(worker, found)

    def running(self) -> dict[str, float]:
        """Seconds that each task which is at work has been so, by its key; some half a second old."""

        def executing(dask_scheduler: Any) -> dict[str, float]:
            out = {}
            for worker in dask_scheduler.workers.values():
                out.update({task.key: seconds for task, seconds in worker.executing.items()})
            return out

        found: dict[str, float] = self.client.run_on_scheduler(executing)
        return found

    def threads(self) -> int:
        """Tasks that can be at work at one time."""
        return sum(self.client.nthreads().values())

    @property
    def alive(self) -> bool:
        """Whether the scheduler is there."""
        if self._process is not None and self._process.poll() is not None:
            return False
        return bool(self.client.status == "running")

    def kill(self) -> None:
        """End it at once; what ran on a cluster that was there before is left to it."""
        self._end()
        with contextlib.suppress(Exception):
            self.client.close(timeout=0.2)

    def close(self) -> None:
        """Say good-bye, and end the cluster of this machine."""
        with contextlib.suppress(Exception):
            self.client.close(timeout=5)
        self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()


def refuse(worker: str, found: str) -> None:
    """Raise OptionError where a worker has another version of circparam, or none."""
    if found != __version__:
        has = f"has circparam {found}" if found else "has no circparam"
        raise OptionError(
            f"the worker {worker} {has}, this is {__version__}: install the same version on both sides"
        )
