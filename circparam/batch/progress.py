"""Progress of a batch as values, which the command line draws and ``--status`` reads from the disk."""

import dataclasses
import time
from collections import deque
from dataclasses import field
from typing import Any

from circparam.core.records import dataclass

# bytes added to the size of a file for its weight: the least cost of an unwrap
LEAST_WEIGHT_BYTES = 50_000
RECENT_SECONDS = 300.0  # seconds that the rate is measured over
LINE_STATUSES = ("ok", "repaired", "degraded", "failed")


@dataclass(frozen=True)
class Progress:
    """total: files of the sources. skipped: done before. done: in this run, by status in ``counts``. missed: of
    them, those with a gate missed. running: (name, seconds) of the running items, the oldest first. rate: files
    a second, lately. left: seconds, None if unknown. workers: tasks that can be at work. note: the
    reason of a wait.
    """

    total: int
    skipped: int
    counts: dict[str, int]
    missed: int = 0
    running: tuple[tuple[str, float], ...] = ()
    rate: float = 0.0
    left: float | None = None
    workers: int = 0
    note: str = ""

    @property
    def done(self) -> int:
        """Files that have a line of this run."""
        return sum(self.counts.values())

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {**dataclasses.asdict(self), "done": self.done}


@dataclass
class Meter:
    """Counts finished items and reports the progress. total, skipped: files. weight: bytes of those to do."""

    total: int
    skipped: int
    weight: int
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(LINE_STATUSES, 0))
    missed: int = 0

    def __post_init__(self) -> None:
        self.rest = self.weight + LEAST_WEIGHT_BYTES * (self.total - self.skipped)
        self._recent: deque[tuple[float, int, int]] = deque([(time.monotonic(), 0, 0)])
        self._weight = 0

    @property
    def done(self) -> int:
        """Files that have a line of this run."""
        return sum(self.counts.values())

    def count(self, line: dict[str, Any]) -> None:
        """One file is done."""
        self.counts[line["status"]] += 1
        self.missed += line["status"] != "failed" and bool(line["exit"])
        self._weight += int(line["source_bytes"] or 0) + LEAST_WEIGHT_BYTES

    def progress(self, running: dict[str, float], workers: int, note: str) -> Progress:
        """How far it is now."""
        now = time.monotonic()
        if now - self._recent[-1][0] > 1.0:
            self._recent.append((now, self.done, self._weight))
        while len(self._recent) > 2 and now - self._recent[1][0] > RECENT_SECONDS:
            self._recent.popleft()
        then, done, weight = self._recent[0]
        seconds = max(now - then, 1e-9)
        speed = (self._weight - weight) / seconds
        left = (self.rest - self._weight) / speed if speed > 0 else None
        return Progress(
            self.total, self.skipped, dict(self.counts), self.missed,
            tuple(sorted(running.items(), key=lambda pair: -pair[1])),
            (self.done - done) / seconds, left, workers, note,
        )  # fmt: skip


def printable(name: str) -> str:
    """A name for people: control characters and bytes that are not UTF-8 become escapes."""
    text = name.encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
