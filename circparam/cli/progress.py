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


def warn(line: str, quiet: bool = False) -> None:
    """A warning on stderr, in one line."""
    if not quiet:
        click.echo(f"circparam: warning: {line}", err=True)


@contextlib.contextmanager
def listener(label: str, quiet: bool) -> Iterator[Listener | None]:
    """A listener that draws a bar; None where nobody would see it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    bar = _Bar(label)
    try:
        yield bar
    finally:
        bar.close()


class _Bar:
    """Stage, fraction and elapsed time; rich is imported when the bar appears, not before."""

    def __init__(self, label: str) -> None:
        self.label = label
        self.start = time.monotonic()
        self.bar: Any = None
        self.task: Any = None

    def __call__(self, stage: str, fraction: float, note: str) -> None:
        """Show how far a stage is."""
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
