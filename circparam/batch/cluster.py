"""The engine: a Dask client on a cluster of this machine, or on one that runs already."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
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
        if importlib.util.find_spec("distributed") is None:
            raise OptionError(f"circparam batch: {EXTRA}")
        self._process: subprocess.Popen[bytes] | None = None
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by _end
        self.scheduler = scheduler_file or scheduler
        if self.scheduler is None:
            self._start(workers or cores())
        import distributed  # while the cluster does so, too

        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        if scheduler_file is not None:
            scheduler = address_in(scheduler_file)
        try:
            address = scheduler or self._address()
            self.client = distributed.Client(
                address, name="circparam-batch", timeout=ANSWER, set_as_default=False
            )
        except (OSError, ValueError, ImportError) as error:
            self._end()
            flag = "--scheduler-file" if scheduler_file else "--scheduler"
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

    def _start(self, workers: int) -> None:
        """Start a cluster on this machine."""
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "circparam.batch.local", str(workers)],
            env=environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,
        )

    def _address(self) -> str:
        """The address of the cluster on this machine, as soon as it says it."""
        process = self._process
        try:
            if process is None or process.stdout is None:
                raise EOFError
            return message(process.stdout).decode()
        except EOFError:
            self._log.seek(0)
            said = self._log.read()[-2000:].decode(errors="replace").strip().splitlines()
            self._end()
            raise OptionError(
                f"the cluster on this machine did not start: {said[-1] if said else 'no word'}"
            ) from None

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

    def running(self) -> dict[Any, float]:
        """Seconds that each task which is at work has been so, by its key; some half a second old."""

        def executing(dask_scheduler: Any) -> dict[Any, float]:
            from dask.utils import key_split

            key_split.cache_clear()  # it would remember the names of 100,000 tasks, for nothing
            out = {}
            for worker in dask_scheduler.workers.values():
                out.update({task.key: seconds for task, seconds in worker.executing.items()})
            return out

        found: dict[Any, float] = self.client.run_on_scheduler(executing)
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
        self._log.close()
        if process is None:
            return
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()


def address_in(path: str) -> str:
    """The address in a scheduler's file. Raises OptionError where there is none."""
    try:
        return str(json.loads(Path(path).read_bytes())["address"])
    except OSError as error:
        raise OptionError(
            f"--scheduler-file {path}: it can't be read ({error.strerror}): is the scheduler running?"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise OptionError(
            f"--scheduler-file {path}: it is no file that a scheduler has written"
        ) from None


def refuse(worker: str, found: str) -> None:
    """Raise OptionError where a worker has another version of circparam, or none."""
    if found != __version__:
        has = f"has circparam {found}" if found else "has no circparam"
        raise OptionError(
            f"the worker {worker} {has}, this is {__version__}: install the same version on both sides"
        )
