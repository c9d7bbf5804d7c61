"""Texels covered by charts, from their outlines: much less work than from many faces.

A chart without reversed faces covers a point as often as its outline winds about the point. The degree of the
map counts the faces over the point, none negatively. The chart lies where the winding number is not 0. Charts
with reversed faces, or with edges at which three faces or faces of opposite orientation meet, are scanned face
by face.
"""

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.geometry.raster import EDGE, LabelGrid, covered_runs, row_crossings


@dataclass(frozen=True, eq=False)
class Runs:
    """Covered texels in a row from column ``first`` to ``last``: all (k,), owners non-negative."""

    owner: IntArray
    row: IntArray
    first: IntArray
    last: IntArray

    @classmethod
    def joined(cls, parts: "list[Runs]") -> "Runs":
        """The runs of all parts."""
        return cls(*(np.concatenate([getattr(p, k) for p in parts]) for k in cls.__annotations__))


def face_runs(corners: FloatArray, owner: IntArray, side: int) -> Runs:
    """Runs of faces: corners (m, 3, 2) in texels, owner (m,)."""
    parts = [
        Runs(owner[triangle], row, first, first + length - 1)
        for triangle, row, first, length in covered_runs(corners, side)
    ]
    none = np.zeros(0, np.int64)
    return Runs.joined(parts) if parts else Runs(none, none, none, none)


def outline_runs(start: FloatArray, end: FloatArray, owner: IntArray, side: int) -> Runs:
    """Runs inside closed outlines: edges from start to end (b, 2) in texels, owner (b,).

    Centres on an edge are covered, as in ``covered_runs``.
    """
    edge, row, x = row_crossings(start, end, side)
    up = np.where(end[edge, 1] > start[edge, 1], 1, -1)
    order = np.lexsort((x, row, owner[edge]))
    edge, row, x, up = edge[order], row[order], x[order], up[order]
    # every row of a chart is crossed up as often as down, so one sum serves all of them
    inside = np.flatnonzero(np.cumsum(up)[:-1] != 0) if len(up) else np.zeros(0, np.int64)
    a, b = x[inside], x[inside + 1]
    # rows are crossed where the upper end lies above: centres at the height of a vertex, and on edges along
    # a row, may be missed
    height = [np.rint(p[:, 1] - 0.5) for p in (start, end)]
    level = [np.abs(p[:, 1] - 0.5 - h) <= EDGE for p, h in zip((start, end), height, strict=True)]
    along = np.flatnonzero(level[0] & level[1] & (height[0] == height[1]))
    tip = np.flatnonzero(level[0])
    ends = np.stack([start[along, 0], end[along, 0]])
    low = np.concatenate([a, ends.min(0), start[tip, 0]])
    high = np.concatenate([b, ends.max(0), start[tip, 0]])
    rows = np.concatenate([row[inside], height[0][along], height[0][tip]]).astype(np.int64)
    owners = np.concatenate([owner[edge[inside]], owner[along], owner[tip]])
    first = np.ceil(low - 0.5 - EDGE).astype(np.int64)
    last = np.floor(high - 0.5 + EDGE).astype(np.int64)
    keep = (last >= first) & (rows >= 0) & (rows < side)
    return Runs(owners[keep], rows[keep], first[keep], last[keep])


def painted(runs: Runs, side: int) -> tuple[LabelGrid, int]:
    """Owner of each texel of a page of ``side`` squared, −1 if empty; and how many texels have two owners.

    Texels with two owners are empty on the grid.
    """
    first, last = np.maximum(runs.first, 0), np.minimum(runs.last, side - 1)
    on = np.flatnonzero(last >= first)
    order = on[np.lexsort((first[on], runs.row[on], runs.owner[on]))]
    owner, row = runs.owner[order], runs.row[order]
    left, right = first[order], last[order]
    # runs of one chart in one row are joined where they overlap or touch
    group = owner * side + row
    reach = np.maximum.accumulate(group * side + right) if len(order) else right
    new = np.ones(len(order), bool)
    new[1:] = (group[1:] != group[:-1]) | (group[1:] * side + left[1:] > reach[:-1] + 1)
    head = np.flatnonzero(new)
    right = (reach - group * side)[np.r_[head[1:] - 1, len(order) - 1]] if len(order) else right
    owner, row, left = owner[head], row[head], left[head]
    # beginnings less ends at each texel, summed row by row: after a full row the next begins with its end
    begin, stop = row * side + left, row * side + right + 1
    label = _steps(begin, stop, owner + 1, side, -1)
    first_come = np.argsort(begin, kind="stable")
    clashes = 0
    if (begin[first_come][1:] < np.maximum.accumulate(stop[first_come])[:-1]).any():
        layers = _steps(begin, stop, np.ones_like(owner), side, 0)
        clashes = int(np.count_nonzero(layers > 1))
        label[layers > 1] = -1
    return label, clashes


def _steps(begin: IntArray, stop: IntArray, value: IntArray, side: int, base: int) -> LabelGrid:
    """(side, side) sum of the values of all stretches begin..stop−1 at each place, and ``base``."""
    steps = np.zeros(side * side + 1, np.int32)
    steps[0] = base
    np.add.at(steps, begin, value.astype(np.int32))
    np.subtract.at(steps, stop, value.astype(np.int32))
    return np.cumsum(steps, dtype=np.int32, out=steps)[:-1].reshape(side, side)
