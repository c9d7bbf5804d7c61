"""``circparam methods``: every method, its source and its guarantees."""

from typing import Any

import click

from circparam.cli import common

_EPILOG = """\b
Examples:
  circparam methods
  circparam methods circle
  circparam methods --json
"""


@click.command(epilog=_EPILOG)
@click.argument("name", required=False)
@common.json_option
def command(name: str | None, as_json: bool) -> None:
    """Show every method and its guarantees.

    With NAME show one method in detail.
    """
    from circparam.methods import METHODS

    rows = [_plain(METHODS[name])] if name else [_plain(row) for row in METHODS]
    if as_json:
        common.echo_json(rows[0] if name else rows, 2)
    elif name:
        _print_page(rows[0])
    else:
        _print_table(rows)


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


_SHORT = {
    "positive": "positive",
    "reproduces-plane": "plane",
    "flip-free": "flip-free",
    "free-boundary": "free",
    "convex-boundary": "convex",
}


def _print_table(rows: list[dict[str, Any]]) -> None:
    """Every method with its guarantees and its use, and the meaning of the guarantees."""
    from circparam.cli.tables import columns, console, facts
    from circparam.core.registry import TAGS

    short = {tag: _SHORT.get(tag, tag) for tag in TAGS}
    marks = {
        row["name"]: ["yes" if tag in row["guarantees"] else "-" for tag in TAGS] for row in rows
    }
    out = console()
    out.print(columns("method", short.values(), marks), "")
    out.print(facts((row["name"], row["summary"]) for row in rows), "")
    out.print(facts((short[tag], text) for tag, text in TAGS.items()))
    click.echo("circparam methods NAME shows its source and the conditions of its guarantees.")


def _print_page(row: dict[str, Any]) -> None:
    """All that is known of one method."""
    from circparam.cli.tables import console, facts
    from circparam.core.registry import TAGS

    guarantees = [f"{tag}: {TAGS[tag]}" for tag in row["guarantees"]] or ["none"]
    lines = [(key, row[key]) for key in ("summary", "source", "condition") if row[key]]
    lines += [("guarantees" if k == 0 else "", text) for k, text in enumerate(guarantees)]
    console().print(facts([("method", row["name"]), *lines]))
