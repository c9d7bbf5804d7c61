"""METHODS: every way to flatten, as one table."""

from __future__ import annotations

from functools import partial

from circparam.methods.base import Layout, Method, MethodOptions, Pins
from circparam.methods.convex import convex
from circparam.registry import Row, Table
from circparam.weights import WEIGHTS

__all__ = ["METHODS", "Layout", "Method", "MethodOptions", "Pins"]


def _convex_rows() -> list[Row[Method]]:
    """One row for each weight scheme; positive weights on a convex border never flip a face."""
    rows: list[Row[Method]] = []
    for row in WEIGHTS:
        tags = row.tags | {"convex-border"}
        if "positive" in row.tags:
            tags |= {"flip-free"}
        rows.append(
            Row(
                row.name,
                partial(convex, weights=row.name),
                row.summary,
                row.citation,
                frozenset(tags),
                row.condition,
            )
        )
    return rows


METHODS: Table[Method] = Table("method", *_convex_rows())
