"""What a process has of the memory, as the system tells it."""

from __future__ import annotations

import os


def resident(pid: int | str = "self") -> int:
    """Bytes of memory that a process holds; 0 where the system does not tell."""
    return _statm(pid, 1)


def address_space(pid: int | str = "self") -> int:
    """Bytes of address space that a process has; 0 where the system does not tell."""
    return _statm(pid, 0)


def _statm(pid: int | str, column: int) -> int:
    try:
        with open(f"/proc/{pid}/statm", "rb") as stream:
            return int(stream.read().split()[column]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError, ValueError):  # no /proc, or the process has ended
        return 0
