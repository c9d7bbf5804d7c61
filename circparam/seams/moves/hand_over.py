"""Hand regions over: a region leaves its chart for another one, along a longer seam than it leaves behind."""

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import group_count, group_sum
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.seams.moves.glue import hashed
from circparam.seams.search import Candidates, Outcome


@dataclass(frozen=True, eq=False)
class HandOvers(Candidates):
    """Regions that may leave the chart ``left`` for the chart ``right``, as ``Candidates`` has moves.

    region: (k,) that moves. key: (k,) what was tried is remembered by it. sides: (2, e) region on both sides of
    each edge. chart: (2, e) chart there. cut: (e,) seams.
    """

    region: IntArray
    key: npt.NDArray[np.uint64]
    sides: IntArray
    chart: IntArray
    cut: BoolArray

    def seams(self, chosen: IntArray) -> BoolArray:
        """(e,) seams when some regions have left one chart for the other."""
        out = self.cut.copy()
        joins = np.full(1 + int(self.sides.max(initial=0)), -1)
        joins[self.region[chosen]] = self.right[chosen]
        own, other = self.chart
        between = self.sides[0] != self.sides[1]
        for region, left, right in ((self.sides[0], own, other), (self.sides[1], other, own)):
            moves = between & (joins[region] >= 0)
            out[moves & (right == left)] = True
            out[moves & (right == joins[region])] = False
        return out


class HandOver:
    """Hands regions over, and remembers what was tried while both charts stay as they are.

    region: (m,) of each face; a chart is made of whole regions.
    """

    def __init__(self, region: IntArray) -> None:
        self.region, self.n = region, 1 + int(region.max(initial=-1))
        self.tried = np.zeros(0, np.uint64)

    def propose(self, atlas: Atlas) -> HandOvers:
        """Every region beside a chart along which its seam is longer, scored by the gain for each face."""
        n, chart = atlas.charts()
        sides = self.region[atlas.surface.sides]
        charts = chart[atlas.surface.sides]
        worth = atlas.surface.weighted_lengths
        region, right, seam = _seams(atlas.cut, sides, charts, n, worth)
        inside = (sides[0] != sides[1]) & ~atlas.cut
        held = group_sum(np.tile(worth[inside], 2), sides[:, inside].ravel(), self.n)
        chart_of = np.zeros(self.n, np.int64)
        chart_of[self.region] = chart
        left = chart_of[region]
        size = group_count(chart, n)
        gain = (seam - held[region]) / atlas.surface.unit
        # a chart that is one region is glued to the other as a whole
        may = (gain > 0) & (group_count(self.region, self.n)[region] < size[left])
        key = hashed(region, right, size[left], size[right])
        may &= ~np.isin(key, self.tried)
        score = np.where(may, gain / (size[left] + size[right]), -np.inf)
        return HandOvers(left, right, score, gain, region, key, sides, charts, atlas.cut)

    def learn(self, tried: HandOvers, outcome: Outcome) -> None:
        """What was tried is not tried again while both charts keep their sizes."""
        self.tried = np.union1d(self.tried, tried.key[outcome.chosen])


def _seams(
    cut: BoolArray, sides: IntArray, charts: IntArray, n: int, worth: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """(regions, charts beside them, worth of the seam between both), (k,) each. n: number of charts."""
    on = cut & (charts[0] != charts[1])
    pair = (sides * n + charts[::-1])[:, on].ravel()
    pairs, of = np.unique(pair, return_inverse=True)
    region, right = np.divmod(pairs, n)
    return region, right, group_sum(np.tile(worth[on], 2), of.reshape(-1), len(pairs))
