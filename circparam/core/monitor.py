"""Stages, their times, progress and the deadline: one object handed down through the library.

The library itself never prints. A command line gives a listener. A deadline turns into ``expired``, which long
loops ask in order to return the best valid result so far.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from circparam.errors import OutOfTimeError

# Work without a result continues after loops have stopped, for this share of the time and these seconds.
GRACE_SHARE = 0.05
GRACE_SECONDS = 0.2

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
        self._stage, self._fraction = "", 0.0
        self._shown: str | None = None  # a stage shown instead of those that are part of it
        self.deadline = None if timeout is None else time.monotonic() + timeout
        self.timeout = timeout
        self.reserved = 0.0  # seconds before the deadline reserved for later stages
        self.late = False  # whether any stage had to end because time was up
        self.seconds: dict[str, float] = {}
        self._keepers: list[Callable[[Any, bool], None]] = []

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure a stage; its seconds add up under its name. Inner stages count for themselves only."""
        outer, self._stage = (self._stage, self._fraction), name
        start = time.perf_counter()
        inner_before = sum(self.seconds.values())
        self.update(0.0)
        try:
            yield
        finally:
            inner = sum(self.seconds.values()) - inner_before
            own = time.perf_counter() - start - inner
            self.seconds[name] = self.seconds.get(name, 0.0) + own
            self._stage, fraction = outer
            if self._stage:  # the outer stage continues
                self.update(fraction)

    def update(self, fraction: float, note: str = "") -> None:
        """Report the progress of the current stage to the listener."""
        self._fraction = fraction
        if self._listener is not None:
            inside = self._shown is not None
            self._listener(self._shown or self._stage, 0.5 if inside else fraction, note)

    def note(self, note: str) -> None:
        """Send the listener a note about the current stage, without progress."""
        self.update(self._fraction, note)

    @property
    def expired(self) -> bool:
        """Whether time is up for the current work: a loop with a valid result stops then."""
        up = self.short(0.0)
        self.late |= up
        return up

    def short(self, seconds: float) -> bool:
        """Whether fewer seconds than these are left for the current work: optional work is left out."""
        left = self.left
        return left is not None and left <= seconds

    @property
    def left(self) -> float | None:
        """Seconds until time is up for the current work; None without a bound."""
        return None if self.deadline is None else self.deadline - self.reserved - time.monotonic()

    @property
    def hurried(self) -> bool:
        """Whether time is up, or was for an earlier stage: the result is less than it could be."""
        return self.expired or self.late

    @property
    def last(self) -> float | None:
        """The moment at which work without a result is broken off: a little after the loops stop."""
        return None if self.deadline is None else self.deadline - self.reserved + self._grace

    @property
    def _grace(self) -> float:
        """Seconds that work without a result has after the loops have stopped."""
        return GRACE_SHARE * max(self.timeout or 0.0, 0.0) + GRACE_SECONDS

    @contextmanager
    def holding(self, seconds: float, least: float = 0.0) -> Iterator[None]:
        """Inside, reserve this many more seconds for later, except a share ``least`` of the rest."""
        reserved, left = self.reserved, self.left
        if left is not None:
            self.reserved += min(seconds, max((1 - least) * left, 0.0))
        try:
            yield
        finally:
            self.reserved = reserved

    @contextmanager
    def shown_as(self, name: str) -> Iterator[None]:
        """Inside, the listener sees this stage instead of the stages of the work."""
        before, self._shown = self._shown, name
        try:
            yield
        finally:
            self._shown = before

    @contextmanager
    def keeping(self, keeper: Callable[[Any, bool], None]) -> Iterator[None]:
        """Inside, results of parts of the work go to the keeper as well, where there is a deadline."""
        self._keepers.append(keeper)
        try:
            yield
        finally:
            self._keepers.remove(keeper)

    def keep(self, reached: Any, sound: bool = True) -> None:
        """Pass the result of a part of the work to the keeper, which returns it when time runs out."""
        if self.deadline is not None:
            for keeper in tuple(self._keepers):
                keeper(reached, sound)

    def check(self, seconds: float = 0.0) -> None:
        """Raise OutOfTimeError if the deadline has passed with no valid result yet.

        seconds: least time of the remaining work, if known; a little lateness is accepted then.
        """
        if self.deadline is None:
            return
        now = time.monotonic()
        if now >= self.deadline or now + seconds > self.deadline + 2 * self._grace:
            raise OutOfTimeError(
                f"out of time during {self._stage or 'the work'} with no valid result yet: "
                "give a longer --timeout"
            )
