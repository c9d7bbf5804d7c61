"""Reports as text for a terminal: within 80 columns, colours only where the terminal has them."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

_STATUS = {"ok": "green", "repaired": "yellow", "degraded": "red", "failed": "red"}


def console(**keywords: Any) -> Console:
    """A console for stdout; honours NO_COLOR, and 80 columns where the output is no terminal."""
    out = Console(highlight=False, soft_wrap=False, **keywords)
    if not out.is_terminal:
        out = Console(highlight=False, width=80, **keywords)
    return out


def unwrap_table(report: dict[str, Any], verbose: int = 0) -> Table:
    """A short table of one unwrap; ``verbose`` adds the stages, and the notes from 2 on."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")

    def row(name: str, value: str) -> None:
        table.add_row(name, value)

    status = report["status"]
    row("status", f"[{_STATUS.get(status, 'white')}]{status}[/]")
    row("input", _plain(report["input"]))
    row("output", _plain(report["output"] or "(in memory)"))
    row("method", f"{report['method']}, cut {report['cut']}")
    row("charts", f"{report['charts']} of {report['faces']} faces")
    row("flips, overlaps", f"{report['flips']}, {report['overlap']}")
    row(
        "distortion",
        f"{_number(report['distortion'])} (worst chart {_number(report['distortion_max_chart'])}; "
        "1 is perfect)",
    )
    row("seam length", f"{_number(report['seam_length'])} x sqrt(area)")
    if report["pack"] is not None:
        row("packed", f"{100 * report['pack']:.1f} % of the page")
    row("time", f"{report['seconds']:.2f} s")
    for line in report["repairs"]:
        row("repaired", _plain(line))
    if verbose:
        for name, seconds in report["stages"].items():
            row(f"  {name}", f"{seconds:.3f} s")
    if verbose > 1:
        for line in report["notes"]:
            row("note", _plain(line))
    return table


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"


def _plain(text: object) -> str:
    """Text in which square brackets are no markup."""
    return str(text).replace("[", r"\[")
