"""``circparam methods``: every method, where it comes from, and what it guarantees."""

from __future__ import annotations

import json
import textwrap
from typing import Any

import click

from circparam.cli import options

_EPILOG = """\b
Examples:
  circparam methods
  circparam methods circle
  circparam methods --json
"""


@click.command(epilog=_EPILOG)
@click.argument("name", required=False)
@options.json_option
def command(name: str | None, as_json: bool) -> None:
    """Show every method, and what it guarantees.

    With NAME all that is known of one method.
    """
    from circparam.methods import METHODS

    rows = [_plain(METHODS[name])] if name else [_plain(row) for row in METHODS]
    if as_json:
        click.echo(json.dumps(rows[0] if name else rows, indent=2, ensure_ascii=False))
    elif name:
        click.echo(_page(rows[0]))
    else:
        click.echo(_table(rows))


def _plain(row: Any) -> dict[str, Any]:
    """A row of METHODS as plain values; guarantees in the order of the table of tags."""
    from circparam.core.registry import TAGS

    return {
        "name": row.name,
        "summary": row.summary,
        "source": row.citation,
        "guarantees": [tag for tag in TAGS if tag in row.tags],
        "condition": row.condition,
    }


def _table(rows: list[dict[str, Any]]) -> str:
    from circparam.core.registry import TAGS

    short = {
        "positive": "positive",
        "reproduces-plane": "plane",
        "flip-free": "flip-free",
        "free-boundary": "free",
        "convex-boundary": "convex",
    }
    head = f"{'method':12}" + "".join(f"{short[tag]:>10}" for tag in TAGS)
    lines = [head]
    for row in rows:
        marks = "".join(f"{'yes' if tag in row['guarantees'] else '-':>10}" for tag in TAGS)
        lines.append(f"{row['name']:12}{marks}")
        lines += textwrap.wrap(row["summary"], 74, initial_indent="    ", subsequent_indent="    ")
    lines.append("")
    for tag, text in TAGS.items():
        lines += textwrap.wrap(f"{short[tag] + ':':11}{text}", 78, subsequent_indent=" " * 11)
    lines.append("circparam methods NAME tells its source, and on what its guarantees depend.")
    return "\n".join(lines)


def _page(row: dict[str, Any]) -> str:
    from circparam.core.registry import TAGS

    guarantees = [f"{tag}: {TAGS[tag]}" for tag in row["guarantees"]] or ["none"]
    parts = [("", row["summary"]), ("source", row["source"]), ("condition", row["condition"])]
    lines = [row["name"]]
    for label, text in parts:
        if text:
            lines += textwrap.wrap(
                f"{label}: {text}" if label else text,
                78,
                initial_indent="  ",
                subsequent_indent="  ",
            )
    lines.append("  guarantees:")
    for guarantee in guarantees:
        lines += textwrap.wrap(guarantee, 78, initial_indent="    ", subsequent_indent="      ")
    return "\n".join(lines)
