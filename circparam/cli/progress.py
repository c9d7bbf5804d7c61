"""What happens on stderr: a bar for work over two seconds, warnings, and nothing at all with --quiet."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from typing import Any

import click

from circparam.core.monitor import Listener

DELAY = 2.0  # seconds before a bar appears
# Stages in their order and what each takes of a run, in hundredths: means over the meshes of the benchmarks.
# What compare does method by method, with no stage of its own, comes after the cut.
COSTS = {
    **{
        "read": 1,
        "repair": 1,
        "visibility": 2,
        "charts": 38,
        "carry": 6,
        "relax": 4,
        "enforce": 16,
        "stretch": 4,
    },
    **{"seams": 1, "weights": 1, "solve": 1, "unfold": 1, "flatten": 1, "": 10, "check": 1},
    **{"repair layout": 1, "pack": 20, "bake": 10, "verify": 5, "write": 1},
}


def warn(line: str, quiet: bool = False) -> None:
    """A warning on stderr, in one line."""
    if not quiet:
        click.echo(f"circparam: warning: {line}", err=True)


@contextlib.contextmanager
def listener(label: str, quiet: bool, place: tuple[int, int] = (1, 1)) -> Iterator[Listener | None]:
    """A listener that draws a bar; None where nobody would see it. place: of the mesh, and of how many."""
    if place[1] > 1:
        label = f"{label} ({place[0]} of {place[1]})"
    if quiet or not sys.stderr.isatty():
        yield None
        return
    bar = _Bar(label)
    try:
        yield bar
    finally:
        bar.close()


class Forward:
    """How far the whole run is, out of how far its stages are: by what they take, and never back.

    Stages come again and stand inside each other: the furthest place so far is what counts.
    """

    def __init__(self) -> None:
        self.fraction = 0.0

    def __call__(self, stage: str, fraction: float) -> float:
        """The share of the run, 0..1, that is done when a stage has come so far; unknown ones move nothing."""
        before, whole = 0.0, float(sum(COSTS.values()))
        for name, cost in COSTS.items():
            if name == stage:
                done = before + cost * min(max(fraction, 0.0), 1.0)
                self.fraction = max(self.fraction, done / whole)
            before += cost
        return self.fraction


class _Bar:
    """Stage, share of the run and elapsed time; rich is imported when the bar appears, not before."""

    def __init__(self, label: str) -> None:
        self.label = label
        self.forward = Forward()
        self.start = time.monotonic()
        self.bar: Any = None
        self.task: Any = None

    def __call__(self, stage: str, fraction: float, note: str) -> None:
        """Show how far the run is, and in which stage."""
        fraction = self.forward(stage, fraction)
        if self.bar is None:
            if time.monotonic() - self.start < DELAY:
                return
            self._open()
        self.bar.update(self.task, completed=fraction, stage=stage, note=note)

    def _open(self) -> None:
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

    def close(self) -> None:
        """Take the bar away."""
        if self.bar is not None:
            self.bar.stop()
