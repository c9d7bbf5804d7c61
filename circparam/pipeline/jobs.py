"""Worker processes and memory of an unwrap: whether the work is worth a start, and whether it fits a bound."""

import os
import time

from circparam.core import pool, workers
from circparam.core.memory import address_bound, address_space, claim_work_space
from circparam.core.monitor import Listener, Monitor
from circparam.errors import NoResultError
from circparam.pipeline.options import Options

# modules that workers import, in the order of need
MODULES = (
    "circparam.seams.charts",
    "circparam.packing.nest.strategy",
    "circparam.pipeline.fuller_page",
)
# Faces from which a process pays: its start costs 0.04 s here and takes 0.3 s, half of the work on 600 faces.
# Planning cuts takes as long for few faces as for many.
PROCESS_FACES = 700
# The same of a draft, which shares only what is done in parts. With a process, 20,000 faces take 0.76 s and not
# 0.53 s, 40,000 take 1.97 s and not 2.24 s.
DRAFT_PROCESS_FACES = 30_000
FACE_BYTES = 57  # a face in a file of text, at least; more in binary
# Bytes a face at the highest point, above the memory in use after reading. Scans of 0.3 to 0.7 million faces
# took 2200 to 2300 (while charts are carried to the mesh), a mesh of floaters 1450.
UNWRAP_FACE_BYTES = 2_250
LIKELY_NEED_SHARE = 0.65  # of this need: the share below which no measured mesh succeeded
# faces from which on that is known; smaller meshes need hardly more than the libraries
KNOWN_FACES = 50_000
GIGABYTE = 1e9


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
    least = DRAFT_PROCESS_FACES if options.draft else PROCESS_FACES
    if options.cut == "charts" and faces >= least:
        workers.start(min(options.processes, max(workers.free_cores(), 2)), *MODULES)


def memory_limit() -> int | None:
    """Bytes of address space that this process and its workers may have; None if nothing bounds them."""
    current = pool.current()
    bound = address_bound() if current is None or current.limit is None else current.limit
    return None if bound is None else bound[0]


def fit_memory(name: str, faces: int, options: Options, monitor: Monitor) -> None:
    """Do without workers where the memory is not enough for them too; the libraries take their work space.

    Raises NoResultError with the memory needed if a mesh of so many faces cannot fit the bound.
    """
    limit = memory_limit()
    if limit is None:
        return
    if options.cut == "charts" and faces >= KNOWN_FACES:
        held = address_space()
        need = held + UNWRAP_FACE_BYTES * faces
        if limit < held + LIKELY_NEED_SHARE * UNWRAP_FACE_BYTES * faces:
            wanted = need / GIGABYTE
            raise NoResultError(
                f"{name}: {faces:,} faces take about {wanted:.1f} GB, and the bound is "
                f"{limit / GIGABYTE:.1f} GB: give --max-memory {wanted + 0.1:.1f}G or more, or a smaller mesh"
            )
        if limit < need * pool.WORKER_SHARE / (pool.WORKER_SHARE - 1):
            workers.stop()  # this process needs the memory of the workers
            monitor.jobs = 1
    claim_work_space()
