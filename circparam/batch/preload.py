"""For Dask's workers of a local cluster: a warm server is started with the worker, not with its first mesh."""

import sys
from typing import Any

from circparam.batch.process import start_ahead
from circparam.batch.task import do_item

__all__ = ["dask_setup", "do_item"]  # the task is imported here, too


def dask_setup(worker: Any) -> None:
    """Called by Dask in every new worker."""
    start_ahead(sys.platform.startswith("linux"))
