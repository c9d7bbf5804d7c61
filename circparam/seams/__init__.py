"""The ways of cutting a surface open, one row each."""

from collections.abc import Callable
from typing import TypeAlias

from circparam.core.monitor import Monitor
from circparam.core.registry import Row, Table
from circparam.mesh.surface import Surface
from circparam.seams.cut_graph import disk, none
from circparam.seams.options import SeamOptions, Seams

SeamFunction: TypeAlias = Callable[[Surface, SeamOptions, Monitor], Seams]

__all__ = ["SEAMS", "SeamFunction", "SeamOptions", "Seams"]


def _charts(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    from circparam.seams.charts import charts

    return charts(surface, options, monitor)


SEAMS: Table[SeamFunction] = Table(
    "cut",
    Row("charts", _charts, "few charts of bounded distortion, none overlapping itself"),
    Row(
        "disk",
        disk,
        "each component becomes one disk, its handles cut along short loops",
        "Erickson, Whittlesey 2005 (tree-cotree)",
    ),
    Row("none", none, "no seams: every component must be a disk already"),
)
