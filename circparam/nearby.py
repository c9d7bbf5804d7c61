"""Pairs of plane segments that may meet: a grid whose cells follow the segments, refined where it is crowded.

Every pass is a few array operations over all segments of all groups at once. Cells are as wide as the mean
segment of their group, so long segments are walked through in as many pieces as there are segments on
average. Crowded cells are swept across the direction of their segments, or quartered where even that leaves
many pairs.
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
            segment, cell, box = segment[order], cell[order], box[order]
            head = first_of_runs(cell)
            count = np.diff(np.r_[head, len(order)])
            crowd = count > CROWD
            thin = np.repeat(~crowd, count)
            yield from self._emit(
                segment[thin], np.repeat(count, count)[thin] - 1 - ranges(count)[thin]
            )
            if not crowd.any():
                return
            segment, box, count = segment[~thin], box[~thin], count[crowd]
            here = np.repeat(np.arange(len(count)), count)
            order, later = self._sweep(segment, here, box)
            cost = group_sum(later.astype(np.float64), here, len(count))
            done = (cost <= CROWD * count)[here]  # entries of a cell stay together in ``order``
            if level == LEVELS or len(segment) > budget:
                done[:] = True
            yield from self._emit(segment[order], np.where(done, later, 0))
            segment, cell, box = self._quarter(segment[~done], here[~done], box[~done])

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

    def _sweep(
        self, segment: IntArray, cell: IntArray, box: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Order of entries inside their cells, and how many behind each one overlap it across the cell.

        The pieces inside the cell are projected on the normal of their mean direction, so that segments side
        by side do not meet there whichever way they run.
        """
        p = self.start[segment]
        d = self.end[segment] - p
        double = np.stack([d[:, 0] ** 2 - d[:, 1] ** 2, 2 * d[:, 0] * d[:, 1]], 1)
        double /= np.maximum(np.linalg.norm(double, axis=1), 1e-300)[:, None]
        cells = int(cell.max()) + 1
        angle = np.arctan2(
            group_sum(double[:, 1], cell, cells), group_sum(double[:, 0], cell, cells)
        )
        normal = np.stack([-np.sin(angle / 2), np.cos(angle / 2)], 1)[cell]
        slack = self.reach[segment] / 2 + 1e-12 * (np.abs(box[:, :2]).max(1) + box[:, 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            to_low = (box[:, :2] - slack[:, None] - p) / d
            to_high = (box[:, :2] + (box[:, 2] + slack)[:, None] - p) / d
        enter, leave = np.fmin(to_low, to_high), np.fmax(to_low, to_high)
        enter = np.clip(np.where(d == 0, 0.0, enter).max(1), 0.0, 1.0)
        leave = np.clip(np.where(d == 0, 1.0, leave).min(1), enter, 1.0)
        across = (d * normal).sum(1)
        base = ((p - box[:, :2]) * normal).sum(1)
        one, two = base + enter * across, base + leave * across
        # rounding of the projection, and of the clipping parameter along the whole segment
        slack += 1e-12 * (np.abs(base) + np.abs(d).max(1))
        low, high = np.minimum(one, two) - slack, np.maximum(one, two) + slack
        ranked = np.sort(low)
        n = len(segment) + 1
        key = cell * n + np.searchsorted(ranked, low)
        order = np.argsort(key, kind="stable")
        stop = cell * n + np.searchsorted(ranked, high, side="right")
        stop = np.searchsorted(key[order], stop[order])
        return order, np.maximum(stop - 1 - np.arange(len(order)), 0)

    def _emit(self, segment: IntArray, later: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
        """Pairs of each entry with the ``later`` entries behind it, in chunks."""
        if self._spent + int(later.sum()) > LIMIT:
            short = later > FEW
            self.crowded = np.union1d(self.crowded, self.group[segment[short]])
            later = np.minimum(later, FEW)
        self._spent += int(later.sum())
        total = np.cumsum(later)
        begin = 0
        while begin < len(later):
            done = int(total[begin - 1]) if begin else 0
            end = max(int(np.searchsorted(total, done + CHUNK, side="right")), begin + 1)
            here = later[begin:end]
            x = begin + np.repeat(np.arange(end - begin), here)
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
