"""Pairs of plane segments that may meet: a grid whose cells follow the segments, refined where it is crowded.

Every pass is a few array operations over all segments of all groups at once. Cells are as wide as the mean
segment of their group, so long segments are walked through in as many pieces as there are segments on
average; crowded cells are quartered until they are thin or quartering stops helping, and what is left is swept
along an axis.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from circparam.arrays import (
    FloatArray,
    IntArray,
    first_of_runs,
    group_count,
    group_max,
    group_min,
    group_sum,
    ranges,
)

CROWD = 24  # cells with more entries are quartered
LEVELS = 24  # at most so many times
GROWTH = 6  # quartering may make so many times more entries
CHUNK = 2_000_000  # pairs handed out at a time
LIMIT = 200_000_000  # pairs altogether; beyond, each segment meets only its next few of a cell
FEW = 32


class Candidates:
    """Pairs (i, j), i < j, of segments of one group whose boxes, widened by the reach, overlap.

    start, end: (n, 2). group: (n,) labels 0..; segments of different groups never pair. reach: (n,) distance up
    to which two segments of a group count as near. Iterate for arrays (i, j); a pair may come more than
    once. ``cut_short`` tells, after the iteration, whether cells were so crowded that pairs were left out
    (then ``crowded`` (k,) holds the groups where that happened).
    """

    def __init__(
        self, start: FloatArray, end: FloatArray, group: IntArray, reach: FloatArray
    ) -> None:
        self.start, self.end, self.group, self.reach = start, end, group, reach
        self.low = np.minimum(start, end) - reach[:, None] / 2
        self.high = np.maximum(start, end) + reach[:, None] / 2
        self.crowded = np.zeros(0, np.int64)
        self._spent = 0

    @property
    def cut_short(self) -> bool:
        """Whether pairs were left out."""
        return len(self.crowded) > 0

    def __iter__(self) -> Iterator[tuple[IntArray, IntArray]]:
        if len(self.start) < 2:
            return
        segment, cell, box = self._rasterise()
        budget = GROWTH * len(segment) + 10_000
        for level in range(LEVELS + 1):
            order = np.argsort(cell, kind="stable")
            segment, box = segment[order], box[order]
            head = first_of_runs(cell[order])
            count = np.diff(np.r_[head, len(order)])
            crowd = count > CROWD
            if level == LEVELS or len(segment) > budget:
                crowd[:] = False
                yield from self._sweep(segment, count)
                return
            thin = np.repeat(~crowd, count)
            yield from self._all_pairs(segment[thin], count[~crowd])
            if not crowd.any():
                return
            here = np.repeat(np.arange(int(crowd.sum())), count[crowd])
            segment, cell, box = self._quarter(segment[~thin], here, box[~thin])

    def _rasterise(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Entries of the first grid: segment, cell number, cell (x, y, width)."""
        n = int(self.group.max()) + 1
        origin = np.stack([group_min(self.low[:, k], self.group, n) for k in (0, 1)], 1)
        top = np.stack([group_max(self.high[:, k], self.group, n) for k in (0, 1)], 1)
        length = np.abs(self.end - self.start).max(1)
        number = np.maximum(group_count(self.group, n), 1)
        extent = np.where(np.isfinite(top), top - origin, 0.0).max(1)
        width = np.maximum(group_sum(length, self.group, n) / number, extent / (4.0 * number + 4))
        width = np.maximum(width, 2 * np.maximum(group_max(self.reach, self.group, n), 0.0))
        width = np.where(width > 0, width, 1.0)
        pieces = np.maximum(np.ceil(length / width[self.group]), 1).astype(np.int64)
        segment = np.repeat(np.arange(len(length)), pieces)
        k, number = ranges(pieces), pieces[segment]
        step = self.end[segment] - self.start[segment]
        p = self.start[segment] + step * (k / number)[:, None]
        q = self.start[segment] + step * ((k + 1) / number)[:, None]
        g = self.group[segment]
        # the slack covers the rounding of points along the segment
        slack = (self.reach[segment] / 2 + 1e-12 * (extent[g] + np.abs(origin[g]).max(1)))[:, None]
        w = width[g][:, None]
        columns = np.floor((top - origin) / width[:, None] + 2)
        columns = np.where(np.isfinite(columns), columns, 1).astype(np.int64)
        first = np.floor((np.minimum(p, q) - slack - origin[g]) / w).astype(np.int64)
        last = np.floor((np.maximum(p, q) + slack - origin[g]) / w).astype(np.int64)
        first = np.clip(first, 0, columns[g] - 1)
        last = np.clip(last, first, columns[g] - 1)
        wide, tall = (last - first + 1).T
        cells = wide * tall
        entry = np.repeat(np.arange(len(segment)), cells)
        k = ranges(cells)
        x = first[entry, 0] + k % wide[entry]
        y = first[entry, 1] + k // wide[entry]
        offset = np.r_[0, np.cumsum(columns[:, 0] * columns[:, 1])]
        g = g[entry]
        box = np.stack([origin[g, 0] + x * width[g], origin[g, 1] + y * width[g], width[g]], 1)
        return segment[entry], offset[g] + y * columns[g, 0] + x, box

    def _quarter(
        self, segment: IntArray, cell: IntArray, box: FloatArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Entries of crowded cells, in the quarters of their cell that the segments (widened) touch."""
        half = box[:, 2] / 2
        quarter = np.arange(4)
        x = box[:, :1] + half[:, None] * (quarter % 2)
        y = box[:, 1:2] + half[:, None] * (quarter // 2)
        cx, cy = x + half[:, None] / 2, y + half[:, None] / 2
        p = self.start[segment]
        d = self.end[segment] - p
        scale = np.abs(box[:, :2]).max(1) + box[:, 2]
        radius = (half / 2 + self.reach[segment] / 2 + 1e-12 * scale)[:, None]
        low, high = self.low[segment], self.high[segment]
        keep = (low[:, :1] <= cx + radius) & (high[:, :1] >= cx - radius)
        keep &= (low[:, 1:] <= cy + radius) & (high[:, 1:] >= cy - radius)
        across = np.abs(d[:, :1] * (cy - p[:, 1:]) - d[:, 1:] * (cx - p[:, :1]))
        keep &= across <= radius * np.abs(d).sum(1)[:, None]
        entry, which = np.nonzero(keep)
        boxes = np.stack([x[entry, which], y[entry, which], half[entry]], 1)
        return segment[entry], 4 * cell[entry] + which, boxes

    def _all_pairs(self, segment: IntArray, count: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
        """All pairs inside cells; segment: entries cell by cell, count: entries of each cell."""
        rank = ranges(count)
        later = np.repeat(count, count) - 1 - rank
        yield from self._emit(segment, later)

    def _sweep(self, segment: IntArray, count: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
        """Pairs inside cells whose boxes overlap along one axis: for each cell the better of x and y."""
        cell = np.repeat(np.arange(len(count)), count)
        plans = [self._along(segment, cell, axis) for axis in (0, 1)]
        cost = [group_sum(later.astype(np.float64), cell, len(count)) for _, later in plans]
        for axis, mine in ((0, cost[0] <= cost[1]), (1, cost[0] > cost[1])):
            order, later = plans[axis]
            # the plans keep cells together, so a cell's entries are taken or left as a block
            take = mine[cell]
            ends = np.arange(len(order))[take]
            yield from self._emit_at(segment[order], ends, later[take])

    def _along(self, segment: IntArray, cell: IntArray, axis: int) -> tuple[IntArray, IntArray]:
        """Order of the entries by (cell, lower end), and how many after each one begin before it ends."""
        low, high = self.low[segment, axis], self.high[segment, axis]
        ranked = np.sort(low)
        n = len(segment) + 1
        key = cell * n + np.searchsorted(ranked, low)
        order = np.argsort(key, kind="stable")
        reach = cell * n + np.searchsorted(ranked, high, side="right")
        stop = np.searchsorted(key[order], reach[order])
        return order, np.maximum(stop - 1 - np.arange(len(order)), 0)

    def _emit(self, segment: IntArray, later: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
        yield from self._emit_at(segment, np.arange(len(segment)), later)

    def _emit_at(
        self, segment: IntArray, at: IntArray, later: IntArray
    ) -> Iterator[tuple[IntArray, IntArray]]:
        """Pairs of the entries ``at`` with the ``later`` entries behind each one, in chunks."""
        if self._spent + int(later.sum()) > LIMIT:
            short = later > FEW
            self.crowded = np.union1d(self.crowded, self.group[segment[at[short]]])
            later = np.minimum(later, FEW)
        self._spent += int(later.sum())
        total = np.cumsum(later)
        begin = 0
        while begin < len(later):
            done = int(total[begin - 1]) if begin else 0
            end = max(int(np.searchsorted(total, done + CHUNK, side="right")), begin + 1)
            here = later[begin:end]
            x = np.repeat(at[begin:end], here)
            y = x + 1 + ranges(here)
            i, j = segment[x], segment[y]
            ok = (
                (i != j)
                & (self.low[i] <= self.high[j]).all(1)
                & (self.low[j] <= self.high[i]).all(1)
            )
            i, j = i[ok], j[ok]
            if len(i):
                yield np.minimum(i, j), np.maximum(i, j)
            begin = end
