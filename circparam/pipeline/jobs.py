"""Worker processes for an unwrap: started as soon as the work is known to be worth the start."""

import os
import time

from circparam.core import workers
from circparam.core.monitor import Listener, Monitor
from circparam.pipeline.options import Options

# modules that workers import, in the order of need
MODULES = (
    "circparam.seams.charts",
    "circparam.packing.nest.strategy",
    "circparam.pipeline.fuller_page",
)
# Faces from which a process pays: its start costs 0.04 s here and takes 0.3 s, half of the work on 600 faces.
# Planning cuts takes as long for few faces as for many. A draft shares only what is done in parts.
FACES = 700
FACE_BYTES = 57  # a face in a file of text, at least; more in binary


def monitor_of(options: Options, listener: Listener | None, since: float | None = None) -> Monitor:
    """The monitor of a run with these options. since: moment of ``time.monotonic`` from which time counts."""
    monitor = Monitor(listener, options.timeout, options.processes)
    if monitor.deadline is not None and since is not None:
        monitor.deadline -= time.monotonic() - since
    return monitor


def start_for_file(options: Options, path: str) -> None:
    """Start workers before a file is read, and NumPy with it, where its size tells that they will be needed."""
    if os.path.isfile(path):
        start_for(options, os.path.getsize(path) // FACE_BYTES)


def start_for(options: Options, faces: int) -> None:
    """Start workers for a mesh of so many faces, if the work is worth it and no workers exist.

    They are as many as asked for, at most the number of cores.
    """
    if options.cut == "charts" and faces >= (workers.PARTED_FACES if options.draft else FACES):
        workers.start(min(options.processes, max(workers.free_cores(), 2)), *MODULES)
