"""``circparam methods``: every method, its source and its guarantees."""

from typing import Any

import click

from circparam.cli import common
from circparam.core.registry import TAGS

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

    rows = [
        {
            "name": row.name,
            "summary": row.summary,
            "source": row.citation,
            "guarantees": [tag for tag in TAGS if tag in row.tags],
            "condition": row.condition,
        }
        for row in ([METHODS[name]] if name else METHODS)
    ]
    shown = _page if name else _table
    common.show({"as_json": as_json}, rows[0] if name else rows, lambda: shown(rows), 2)
    if not (name or as_json):
        click.echo("circparam methods NAME shows its source and the conditions of its guarantees.")


# heads of columns that are shorter than their tags
_SHORT = {"reproduces-plane": "plane", "free-boundary": "free", "convex-boundary": "convex"}


def _table(rows: list[dict[str, Any]]) -> list[Any]:
    """Every method with its guarantees and its use, and the meaning of the guarantees."""
    short = {tag: _SHORT.get(tag, tag) for tag in TAGS}
    marks = {
        row["name"]: ["yes" if tag in row["guarantees"] else "-" for tag in TAGS] for row in rows
    }
    meanings = common.tables.facts((short[tag], text) for tag, text in TAGS.items())
    uses = common.tables.facts((row["name"], row["summary"]) for row in rows)
    return [common.tables.columns("method", short.values(), marks), "", uses, "", meanings]


def _page(rows: list[dict[str, Any]]) -> list[Any]:
    (row,) = rows
    lines = [("method", row["name"])]
    lines += [(key, row[key]) for key in ("summary", "source", "condition") if row[key]]
    guarantees = [f"{tag}: {TAGS[tag]}" for tag in row["guarantees"]] or ["none"]
    lines += [("guarantees" if k == 0 else "", text) for k, text in enumerate(guarantees)]
    return [common.tables.facts(lines)]
