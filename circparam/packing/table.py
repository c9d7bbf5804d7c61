"""PACKERS: the ways to place charts, a row each, in the order in which they run.

A packer is one module with a function PackTask → Placement or None, and one row here.
"""

import math

from circparam.core.registry import Row, Table
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles
from circparam.packing.placement import Packer, PackTask, Placement
from circparam.packing.rows import ANGLE_STEPS, row_placement
from circparam.packing.shelf import shelf_placement
from circparam.packing.skyline import skyline_placement

# Charts up to which the nest packer runs at effort 1. Its work grows with the square of their number, so
# NEST_CHARTS grows with the root of the effort.
NEST_CHARTS = 200

# Numbers of charts between which the skyline runs. Of more than 40 its layout is at times the better start of
# the compaction. Of 10,000 triangles it holds 24 % more than rows, in 17 s for 0.5 s.
SKYLINE_CHARTS = 40, 6000


def _few_enough_to_nest(shapes: Shapes, options: PackOptions) -> bool:
    return shapes.n <= NEST_CHARTS * math.sqrt(options.effort)


def _many_enough_for_skyline(shapes: Shapes, options: PackOptions) -> bool:
    return SKYLINE_CHARTS[0] < shapes.n <= SKYLINE_CHARTS[1]


def _too_many_for_skyline(shapes: Shapes, options: PackOptions) -> bool:
    return shapes.n > SKYLINE_CHARTS[1]


def _shelf(task: PackTask) -> Placement | None:
    shapes, options = task.shapes, task.options
    if not task.monitor.expired and shapes.n <= SKYLINE_CHARTS[1]:
        return shelf_placement(shapes, options)
    angle = least_box_angles(shapes, options.rotate, steps=ANGLE_STEPS)
    return shelf_placement(shapes, options, angle)


def _skyline(task: PackTask) -> Placement | None:
    if _too_many_for_skyline(task.shapes, task.options):
        return None
    return skyline_placement(task.shapes, task.options, task.monitor, _best_scale(task))


def _rows(task: PackTask) -> Placement | None:
    return row_placement(task.shapes, task.options, task.monitor, _best_scale(task))


def _best_scale(task: PackTask) -> float:
    """The largest scale that another packer has reached; 0 for none."""
    return max((placement.scale for placement in task.found.values()), default=0.0)


def _nest(task: PackTask) -> Placement | None:
    # linear programs and FFT take 0.15 s to import
    from circparam.packing.nest.strategy import nested

    return nested(task)


PACKERS: Table[Packer] = Table(
    "packer",
    Row(
        "shelf",
        Packer(_shelf, instant=True),
        "rows of bounding boxes by falling height",
    ),
    Row(
        "rows",
        Packer(_rows, _too_many_for_skyline),
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
