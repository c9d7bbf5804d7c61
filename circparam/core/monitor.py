"""Stages, their times, progress and the deadline: one object handed down through the library.

The library itself never prints. A command line gives a listener; a deadline turns into ``expired`` that
long loops ask, so that the best valid result so far can be returned.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from circparam.errors import OutOfTimeError

Listener = Callable[[str, float, str], None]


class Monitor:
    """Collects the seconds of each stage, passes progress on, and knows the deadline.

    listener: called with (stage, fraction 0..1, note). timeout: seconds from now, None for no bound.
    jobs: processes that may share the work, this one included (``circparam.core.workers``).
    """

    def __init__(
        self, listener: Listener | None = None, timeout: float | None = None, jobs: int = 1
    ) -> None:
        self.jobs = jobs
        self._listener = listener
        self._stage = ""
        self.deadline = None if timeout is None else time.monotonic() + timeout
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure a stage; its seconds add up under its name. Inner stages count for themselves only."""
        outer, self._stage = self._stage, name
        start = time.perf_counter()
        inner_before = sum(self.seconds.values())
        self.update(0.0)
        try:
            yield
        finally:
            inner = sum(self.seconds.values()) - inner_before
            own = time.perf_counter() - start - inner
            self.seconds[name] = self.seconds.get(name, 0.0) + own
            self._stage = outer

    def update(self, fraction: float, note: str = "") -> None:
        """Tell the listener how far the current stage is."""
        if self._listener is not None:
            self._listener(self._stage, fraction, note)

    @property
    def expired(self) -> bool:
        """Whether the deadline has passed: a loop that holds a valid result stops then."""
        return self.deadline is not None and time.monotonic() >= self.deadline

    def check(self) -> None:
        """Raise OutOfTimeError when the deadline has passed: for stages before any valid result."""
        if self.expired:
            raise OutOfTimeError(
                f"out of time during {self._stage or 'the work'} with no valid result yet: "
                "give a longer --timeout"
            )
