"""Data of charts that growth does not change: their sampled outlines, tests for contact and overlap."""

from dataclasses import field

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.records import dataclass
from circparam.packing.budget import Budget
from circparam.packing.coverage import outline_runs, painted
from circparam.packing.nest.contacts import (
    Contacts,
    Outlines,
    find_contacts,
    least_distance,
    sample_outlines,
)
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes
from circparam.packing.placement import Placement
from circparam.packing.straight import Straight

# Trust regions beyond the gap within which contacts count. 3 cover as much of the page as 4 with a quarter
# fewer rows; with 2, steps are taken back too often.
REACH_TRUSTS = 3.0

# Share of the gap below which charts have come so near that a tip may be through a neighbour.
CROSSED_SHARE = 0.2

# Side in cells of the raster on which a step is checked: gaps are about a cell wide there, overlap shows.
OVERLAP_CELLS = 256

# Samples of outlines lie at least so many texels apart.
STEP_LEAST_TEXELS = 1.0

# Steps at which outlines are sampled lie on a ladder of this ratio.
STEP_LADDER_RATIO = 2**0.5

# Room in texels for the error of the linear programs: curvature of the outlines and of the turns.
SLACK_TEXELS = 0.02


@dataclass(frozen=True, eq=False)
class Growth:
    """Data of charts that growth does not change, for all layouts of the same charts.

    straight: charts that stay along the axes where they lie so, None for none. sampled: outlines that were
    sampled already, by their step.
    """

    shapes: Shapes
    options: PackOptions
    budget: Budget
    straight: Straight | None = None
    sampled: dict[float, Outlines] = field(default_factory=dict)

    def turning(self, placement: Placement) -> FloatArray:
        """(n,) 1 for charts that may be turned, 0 for fixed ones and for those that stay along the axes."""
        free = np.full(self.shapes.n, float(self.options.rotate == "free"))
        if self.straight is not None:
            free[self.straight.lying(placement.angle)] = 0.0
        return free

    @property
    def unit(self) -> float:
        """Texels of the page in one texel of a page of 2048."""
        return self.options.resolution / 2048

    def outlines(self, step: float) -> Outlines:
        """Samples of all outlines at most ``step`` apart, in the units of the uv given.

        Steps are rounded down to one of a ladder, so that layouts of nearly one scale share their samples.
        """
        rung = STEP_LADDER_RATIO ** np.floor(np.log(step) / np.log(STEP_LADDER_RATIO))
        if rung not in self.sampled:
            self.sampled[rung] = sample_outlines(self.shapes, rung)
        return self.sampled[rung]

    def near(self, placement: Placement, outlines: Outlines, trust: float) -> Contacts:
        """The contacts that a step in a trust region (texels of a page of 2048) has to know of."""
        reach = self.options.gap + SLACK_TEXELS + REACH_TRUSTS * trust * self.unit
        return find_contacts(placement, outlines, reach, max(trust * self.unit, 1.0))

    def overlaps(self, placement: Placement) -> bool:
        """Whether two charts overlap, up to a coarse raster; distances of outlines miss such cases."""
        shapes, side = self.shapes, OVERLAP_CELLS
        own = shapes.owner[shapes.start]
        # outlines of charts that are not simple miss covered cells; the last check sees them
        page = np.where(shapes.simple[own], placement.page[own], -1)
        world = shapes.place(placement.angle, placement.offset, placement.scale)
        world *= side / self.options.resolution
        for tile in range(int(placement.page.max()) + 1):
            on = page == tile
            start, end = shapes.start[on], shapes.end[on]
            runs = outline_runs(world[start], world[end], shapes.owner[start], side)
            if painted(runs, side)[1]:
                return True
        return False

    def crossed(self, found: Contacts) -> bool:
        """Whether charts have come so near that a tip may be through a neighbour."""
        return found.crossing or least_distance(found) < CROSSED_SHARE * self.options.gap
