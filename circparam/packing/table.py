"""PACKERS: the ways to place charts, a row each, in the order in which they run.

A packer is one module with a function PackTask → Placement or None, and one row here.
"""

import math

from circparam.core.registry import Row, Table
from circparam.packing.placement import Packer, PackTask, Placement
from circparam.packing.rows import row_placement
from circparam.packing.shelf import shelf_placement
from circparam.packing.skyline import skyline_placement

# Charts up to which the nest packer runs at effort 1. Its work grows with the square of their number, so
# NEST_CHARTS grows with the root of the effort. Nested, 371 to 600 charts cover 1.08 to 1.25 times as much as
# on the skyline, in 4 to 6 s more; 899 charts cover as much, in 14 s more (docs/experiments/packing.md).
NEST_CHARTS = 600

# Charts from which and up to which the skyline runs. Fewer charts are as full without its layout as a start, in
# 0.87 of the time. Of 10,000 triangles the skyline holds 24 % more than rows, in 17 s for 0.5 s.
SKYLINE_FIRST = 20
SKYLINE_CHARTS = 6000


def _nest(task: PackTask) -> Placement | None:
    # linear programs and FFT take 0.15 s to import
    from circparam.packing.nest.strategy import nested

    return nested(task)


PACKERS: Table[Packer] = Table(
    "packer",
    Row(
        "shelf",
        Packer(shelf_placement, instant=True),
        "rows of bounding boxes by falling height",
    ),
    Row(
        "rows",
        Packer(row_placement, lambda shapes, _: shapes.n > SKYLINE_CHARTS),
        "rows by falling height, each let down on the one below",
    ),
    Row(
        "skyline",
        Packer(
            skyline_placement,
            lambda shapes, options: (
                (0 if options.fixed_scale else SKYLINE_FIRST) < shapes.n <= SKYLINE_CHARTS
            ),
        ),
        "charts on the skyline of those below, each where it wastes least",
        "Lévy, Petitjean, Ray and Maillot 2002, section 4.3",
    ),
    Row(
        "nest",
        Packer(_nest, lambda shapes, options: shapes.n <= NEST_CHARTS * math.sqrt(options.effort)),
        "search on masks at many angles, then compaction by linear programs",
        "compaction after Li and Milenkovic 1995",
    ),
)
