"""Small charts join their neighbours: face by face where they cannot as a whole."""

from circparam.core.arrays import group_count, mask_of
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import TRIAL
from circparam.seams.moves.glue import Glue, Glues, MergeOptions
from circparam.seams.search import Effort, search
from circparam.seams.segmentation.layout import lay_out_fresh


def absorb(atlas: Atlas, options: MergeOptions, least: int, monitor: Monitor) -> int:
    """Take charts of fewer than ``least`` faces apart and let their neighbours have the pieces.

    Charts of which a part is left over stay as they were. Returns the number of charts below ``least`` that
    have a neighbour and stay.
    """
    n, chart = atlas.charts()
    small = _small(atlas, chart, n, least)
    before = atlas.cut.copy(), atlas.corners.copy()
    while small.any():
        # all edges inside are cut, but for those inside polygons, and the pieces laid out
        atlas.cut |= atlas.surface.inner_edges(small[chart]) & ~atlas.surface.locked
        count, piece = atlas.charts()
        lay_out_fresh(atlas, mask_of(count, piece[small[chart]]), TRIAL)
        # pieces join charts that are not small, from the rim inwards, in as many rounds as a small chart has
        # faces
        pieces = _Pieces(atlas, options, least)
        search(atlas, pieces, options.demands, Effort(rounds=least), monitor)
        now_n, now = atlas.charts()
        left = mask_of(n, chart[small[chart] & _small(atlas, now, now_n, least)[now]])
        if not left.any():
            break
        # the pieces of one chart may have helped those of another: try again without those that failed
        atlas.cut, atlas.corners = before[0].copy(), before[1].copy()
        small &= ~left
    return still_small(atlas, least)


def still_small(atlas: Atlas, least: int) -> int:
    """Number of charts below ``least`` faces that have a neighbour."""
    n, chart = atlas.charts()
    return int(_small(atlas, chart, n, least).sum())


def small_note(atlas: Atlas, least: int) -> list[str]:
    """What to tell about charts below ``least`` faces that have a neighbour, if there are any."""
    left = still_small(atlas, least)
    if not left:
        return []
    return [
        f"{left} charts stay below {least} faces: no neighbour can take them within the distortion bound"
    ]


def _small(atlas: Atlas, chart: IntArray, n: int, least: int) -> BoolArray:
    """(n,) charts below ``least`` faces that have a neighbour."""
    sides = chart[atlas.surface.sides]
    beside = mask_of(n, sides[:, sides[0] != sides[1]])
    return beside & (group_count(chart, n) < least)


class _Pieces(Glue):
    """Glues that join a small chart to one that is not: two pieces that join may fit nowhere."""

    def __init__(self, atlas: Atlas, options: MergeOptions, least: int) -> None:
        super().__init__(atlas, options)
        self.least = least

    def propose(self, atlas: Atlas) -> Glues:
        """Glues of a small chart and a large one; pairs of large ones have been tried."""
        n, chart = atlas.charts()
        small = (group_count(chart, n) < self.least)[chart[atlas.surface.edges // 3]]
        self.fixed = small[:, 0] == small[:, 1]
        return super().propose(atlas)
