"""Pairs of plane segments that may meet: a grid whose cells follow the segments, refined where it is crowded.

Every pass is a few array operations over all segments of all groups at once. Cells are as wide as two mean
segments of their group. A long segment is divided into pieces, and there are few more pieces than segments.
Crowded cells are swept across the direction of their segments, or quartered where even that leaves many pairs.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from circparam.core.arrays import (
    first_of_runs,
    group_count,
    group_max,
    group_min,
    group_sum,
    ranges,
    sorted_distinct,
    stable_order,
    unit,
)
from circparam.core.types import FloatArray, IntArray

CROWD_ENTRIES = 24  # cells with more entries are quartered
QUARTERING_LEVELS = 24  # at most so many times
ENTRY_GROWTH = 6  # quartering may make so many times more entries
CHUNK_PAIRS = 2_000_000  # pairs handed out at a time
MOST_PAIRS = 200_000_000  # pairs altogether; beyond, each segment meets only its next few of a cell
NEXT_IN_CELL = 32


class _Grid(NamedTuple):
    """One grid for each group: corner, width of its cells, columns, rows, first cell number, slack."""

    x: FloatArray
    y: FloatArray
    width: FloatArray
    columns: IntArray
    rows: IntArray
    offset: IntArray
    slack: FloatArray

    def boxes(self, group: IntArray, cell: IntArray) -> FloatArray:
        """(x, y, width) of cells."""
        row, column = np.divmod(cell - self.offset[group], self.columns[group])
        width = self.width[group]
        return np.stack([self.x[group] + column * width, self.y[group] + row * width, width], 1)


class Candidates:
    """Pairs (i, j), i < j, of segments of one group whose boxes, widened by the reach, overlap.

    start, end: (n, 2). group: (n,) labels 0..; segments of different groups never pair. reach: (n,) distance up
    to which two segments of a group count as near. Iterate for arrays (i, j); a pair may come more than
    once. After the iteration ``crowded`` (k,) holds the groups in which crowded cells left pairs out.
    """

    def __init__(
        self, start: FloatArray, end: FloatArray, group: IntArray, reach: FloatArray
    ) -> None:
        self.start, self.end, self.group, self.reach = start, end, group, reach
        # one array for each axis: reductions over an axis of length 2 are slow
        self.low = [np.minimum(start[:, k], end[:, k]) - reach / 2 for k in (0, 1)]
        self.high = [np.maximum(start[:, k], end[:, k]) + reach / 2 for k in (0, 1)]
        self.length = np.maximum(np.abs(end[:, 0] - start[:, 0]), np.abs(end[:, 1] - start[:, 1]))
        self.crowded = np.zeros(0, np.int64)
        self._spent = 0

    def __iter__(self) -> Iterator[tuple[IntArray, IntArray]]:
        if len(self.start) < 2:
            return
        grid, box = self._grid(), np.zeros((0, 3))
        segment, cell = self._rasterise(grid)
        budget = ENTRY_GROWTH * len(cell) + 10_000
        for level in range(QUARTERING_LEVELS + 1):
            order = stable_order(cell)
            segment, cell = segment[order], cell[order]
            head = first_of_runs(cell)
            count = np.diff(np.concatenate([head, [len(cell)]]))
            many = np.repeat(count, count)
            crowd = many > CROWD_ENTRIES
            yield from self._emit(segment, np.where(crowd, 0, many - 1 - ranges(count)))
            if not crowd.any():
                return
            segment, cell, order = segment[crowd], cell[crowd], order[crowd]
            box = grid.boxes(self.group[segment], cell) if level == 0 else box[order]
            count = count[count > CROWD_ENTRIES]
            cell = np.repeat(np.arange(len(count)), count)
            order, later = self._sweep(segment, cell, box)
            cost = group_sum(later.astype(np.float64), cell, len(count))
            # entries of a cell stay together in ``order``
            done = (cost <= CROWD_ENTRIES * count)[cell]
            if level == QUARTERING_LEVELS or len(segment) > budget:
                done[:] = True
            yield from self._emit(segment[order], np.where(done, later, 0))
            segment, cell, box = self._quarter(segment[~done], cell[~done], box[~done])

    def _grid(self) -> _Grid:
        """The first grid of each group: cells about twice as wide as its mean segment."""
        n = int(self.group.max()) + 1
        number = np.maximum(group_count(self.group, n), 1)
        low = [group_min(self.low[k], self.group, n) for k in (0, 1)]
        high = [group_max(self.high[k], self.group, n) for k in (0, 1)]
        empty = ~np.isfinite(low[0])
        low, high = [np.where(empty, 0.0, v) for v in low], [np.where(empty, 0.0, v) for v in high]
        extent = np.maximum(high[0] - low[0], high[1] - low[1])
        width = np.maximum(
            2 * group_sum(self.length, self.group, n) / number, extent / (4.0 * number + 4)
        )
        width = np.maximum(width, 2 * np.maximum(group_max(self.reach, self.group, n), 0.0))
        width = np.where(width > 0, width, 1.0)
        columns, rows = (((high[k] - low[k]) / width).astype(np.int64) + 2 for k in (0, 1))
        offset = np.concatenate([[0], np.cumsum(columns * rows)[:-1]])
        # the slack covers the rounding of points along a segment
        slack = 1e-12 * (extent + np.maximum(np.abs(low[0]), np.abs(low[1])))
        return _Grid(low[0], low[1], width, columns, rows, offset, slack)

    def _rasterise(self, grid: _Grid) -> tuple[IntArray, IntArray]:
        """(segment, cell) of the first grid, for every cell that the pieces of the segments may touch."""
        width = grid.width[self.group]
        pieces = np.maximum(np.ceil(self.length / width), 1).astype(np.int64)
        segment = np.repeat(np.arange(len(pieces)), pieces)
        g = self.group[segment]
        slack = self.reach[segment] / 2 + grid.slack[g]
        w, k, number = width[segment], ranges(pieces), pieces[segment]
        spans = []
        for axis, origin, cells in ((0, grid.x, grid.columns), (1, grid.y, grid.rows)):
            p = self.start[segment, axis]
            step = (self.end[segment, axis] - p) / number
            p = p + step * k
            low, high = np.minimum(p, p + step) - slack, np.maximum(p, p + step) + slack
            # np.clip takes longer than both
            top = cells[g] - 1
            first = np.minimum(np.maximum(((low - origin[g]) / w).astype(np.int64), 0), top)
            last = np.minimum(np.maximum(((high - origin[g]) / w).astype(np.int64), first), top)
            spans.append((first, last - first + 1))
        (x, wide), (y, tall) = spans
        cell = grid.offset[g] + y * grid.columns[g] + x
        area = wide * tall
        one = area == 1
        if one.all():
            return segment, cell
        many = np.flatnonzero(~one)
        entry = np.repeat(many, area[many])
        k = ranges(area[many])
        spread = cell[entry] + k // wide[entry] * grid.columns[g[entry]] + k % wide[entry]
        return np.concatenate([segment[one], segment[entry]]), np.concatenate([cell[one], spread])

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
        keep = np.ones(cx.shape, bool)
        for k, centre in ((0, cx), (1, cy)):
            keep &= self.low[k][segment][:, None] <= centre + radius
            keep &= self.high[k][segment][:, None] >= centre - radius
        across = np.abs(d[:, :1] * (cy - p[:, 1:]) - d[:, 1:] * (cx - p[:, :1]))
        keep &= across <= radius * np.abs(d).sum(1)[:, None]
        entry, which = np.nonzero(keep)
        boxes = np.stack([x[entry, which], y[entry, which], half[entry]], 1)
        return segment[entry], 4 * cell[entry] + which, boxes

    def _sweep(
        self, segment: IntArray, cell: IntArray, box: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Order of entries inside their cells, and how many behind each one overlap it across the cell.

        The pieces inside the cell are projected on the normal of their mean direction, so parallel segments do
        not meet there.
        """
        p = self.start[segment]
        d = self.end[segment] - p
        double = unit(np.stack([d[:, 0] ** 2 - d[:, 1] ** 2, 2 * d[:, 0] * d[:, 1]], 1))
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
        order = stable_order(key)
        stop = cell * n + np.searchsorted(ranked, high, side="right")
        stop = np.searchsorted(key[order], stop[order])
        return order, np.maximum(stop - 1 - np.arange(len(order)), 0)

    def _emit(self, segment: IntArray, later: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
        """Pairs of each entry with the ``later`` entries behind it, in chunks."""
        if self._spent + int(later.sum()) > MOST_PAIRS:
            short = later > NEXT_IN_CELL
            self.crowded = sorted_distinct(
                np.concatenate([self.crowded, self.group[segment[short]]])
            )
            later = np.minimum(later, NEXT_IN_CELL)
        self._spent += int(later.sum())
        total = np.cumsum(later)
        begin = 0
        while begin < len(later):
            done = int(total[begin - 1]) if begin else 0
            end = max(int(np.searchsorted(total, done + CHUNK_PAIRS, side="right")), begin + 1)
            here = later[begin:end]
            x = begin + np.repeat(np.arange(end - begin), here)
            y = x + 1 + ranges(here)
            i, j = segment[x], segment[y]
            ok = i != j
            for low, high in zip(self.low, self.high, strict=True):
                ok &= (low[i] <= high[j]) & (low[j] <= high[i])
            i, j = i[ok], j[ok]
            if len(i):
                yield np.minimum(i, j), np.maximum(i, j)
            begin = end
