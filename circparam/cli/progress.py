"""Output on stderr: a bar for work over two seconds, warnings, and nothing at all with --quiet."""

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from typing import Any

import click

from circparam.cli import signals
from circparam.core.memory import peak, resident
from circparam.core.monitor import Listener

AS_LINES = "CIRCPARAM_PROGRESS"  # in the environment: a program reads stderr and wants a line for each per cent
DELAY_SECONDS = 2.0  # seconds before a bar appears
FORECAST_SHARE = 0.1  # of the run: no remaining time is shown before this share
# Stages and their shares of a run, in hundredths: processor seconds, means over meshes of 1,600 to 90,000
# faces. Groups follow each other; the stages of a group come again and stand inside each other.
GROUPS: tuple[dict[str, int], ...] = (
    {"read": 1},
    {"repair": 1},
    {
        **{"seams": 1, "visibility": 5, "charts": 37, "carry": 4, "relax": 5, "enforce": 8},
        **{"stretch": 4, "weights": 1, "solve": 1, "unfold": 1, "flatten": 1},
    },
    {"check": 1, "repair layout": 1, "pack": 31},
    {"verify": 2},
    {"write": 1},
)
SEARCH = "search"  # the stage of all searches but the first
LEVEL_STAGE = "level"  # stages of a mesh whose charts are found on a smaller surface
# other kinds of runs, by a stage that identifies them; compare has no names for its methods
OTHER_RUNS: dict[str, tuple[dict[str, int], ...]] = {
    LEVEL_STAGE: (
        {"read": 1},
        {"repair": 4},
        {
            **{"seams": 4, "visibility": 1, "charts": 4, LEVEL_STAGE: 40, "carry": 14, "relax": 9},
            **{"enforce": 9, "stretch": 2, "flatten": 1},
        },
        {"check": 2, "repair layout": 1, "pack": 4},
        {"verify": 6},
        {"write": 1},
    ),
    "": (*GROUPS[:3], {"": 70}),
    "images": (
        *({"read": 1}, {"images": 2}),
        *GROUPS[1:4],
        *({"verify": 4}, {"textures": 60}, {"write": 2}, {"look": 10}),
    ),
    "bake": ({"read": 5}, {"bake": 90}, {"write": 5}, {"look": 20}),
    "draw": ({"read": 20}, {"draw": 80}),
}


def say(kind: str, line: str, quiet: bool = False) -> None:
    """An error, a warning, a note (the user need not act) or the progress on stderr, in one line."""
    if not quiet:
        click.echo(f"circparam: {kind}: {line}", err=True)


@contextlib.contextmanager
def listener(
    label: str, quiet: bool, place: tuple[int, int] = (1, 1), searches: int = 1
) -> Iterator[Listener]:
    """A listener that draws a bar for a visible stream and keeps the progress.

    place: number of all items. searches: how many searches the run makes at most.
    """
    if place[1] > 1:
        label = f"{label} ({place[0]} of {place[1]})"
    kind = Lines if os.environ.get(AS_LINES) and not quiet else Status
    if sys.stderr.isatty() and not quiet:
        kind = Bar
    status = kind(label, searches)
    with signals.within(signals.STATUS, status.line):  # the answer to SIGUSR1
        try:
            yield status
        finally:
            status.close()


class Forward:
    """Progress of the whole run from the progress of its stages, weighted by their times; it never falls.

    A group is done when a stage of a later one has begun. Within a group each stage counts by its furthest
    report, whatever the others reported. A stage that began says nothing of earlier ones. Further searches
    take as long as the first one each.
    """

    def __init__(self, searches: int = 1) -> None:
        self.fraction, self.searches = 0.0, searches
        self.groups = GROUPS
        self._at, self._come, self._further = 0, dict[str, float](), 0.0

    def __call__(self, stage: str, fraction: float) -> float:
        """The share of the run, 0..1, that is done when a stage has come so far; unknown ones move nothing."""
        if stage in OTHER_RUNS and self.groups is GROUPS:
            self.groups = OTHER_RUNS[stage]
        for number, group in enumerate(self.groups):
            if stage in group and number >= self._at:
                self._come = self._come if number == self._at else {}
                self._at = number
                self._come[stage] = max(min(fraction, 1.0), self._come.get(stage, 0.0))
        costs = [sum(group.values()) for group in self.groups]
        here = self.groups[self._at]
        done = float(sum(costs[: self._at]))
        done += sum(here.get(name, 0) * come for name, come in self._come.items())
        further = (self.searches - 1) * sum(costs)
        if stage == SEARCH:
            self._further = max(self._further, min(fraction, 1.0))
        self.fraction = (done + self._further * further) / (sum(costs) + further)
        return self.fraction


class Status:
    """A listener that remembers the progress and shows it on request."""

    def __init__(self, label: str, searches: int = 1) -> None:
        self.label, self.stage = label, "read"
        self.forward = Forward(searches)
        self.start = time.monotonic()

    def __call__(self, stage: str, fraction: float, note: str) -> None:
        """Remember the stage and the progress of the run."""
        self.stage = stage or self.stage
        self.forward(stage, fraction)

    def close(self) -> None:
        """The end of the work."""

    def line(self) -> str:
        """Stage, share of the run, seconds so far, an estimate of the rest, memory."""
        gone, share = time.monotonic() - self.start, self.forward.fraction
        left = f"about {gone * (1 - share) / share:.0f} s left, " if share >= FORECAST_SHARE else ""
        done = f"{self.label}: {self.stage}, {100 * share:.0f} % done"
        return f"{done}, {gone:.0f} s so far, {left}{(resident() or peak() or 0) / 1e6:.0f} MB"


class Lines(Status):
    """A line on stderr for each per cent that is done, for programs that draw a bar of their own."""

    shown = -1

    def __call__(self, stage: str, fraction: float, note: str) -> None:
        """Tell it where the whole per cent has changed."""
        super().__call__(stage, fraction, note)
        percent = int(100 * self.forward.fraction)
        if percent > self.shown:
            self.shown = percent
            say("progress", f"{percent} % {self.stage}")


class Bar(Status):
    """Stage, share of the run and elapsed time; rich is imported when the bar appears, not before."""

    bar: Any = None
    task: Any = None

    def __call__(self, stage: str, fraction: float, note: str) -> None:
        """Show the progress of the run, and its stage."""
        super().__call__(stage, fraction, note)
        if self.bar is None and time.monotonic() - self.start >= DELAY_SECONDS:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            self.bar = Progress(
                TextColumn("{task.description}"),
                TextColumn("[bold]{task.fields[stage]}"),
                BarColumn(bar_width=24),
                TimeElapsedColumn(),
                TextColumn("{task.fields[note]}"),
                console=Console(stderr=True),
                transient=True,
            )
            self.task = self.bar.add_task(self.label, total=1.0, stage="", note="")
            self.bar.start()
        if self.bar is not None:
            share = self.forward.fraction
            self.bar.update(self.task, completed=share, stage=stage, note=note)

    def close(self) -> None:
        """Take the bar away."""
        if self.bar is not None:
            self.bar.stop()
