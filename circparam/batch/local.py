"""A Dask cluster on this machine, in a session of its own: ``python -m circparam.batch.local WORKERS FOLDER``.

A terminal's Ctrl-C does not reach it. When the process that started it ends, the cluster ends with all its
processes. The cluster prints one line on standard output: the address of its scheduler. All its files are in
FOLDER, which it removes if the process that started it no longer can.
"""

import contextlib
import logging
import os
import shutil
import signal
import sys
import threading
from multiprocessing import resource_tracker

from circparam.core.messages import send

# An ended worker is started again. Its tasks go to other workers this many times before they count as failed,
# and then the batch itself tries them again.
CONFIG = {
    "distributed.scheduler.allowed-failures": 10,
    "distributed.worker.preload": ["circparam.batch.preload"],
    "distributed.worker.profile.enabled": False,
    # Dask keeps data of past tasks for its dashboard, which is not used here
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 100,
    "distributed.admin.system-monitor.log-length": 10,
    # health checks of event loops and machines, which nobody reads either, cost 6 % of a core at rest
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.terminate": False,  # a mesh has its own bound, --max-memory
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.target": False,
}


def main() -> None:
    """Serve until standard input ends."""
    count, folder = int(sys.argv[1]), sys.argv[2]
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # it stays out of the session, which is killed as a whole, and removes the semaphores of the others then
    resource_tracker.ensure_running()
    os.setsid()
    target = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    import dask
    from distributed import LocalCluster

    dask.config.set({**CONFIG, "temporary-directory": folder})
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    ended = threading.Event()
    threading.Thread(target=_wait, args=(ended,), daemon=True).start()
    try:
        with LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            memory_limit=0,
            local_directory=folder,
            silence_logs=logging.CRITICAL,
        ) as cluster:
            send(target, cluster.scheduler_address.encode())
            ended.wait()
            for nanny in cluster.workers.values():  # nothing is worth waiting for
                with contextlib.suppress(Exception):
                    os.kill(nanny.pid, signal.SIGKILL)
            threading.Timer(5.0, _all_of_it, (folder,)).start()
    finally:  # also if the reader of the address has ended
        _all_of_it(folder)


def _all_of_it(folder: str) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    os.killpg(0, signal.SIGKILL)


def _wait(ended: threading.Event) -> None:
    with contextlib.suppress(OSError):
        while os.read(0, 4096):
            pass
    ended.set()


if __name__ == "__main__":
    main()
