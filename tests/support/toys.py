"""Rows added to a table from inside a test, and taken away again."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from circparam.core.registry import Row, Table


@contextmanager
def added(table: Table[Any], row: Row[Any]) -> Iterator[Row[Any]]:
    """The table with one row more, inside the block."""
    assert row.name not in table
    rows = table._rows
    rows[row.name] = row
    try:
        yield row
    finally:
        del rows[row.name]
