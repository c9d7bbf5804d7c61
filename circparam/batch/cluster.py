"""The engine: a Dask client on a cluster of this machine, or on one that runs already."""

import contextlib
import glob
import importlib.util
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from circparam._version import __version__
from circparam.batch.store import BATCH_EXTRA
from circparam.core.files import lock
from circparam.core.messages import message
from circparam.core.pool import quiet_start
from circparam.core.workers import environment, free_cores
from circparam.errors import OptionError

ANSWER_SECONDS = 10.0  # seconds that a scheduler has for its first answer
# seconds that the last process of a cluster that was ended has to remove its semaphores
GONE_SECONDS = 2.0
YOUNG_SECONDS = 10.0  # of a folder whose lock may still come
FOLDER_PREFIX = "circparam-batch-dask-"  # how the folders of clusters on this machine begin


class LostError(Exception):
    """The scheduler has gone."""


class Cluster:
    """A context with a ``client``. workers: of a cluster on this machine; else the scheduler's address or file.

    Raises OptionError if Dask is missing, the scheduler does not answer, or a worker has another version.
    """

    def __init__(
        self,
        workers: int | None = None,
        scheduler: str | None = None,
        scheduler_file: str | None = None,
    ) -> None:
        if importlib.util.find_spec("distributed") is None:
            raise OptionError(f"circparam batch: {BATCH_EXTRA}")
        self._process: subprocess.Popen[bytes] | None = None
        self._said = b""  # the end of the cluster's standard error
        self._folder: str | None = None
        self.scheduler = scheduler_file or scheduler
        if self.scheduler is None:
            self._start(workers or free_cores())
        import distributed  # while the cluster does so, too

        # a pipe that is cut off reports an error there
        noisy = "distributed distributed.client asyncio tornado tornado.application"
        for name in noisy.split():
            logging.getLogger(name).setLevel(logging.CRITICAL)
        if scheduler_file is not None:
            try:
                scheduler = str(json.loads(Path(scheduler_file).read_bytes())["address"])
            except OSError as error:
                raise OptionError(
                    f"--scheduler-file {scheduler_file}: cannot be read ({error.strerror}): is the scheduler "
                    "running?"
                ) from None
            except (ValueError, KeyError, TypeError):
                raise OptionError(
                    f"--scheduler-file {scheduler_file}: it is not a scheduler file"
                ) from None
        try:
            address = scheduler or self._address()
            self.client = distributed.Client(
                address, name="circparam-batch", timeout=ANSWER_SECONDS, set_as_default=False
            )
            self._check_versions()
        except (OSError, ValueError, ImportError) as error:
            self.kill()
            flag = "--scheduler-file" if scheduler_file else "--scheduler"
            said = " ".join(str(error).split()) or type(error).__name__
            raise OptionError(
                f"{flag} {self.scheduler}: no answer within {ANSWER_SECONDS:g} s ({said}): "
                "is the scheduler running?"
            ) from None
        except BaseException:
            self.kill()
            raise

    def _start(self, workers: int) -> None:
        """Start a cluster on this machine, with a folder for all that it puts somewhere."""
        clear_folders()
        self._folder = tempfile.mkdtemp(prefix=FOLDER_PREFIX)
        self._lock = os.open(self._folder, os.O_RDONLY) if os.name == "posix" else None
        if self._lock is not None:
            lock(self._lock)
        places = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self._folder)
        with quiet_start():
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "circparam.batch.local", str(workers), self._folder],
                env={**environment(), **places},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        """Keep the end of the cluster's output, until its last process has ended."""
        stream = self._process.stderr if self._process is not None else None
        with contextlib.suppress(OSError, ValueError):
            while stream is not None and (part := os.read(stream.fileno(), 1 << 16)):
                self._said = (self._said + part)[-2000:]

    def _address(self) -> str:
        """The address of the cluster on this machine, as soon as it says it."""
        process = self._process
        try:
            if process is None or process.stdout is None:
                raise EOFError
            return message(process.stdout).decode()
        except EOFError:
            self._end()
            said = self._said.decode(errors="replace").strip().splitlines()
            raise OptionError(
                f"the cluster on this machine did not start: {said[-1] if said else 'no word'}"
            ) from None

    def _check_versions(self) -> None:
        """Refuse workers without circparam, or with another version."""

        def probe() -> str:  # sent by value: no module has to exist there
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

        return self.client.run_on_scheduler(executing)

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
        """End the cluster at once; a foreign cluster keeps its running tasks."""
        self._end()
        with contextlib.suppress(Exception):
            self.client.close(timeout=0.2)

    def close(self) -> None:
        """Disconnect, and end the cluster of this machine."""
        with contextlib.suppress(Exception):
            self.client.close(timeout=5)
        self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for end in (os.killpg, os.kill):  # it has no session yet when it has just begun
            with contextlib.suppress(OSError):
                end(process.pid, signal.SIGKILL)
        process.wait()
        self._listener.join(GONE_SECONDS)
        for stream in (process.stdin, process.stdout, process.stderr):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        for _ in range(10):  # a process that was ended may have begun a last file there
            shutil.rmtree(self._folder or "", ignore_errors=True)
            if not os.path.exists(self._folder or ""):
                break
            time.sleep(0.05)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def clear_folders() -> None:
    """Remove folders without a lock: their clusters were killed together with the processes that started them.

    Folders of the last seconds stay, because the lock comes a moment after the folder.
    """
    for left in glob.glob(os.path.join(glob.escape(tempfile.gettempdir()), FOLDER_PREFIX + "*")):
        with contextlib.suppress(OSError):
            handle = os.open(left, os.O_RDONLY)
            try:
                if time.time() - os.fstat(handle).st_mtime > YOUNG_SECONDS and lock(handle):
                    shutil.rmtree(left, ignore_errors=True)
            finally:
                os.close(handle)


def refuse(worker: str, found: str) -> None:
    """Raise OptionError if a worker has another version of circparam, or none."""
    if found != __version__:
        has = f"has circparam {found}" if found else "has no circparam"
        raise OptionError(
            f"the worker {worker} {has}, this is {__version__}: install the same version on both sides"
        )
