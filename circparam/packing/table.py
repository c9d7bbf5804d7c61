"""PACKERS: the ways to place charts, a row each, in the order in which they run.

A packer is one module with a function PackTask → Placement or None, and one row here.
"""

from __future__ import annotations

from circparam.core.registry import Row, Table
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles
from circparam.packing.placement import Packer, PackTask, Placement
from circparam.packing.rows import ANGLES, hopeless, row_placement
from circparam.packing.shelf import shelf_placement
from circparam.packing.skyline import skyline_placement

# Charts up to which the nest packer runs, whose time grows with their number; and charts from which the
# skyline runs too. Its layout is sometimes the better start of the compaction.
NESTED_UP_TO = 250
# Rows take a tenth of the time of the skyline and are sometimes as full. Charts too many for the nest packer
# are put into rows too, more than 6000 only into rows.
SKYLINE_ABOVE = 40
SKYLINE_UP_TO = 6000

# Below this effort only so few charts are nested: the grid of many costs seconds before any search.
LITTLE_EFFORT = 0.2
NESTED_WITH_LITTLE_EFFORT = 60


def _few_enough_to_nest(shapes: Shapes, options: PackOptions) -> bool:
    little = options.effort < LITTLE_EFFORT
    return shapes.n <= (NESTED_WITH_LITTLE_EFFORT if little else NESTED_UP_TO)


def _many_enough_for_skyline(shapes: Shapes, options: PackOptions) -> bool:
    return SKYLINE_ABOVE < shapes.n <= SKYLINE_UP_TO


def _too_many_to_nest(shapes: Shapes, options: PackOptions) -> bool:
    return shapes.n > NESTED_UP_TO


def _shelf(task: PackTask) -> Placement | None:
    shapes, options = task.shapes, task.options
    if not task.monitor.expired and shapes.n <= SKYLINE_UP_TO:
        return shelf_placement(shapes, options)
    # of 30,000 charts finer angles take longer than all the rest
    angle = least_box_angles(shapes, options.rotate, steps=ANGLES)
    return shelf_placement(shapes, options, angle)


def _skyline(task: PackTask) -> Placement | None:
    if task.start is not None and _few_enough_to_nest(task.shapes, task.options):
        return None  # nesting continues from there, or asks for the skyline if that fails
    return _on_skyline(task)


def _on_skyline(task: PackTask) -> Placement | None:
    if task.shapes.n > SKYLINE_UP_TO and hopeless(task.shapes, task.options):
        return None
    return skyline_placement(task.shapes, task.options, task.monitor)


def _rows(task: PackTask) -> Placement | None:
    return row_placement(task.shapes, task.options, task.monitor, task.found.get("shelf"))


def _nest(task: PackTask) -> Placement | None:
    from circparam.packing.nest.strategy import (
        nested,  # linear programs and FFT take 0.15 s to import
    )

    def skyline() -> Placement | None:
        wanted = task.start is not None and _many_enough_for_skyline(task.shapes, task.options)
        return _on_skyline(task) if wanted else task.found.get("skyline")

    return nested(task, skyline, shelf=task.found.get("shelf"))


PACKERS: Table[Packer] = Table(
    "packer",
    Row(
        "shelf",
        Packer(_shelf, instant=True),
        "rows of bounding boxes by falling height",
    ),
    Row(
        "rows",
        Packer(_rows, _too_many_to_nest),
        "rows by falling height, each let down on the one below",
    ),
    Row(
        "skyline",
        Packer(_skyline, _many_enough_for_skyline, fallback=True),
        "charts on the skyline of those below, each where it wastes least",
        "Lévy, Petitjean, Ray and Maillot 2002, section 4.3",
    ),
    Row(
        "nest",
        Packer(_nest, _few_enough_to_nest),
        "search on masks at many angles, then compaction by linear programs",
        "compaction after Li and Milenkovic 1995",
    ),
)
