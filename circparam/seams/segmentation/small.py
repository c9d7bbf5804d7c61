"""Small charts join their neighbours: face by face where they cannot as a whole."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, IntArray, group_count
from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Cutting
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions

ROUNDS = 24  # of handing pieces out: each lays the neighbours out anew
ROUGH = RelaxOptions(tolerance=1e-3, max_iterations=25)


def absorb(cutting: Cutting, options: MergeOptions, least: int, monitor: Monitor) -> int:
    """Take charts of fewer than ``least`` faces apart and let their neighbours have the pieces.

    Charts of which a part is left over stay as they were. Returns the number of charts below ``least`` that
    have a neighbour and stay.
    """
    n, chart = cutting.charts()
    small = _small(cutting, chart, n, least)
    before = cutting.cut.copy(), cutting.corners.copy()
    while small.any():
        _take_apart(cutting, chart, small)
        _hand_out(cutting, options, least, monitor)
        now_n, now = cutting.charts()
        left = np.zeros(n, bool)
        left[chart[small[chart] & _small(cutting, now, now_n, least)[now]]] = True
        if not left.any():
            break
        # the pieces of one chart may have helped those of another: try again without those that failed
        cutting.cut, cutting.corners = before[0].copy(), before[1].copy()
        small &= ~left
    n, chart = cutting.charts()
    return int(_small(cutting, chart, n, least).sum())


def _small(cutting: Cutting, chart: IntArray, n: int, least: int) -> BoolArray:
    """(n,) charts below ``least`` faces that have a neighbour."""
    e = cutting.surface.edges
    p, q = chart[e[:, 0] // 3], chart[e[:, 1] // 3]
    beside = np.zeros(n, bool)
    beside[np.r_[p[p != q], q[p != q]]] = True
    result: BoolArray = beside & (group_count(chart, n) < least)
    return result


def _take_apart(cutting: Cutting, chart: IntArray, which: BoolArray) -> None:
    """Cut all edges inside some charts, but for those inside polygons, and lay the pieces out."""
    e = cutting.surface.edges
    inside = which[chart[e[:, 0] // 3]] & which[chart[e[:, 1] // 3]]
    cutting.cut |= inside & ~cutting.surface.locked
    n, now = cutting.charts()
    pieces = np.zeros(n, bool)
    pieces[now[which[chart]]] = True
    lay_out_fresh(cutting, pieces, ROUGH)


def _hand_out(cutting: Cutting, options: MergeOptions, least: int, monitor: Monitor) -> None:
    """Merge pieces with charts that are not small, from the rim inwards, until nothing changes."""
    merger = Merger(cutting, options, np.zeros(len(cutting.cut), bool))
    e = cutting.surface.edges
    for _ in range(ROUNDS):
        if monitor.expired:
            break
        n, chart = cutting.charts()
        small = (group_count(chart, n) < least)[chart]
        # two pieces that join may fit nowhere, and large charts have been tried
        merger.fixed = small[e[:, 0] // 3] == small[e[:, 1] // 3]
        if not merger.round(monitor):
            break
