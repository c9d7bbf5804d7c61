"""Which packers are asked: by the number of charts, the effort, and the time."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from circparam.packing.options import PackOptions
from circparam.packing.table import PACKERS


@pytest.mark.parametrize(
    ("charts", "effort", "asked"),
    [
        (1, 1.0, ["shelf", "nest"]),
        (40, 1.0, ["shelf", "nest"]),
        (41, 1.0, ["shelf", "skyline", "nest"]),
        (250, 1.0, ["shelf", "skyline", "nest"]),
        (251, 1.0, ["shelf", "rows", "skyline"]),
        (6000, 1.0, ["shelf", "rows", "skyline"]),
        (6001, 1.0, ["shelf", "rows"]),
        (60, 0.19, ["shelf", "skyline", "nest"]),
        (61, 0.19, ["shelf", "skyline"]),
        (61, 0.2, ["shelf", "skyline", "nest"]),
    ],
)
def test_who_applies(charts: int, effort: float, asked: list[str]) -> None:
    shapes, options = SimpleNamespace(n=charts), PackOptions(effort=effort)
    assert [row.name for row in PACKERS if row.function.applies(shapes, options)] == asked
