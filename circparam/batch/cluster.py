"""The engine: a Dask client on a cluster in this process, or on one that runs already."""

import contextlib
import importlib.util
import json
import logging
import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from circparam._version import __version__
from circparam.batch.process import close_servers
from circparam.batch.store import BATCH_EXTRA
from circparam.core.workers import free_cores
from circparam.errors import OptionError

ANSWER_SECONDS = 10.0  # seconds that a scheduler has for its first answer
# For a cluster of this machine. Dask keeps data of past tasks for its dashboard, which is not used here; and a
# mesh, which is in a process of its own, has its own bound of memory
CONFIG = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.use-file-locking": False,
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 100,
    "distributed.admin.system-monitor.log-length": 10,
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.tick.interval": "1s",
}


class LostError(Exception):
    """The scheduler has gone."""


class Cluster:
    """A context with a ``client``. workers: of a cluster in this process; else the scheduler's address or file.

    folder: an existing one in which such a cluster has its files until it ends; else that of temporary files.
    Raises OptionError if Dask is missing, the scheduler does not answer, or a worker has another version.
    """

    def __init__(
        self,
        workers: int | None = None,
        scheduler: str | None = None,
        scheduler_file: str | None = None,
        folder: str | None = None,
    ) -> None:
        if importlib.util.find_spec("distributed") is None:
            raise OptionError(f"circparam batch: {BATCH_EXTRA}")
        import distributed

        # a pipe that is cut off reports an error there
        noisy = "distributed distributed.client asyncio tornado tornado.application"
        for name in noisy.split():
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._own: Any = None
        self._scratch: str | None = None  # the folder of a cluster in this process
        self.client: Any = None
        self.scheduler = scheduler_file or scheduler
        if scheduler_file is not None:
            scheduler = _address_in(scheduler_file)
        try:
            self.client = distributed.Client(
                scheduler or self._start(workers or free_cores(), folder),
                name="circparam-batch",
                timeout=ANSWER_SECONDS,
                set_as_default=False,
            )
            self._check_versions()
        except (OSError, ValueError, ImportError, RuntimeError) as error:
            self.kill()
            said = " ".join(str(error).split()) or type(error).__name__
            if self.scheduler is None:
                raise OptionError(f"the cluster on this machine did not start: {said}") from None
            flag = "--scheduler-file" if scheduler_file else "--scheduler"
            raise OptionError(
                f"{flag} {self.scheduler}: no answer within {ANSWER_SECONDS:g} s ({said}): "
                "is the scheduler running?"
            ) from None
        except BaseException:
            self.kill()
            raise

    def _start(self, workers: int, folder: str | None) -> Any:
        """A cluster in this process: its worker's threads wait for the warm servers, which do the work.

        It starts in a thread: one that a signal interrupts half way could not be closed.
        """
        self._scratch = tempfile.mkdtemp(prefix="circparam-batch-dask-", dir=folder)
        with ThreadPoolExecutor(1) as starter:
            begun = starter.submit(_local_cluster, workers, self._scratch)
            try:
                self._own = begun.result()
            except BaseException:
                with contextlib.suppress(Exception):
                    self._own = begun.result()
                raise
        return self._own

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
        return bool(self.client.status == "running")

    def kill(self) -> None:
        """End the cluster at once; a foreign cluster keeps its running tasks."""
        self.close(seconds=0.2)

    def close(self, seconds: float = 5.0) -> None:
        """Disconnect, and end the cluster of this process with all that it does."""
        with contextlib.suppress(Exception):
            self.client.close(timeout=seconds)
        if self._own is not None:
            close_servers()
            with contextlib.suppress(Exception):
                self._own.close(timeout=ANSWER_SECONDS)
            close_servers()  # those that were begun in between
        if self._scratch is not None:
            shutil.rmtree(self._scratch, ignore_errors=True)


def _local_cluster(workers: int, folder: str) -> Any:
    """Dask's cluster of one worker with so many threads, in this process, with its files in a folder."""
    import dask
    from distributed import LocalCluster

    with dask.config.set({**CONFIG, "temporary-directory": folder}):
        return LocalCluster(
            n_workers=1,
            threads_per_worker=workers,
            processes=False,
            dashboard_address=None,
            # its HTTP server has to be somewhere
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        )


def _address_in(scheduler_file: str) -> str:
    """The address in the file of a scheduler."""
    try:
        return str(json.loads(Path(scheduler_file).read_bytes())["address"])
    except OSError as error:
        raise OptionError(
            f"--scheduler-file {scheduler_file}: cannot be read ({error.strerror}): is the scheduler "
            "running?"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise OptionError(
            f"--scheduler-file {scheduler_file}: it is not a scheduler file"
        ) from None


def refuse(worker: str, found: str) -> None:
    """Raise OptionError if a worker has another version of circparam, or none."""
    if found != __version__:
        has = f"has circparam {found}" if found else "has no circparam"
        raise OptionError(
            f"the worker {worker} {has}, this is {__version__}: install the same version on both sides"
        )
