"""The memory of a process as the system reports it, and how long freed memory is kept."""

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any

from circparam.errors import NoResultError

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # of mallopt, as malloc.h has them
# of freed arrays, and of free space at the end of the heap, that are kept
KEPT_FREED_BYTES = 1 << 30
# bytes of address space for NumPy and SciPy with the work space of their two OpenBLAS, and for each of its
# threads: with less, OpenBLAS tries without end, or ends the process
LIBRARY_BYTES, THREAD_BYTES = 250_000_000, 100_000_000
SQUARE_ROWS = 300  # rows of matrices whose product takes all work space, in all threads
# the value that glibc reaches by itself for arrays; twice as much for the heap
USUAL_THRESHOLD_BYTES = 32 << 20


@contextlib.contextmanager
def keeping_freed(worth_it: bool = True) -> Iterator[None]:
    """Inside, memory that arrays leave serves the next ones; afterwards it goes back to the system.

    glibc maps every array above 32 MB anew, and the system fills each page with zeros at its first use. That is
    half of the time of an operation on 5 million numbers, and a fourth of an unwrap of as many faces. worth_it:
    False changes nothing, as do systems without glibc.
    """
    libc = _glibc() if worth_it else None
    if libc is None:
        yield
        return
    libc.mallopt(MMAP_THRESHOLD, KEPT_FREED_BYTES)
    libc.mallopt(TRIM_THRESHOLD, KEPT_FREED_BYTES)
    try:
        yield
    finally:
        libc.mallopt(MMAP_THRESHOLD, USUAL_THRESHOLD_BYTES)
        libc.mallopt(TRIM_THRESHOLD, 2 * USUAL_THRESHOLD_BYTES)
        libc.malloc_trim(0)


def room_for_libraries(threads: int) -> None:
    """Refuse a bound on the address space that is too small for the libraries with this number of threads.

    Raises NoResultError with a sufficient bound.
    """
    bound, least = address_bound(), LIBRARY_BYTES + THREAD_BYTES * threads
    if bound is not None and bound[0] < least:
        raise NoResultError(
            f"the memory is bounded to {bound[0] / 1e9:.2f} GB, and the libraries alone take "
            f"{least / 1e9:.2f}: allow more (--max-memory, ulimit -v)"
        )


def address_bound() -> tuple[int, int] | None:
    """Bytes of address space that this process may have, and may ask for; None if nothing bounds them."""
    try:
        import resource
    except ImportError:
        return None
    bound = resource.getrlimit(resource.RLIMIT_AS)
    return None if bound[0] == resource.RLIM_INFINITY else bound


def bound_process(kind: str, most: int) -> None:
    """Set the soft limit of that name (AS: bytes of address space, CPU: seconds), up to the hard one.

    Raises ImportError where the system has no such bounds, ValueError or OSError where it refuses.
    """
    import resource

    number = getattr(resource, f"RLIMIT_{kind}")
    hard = resource.getrlimit(number)[1]
    low = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(number, (low, hard))


def claim_work_space() -> None:
    """Have OpenBLAS take the work space that it keeps, while there is room: later it would end the process."""
    import numpy as np
    from scipy.linalg import blas

    square = np.ones((SQUARE_ROWS, SQUARE_ROWS))
    np.dot(square, square)
    blas.dgemm(1.0, square, square)


def _glibc() -> Any:
    """The C library where it is glibc, else None."""
    if not sys.platform.startswith("linux"):
        return None
    import ctypes  # takes a while

    with contextlib.suppress(OSError):
        libc = ctypes.CDLL(None)
        if hasattr(libc, "gnu_get_libc_version"):
            return libc
    return None


def peak() -> int | None:
    """Largest resident size of this process so far, in bytes; None if the system does not tell.

    Linux keeps the value with the address space; getrusage would also count the parent's memory at the fork.
    """
    with contextlib.suppress(OSError), open("/proc/self/status", encoding="ascii") as stream:
        for line in stream:
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    with contextlib.suppress(ImportError):
        import resource

        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    return None


def resident(pid: int | str = "self") -> int:
    """Bytes of memory that a process holds; 0 if the system does not tell."""
    return _statm(pid, 1)


def address_space(pid: int | str = "self") -> int:
    """Bytes of address space that a process has; 0 if the system does not tell."""
    return _statm(pid, 0)


def _statm(pid: int | str, column: int) -> int:
    try:
        with open(f"/proc/{pid}/statm", "rb") as stream:
            return int(stream.read().split()[column]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError, ValueError):  # no /proc, or the process has ended
        return 0
