"""Whether a mesh fits a bound on the memory: an estimate before the work, from measured meshes."""

from circparam.core import pool, workers
from circparam.core.memory import address_bound, address_space, claim_work_space
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError
from circparam.pipeline.options import Options

# Bytes a face at the highest point, above the memory in use after reading. Scans of 0.3 to 0.7 million faces
# took 2200 to 2300 (while charts are carried to the mesh), a mesh of floaters 1450.
UNWRAP_FACE_BYTES = 2_250
LIKELY_NEED_SHARE = 0.65  # of this need: the share below which no measured mesh succeeded
# faces from which on that is known; smaller meshes need hardly more than the libraries
KNOWN_FACES = 50_000
GIGABYTE = 1e9


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
