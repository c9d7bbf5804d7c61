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
    # stretches between all beginnings and ends in the order of the texels: empty and covered ones in turn
    begin, stop = row * side + left, row * side + right + 1
    order = np.argsort(begin, kind="stable")
    begin, stop, owner = begin[order], stop[order], owner[order]
    clash = bool((begin[1:] < np.maximum.accumulate(stop)[:-1]).any())
    if clash:
        begin, stop, owner = _disjoint(begin, stop, owner)
    ends = np.r_[0, np.stack([begin, stop], 1).ravel(), side * side]
    kind = np.int16 if owner.max(initial=0) < np.iinfo(np.int16).max else np.int32
    label = np.full(len(ends) - 1, -1, kind)
    label[1::2] = owner
    grid: LabelGrid = np.repeat(label, np.diff(ends)).reshape(side, side)
    clashes = 0
    if clash:
        clashes = int(np.count_nonzero(grid == -2))
        grid[grid == -2] = -1
    return grid, clashes


def _disjoint(
    begin: IntArray, stop: IntArray, owner: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Stretches begin..stop−1 cut where one begins or ends, each once; the owner of those of several is −2."""
    ends, at = np.unique(np.concatenate([begin, stop]), return_inverse=True)
    first, last = np.split(at, 2)
    layers, total = np.zeros((2, len(ends)), np.int64)
    np.add.at(layers, first, 1)
    np.subtract.at(layers, last, 1)
    np.add.at(total, first, owner)
    np.subtract.at(total, last, owner)
    layers, total = np.cumsum(layers)[:-1], np.cumsum(total)[:-1]
    on = layers > 0
    return ends[:-1][on], ends[1:][on], np.where(layers > 1, -2, total)[on]
