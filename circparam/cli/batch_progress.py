"""Display of a batch while it runs and at its end: a few lines that renew themselves, or one line a minute."""

import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import click

from circparam.batch.progress import printable
from circparam.cli import signals
from circparam.cli.tables import console, facts

if TYPE_CHECKING:
    from circparam.batch.batch import Summary
    from circparam.batch.progress import Progress

NAMED_FILES = 8  # of the files that run, the oldest
BAR_CHARACTERS = 60  # characters of the bar
MOST_ERROR_LINES = 50  # lines about files that failed; more of them are only counted
MINUTE = 60.0


class Screen:
    """Draws progress on stderr. silent: nothing; quiet: no word about single files either."""

    def __init__(self, silent: bool, verbose: int, quiet: bool) -> None:
        self.silent, self.verbose, self.quiet = silent, verbose, quiet
        self.terminal = sys.stderr.isatty()
        self._live: Any = None
        self._reported = time.monotonic()
        self._errors = 0
        self._stopping = False

    def started(self, stop: Callable[[], None]) -> AbstractContextManager[None]:
        """During the work: the first Ctrl-C lets tasks finish that take seconds."""

        def ask() -> None:
            stop()
            self._stopping = True
            self._say("stopping: running files have 3 s to finish (Ctrl-C again: stop at once)")

        return signals.asked_first(ask)

    def show(self, progress: "Progress") -> None:
        """How far it is: at once on a terminal, once a minute elsewhere."""
        if self.silent:
            return
        if self.terminal:
            from rich.console import Console, Group
            from rich.text import Text

            if self._live is None:
                from rich.live import Live

                self._live = Live(console=Console(stderr=True), transient=True, auto_refresh=False)
                self._live.start()
            filled = BAR_CHARACTERS * progress.done // max(progress.total - progress.skipped, 1)
            rows: list[Any] = [
                Text(headline(progress) + (" · stopping" if self._stopping else "")),
                Text.assemble(
                    ("━" * filled, "green"), ("━" * (BAR_CHARACTERS - filled), "bright_black")
                ),
            ]
            for name, seconds in progress.running[:NAMED_FILES]:
                row = f"  {clock(seconds):>7}  {printable(name)}"
                rows.append(Text(row, overflow="ellipsis", no_wrap=True))
            if len(progress.running) > NAMED_FILES:
                rows.append(Text(f"  and {len(progress.running) - NAMED_FILES} more"))
            self._live.update(Group(*rows), refresh=True)
        elif time.monotonic() - self._reported >= MINUTE:
            self._reported = time.monotonic()
            click.echo(f"circparam: {headline(progress)}", err=True)

    def line(self, line: dict[str, Any]) -> None:
        """One file is done: its error, or with -v the fact."""
        text = line.get("error")
        if text is not None and not self.quiet:
            self._errors += 1
            if self._errors <= MOST_ERROR_LINES:
                name = printable(line["name"])
                said = printable(text)
                self._say(f"error: {said}" if name in said else f"error: {name}: {said}")
                if self._errors == MOST_ERROR_LINES:
                    self._say("further errors are counted only; the report lists all of them")
        elif self.verbose and not self.silent:
            measures = line.get("measures") or {}
            figures = f"{measures.get('charts')} charts, {line['seconds']} s"
            self._say(f"{line['status']}: {printable(line['name'])}: {figures}")

    def _say(self, text: str) -> None:
        if self._live is not None:
            self._live.console.print(f"circparam: {text}", markup=False, soft_wrap=True)
        else:
            click.echo(f"circparam: {text}", err=True)

    def close(self) -> None:
        """Take it away."""
        if self._live is not None:
            self._live.stop()
            self._live = None


def headline(progress: "Progress") -> str:
    """The whole state in one line."""
    parts = [f"{progress.skipped + progress.done} of {progress.total} done"]
    if progress.skipped:
        parts[0] += f" ({progress.skipped} before)"
    bad = progress.counts["failed"] + progress.missed
    parts.append(f"{bad} failed")
    parts.append(f"{len(progress.running)} running on {progress.workers} workers")
    if progress.rate > 0:
        parts.append(f"{progress.rate:.3g} files/s")
    if progress.left is not None and progress.rate > 0:
        parts.append(f"{clock(progress.left)} left")
    if progress.note:
        parts.append(progress.note)
    return ", ".join(parts)


def clock(seconds: float) -> str:
    """A time as people say it: 12 s, 3:20, 2:05:00, 3 d."""
    whole = int(seconds)
    if whole < 100:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02d}"
    if whole < 172_800:
        return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
    return f"{whole / 86_400:.1f} d"


def print_summary(summary: "Summary") -> None:
    """The end of a batch as a table."""
    done = f"{summary.done} done, {summary.skipped} skipped in {summary.seconds:.1f} s"
    rows = [("files", str(summary.total)), ("status", _counts(summary.counts) or "none done")]
    rows.append(("this run", done))
    rows += [("gates", f"{summary.missed} missed")] if summary.missed else []
    rows += [("report", printable(summary.report))] if summary.report else []
    console().print(facts(rows))


def print_status(found: dict[str, Any]) -> None:
    """The table of ``--status``."""
    run = found["run"]
    rows = [("results", printable(found["out"])), ("done", _counts(found["counts"]) or "none yet")]
    rows += [("gates", f"{found['missed']} missed")] if found["missed"] else []
    if run is None:
        rows.append(("running", "no"))
    else:
        todo = run["total"] - run["skipped"]
        left = "" if run["left"] is None else f", {clock(run['left'])} left"
        rows.append(("running", f"{run['done']} of {todo}, {run['rate']:.3g} files/s{left}"))
        named = run["running"][:NAMED_FILES]
        rows += [("", f"{clock(age):>7}  {printable(name)}") for name, age in named]
    console().print(facts(rows))


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{n} {kind}" for kind, n in sorted(counts.items()))
