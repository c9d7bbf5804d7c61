"""Charts with straight borders: the angle at which most of their outline runs along the axes of the page."""

import numpy as np

from circparam.core.arrays import mask_of
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray
from circparam.geometry.straight import directions, straight_edges
from circparam.packing.outlines import Shapes

# share of an outline that runs along two perpendicular directions where a chart counts
STRAIGHT_SHARE = 0.5
EXACT_RADIANS = 1e-9  # radians within which a chart lies along the axes
_QUARTER = np.pi / 2


@dataclass(frozen=True, eq=False)
class Straight:
    """angle: (n,) the angle that lays most of each outline along the axes, within a quarter turn. counts: (n,)
    whether this border is long enough for the chart to lie along the axes."""

    angle: FloatArray
    counts: BoolArray

    def lying(self, angle: FloatArray) -> BoolArray:
        """(n,) the charts that count and lie along the axes at angles (n,)."""
        off = np.mod(angle - self.angle + _QUARTER / 2, _QUARTER) - _QUARTER / 2
        return self.counts & (np.abs(off) < EXACT_RADIANS)


def along_axes(shapes: Shapes) -> Shapes:
    """The charts, with upright charts if most of their straight border lies along the axes."""
    along = shapes.points[shapes.end] - shapes.points[shapes.start]
    owner = shapes.owner[shapes.start]
    counts = mask_of(shapes.n, owner[straight_edges(along, owner, shapes.area)])
    angle = straight_charts(shapes, np.inf).angle
    return shapes.turned(np.where(counts, angle, 0.0), counts) if counts.any() else shapes


def straight_charts(shapes: Shapes, longest: float) -> Straight:
    """Which charts have long straight or perpendicular borders; those longer than ``longest`` may lie askew."""
    edges = shapes.points[shapes.end] - shapes.points[shapes.start]
    found = directions(edges, shapes.owner[shapes.start], shapes.n)
    angle = -found.angle
    short = shapes.sizes(angle).max(1) <= longest
    return Straight(angle, (found.share >= STRAIGHT_SHARE) & short)
