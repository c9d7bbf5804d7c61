"""Processes that a test has started."""

from circparam.core.pool import Pool


def pids(pool: Pool) -> list[int]:
    """The processes of a pool."""
    return list(pool.executor._processes)
