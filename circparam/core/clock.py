"""Deadlines for work without a partial result: it is broken off.

Loops with a valid result ask ``Monitor.expired`` and stop. Other work has nothing to return. Its building
blocks (factorisations, shortest paths, steps of a minimisation) call ``tick``. A caller that can do without the
result sets the moment with ``bounded``.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from circparam.errors import OutOfTimeError

_last: ContextVar[float | None] = ContextVar("last", default=None)


@contextmanager
def bounded(last: float | None) -> Iterator[None]:
    """Work inside is broken off at a moment of ``time.monotonic``; never where it is None."""
    token = _last.set(last)
    try:
        yield
    finally:
        _last.reset(token)


def tick() -> None:
    """Raise OutOfTimeError if the last moment has passed."""
    last = _last.get()
    if last is not None and time.monotonic() >= last:
        raise OutOfTimeError("out of time before anything valid was found: give a longer --timeout")


def left() -> float | None:
    """Seconds that are left; None if nothing bounds them."""
    last = _last.get()
    return None if last is None else last - time.monotonic()
