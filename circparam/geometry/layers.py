"""How many layers of its own chart lie on a point of the plane: winding numbers of very many points."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_max, group_min, ranges
from circparam.geometry.boundary import BoundarySegments
from circparam.geometry.intersect import windings

FEW = 200_000  # points up to which each gets a ray of its own
CELL = 1.5  # mean lengths of a boundary segment that a cell is wide
CELLS = 1.0  # at most so many for each point, in the boxes of all charts


def own_layers(boundary: BoundarySegments, points: FloatArray, chart: IntArray) -> IntArray:
    """(k,) winding number of the boundary of its own chart ((k,) int) about each point (k, 2).

    Rays of many points of a large chart would meet its whole boundary over and over. In a grid, points in cells
    without a boundary share the value of the middle of their cell. Only points beside boundaries get rays.
    """
    out = np.zeros(len(points), np.int64)
    left = np.arange(len(points))
    if len(points) > FEW:
        known, layers = _of_cells(boundary, points, chart)
        out[known] = layers
        left = np.flatnonzero(~known)
    at, _, turns = windings(boundary, points[left], chart[left], own=True)
    out[left[at]] = turns
    return out


def _of_cells(
    boundary: BoundarySegments, points: FloatArray, chart: IntArray
) -> tuple[BoolArray, IntArray]:
    """((k,) bool: no boundary of its chart touches the cell of the point, layers of those points)."""
    s, e, of = boundary.start, boundary.end, boundary.chart
    n = len(boundary.size)
    low = np.stack([group_min(s[:, d], of, n) for d in range(2)], 1)
    high = np.stack([group_max(s[:, d], of, n) for d in range(2)], 1)
    empty = ~np.isfinite(low[:, 0])
    low[empty] = high[empty] = 0.0
    span = high - low
    length = np.sqrt(((e - s) ** 2).sum(1))
    side = max(
        CELL * float(length.mean()), float(np.sqrt(span.prod(1).sum() / (CELLS * len(points))))
    )
    size = np.floor(span / side).astype(np.int64) + 4  # a ring of cells that nothing reaches
    start = np.r_[0, np.cumsum(size.prod(1))]

    def cells(p: FloatArray, c: IntArray) -> IntArray:
        """Cell of each point p of chart c."""
        at = np.floor((p - low[c]) / side).astype(np.int64) + 1
        at = np.clip(at, 0, size[c] - 1)
        number: IntArray = start[c] + at[:, 1] * size[c, 0] + at[:, 0]
        return number

    touched = np.zeros(start[-1], bool)
    steps = np.ceil(length / side).astype(np.int64) + 1
    k = np.repeat(np.arange(len(s)), steps)
    t = (ranges(steps) / np.maximum(steps - 1, 1)[k])[:, None]
    on = cells(s[k] + t * (e[k] - s[k]), of[k])
    for up in (-1, 0, 1):  # a place on a segment is nearer than a cell to one of these
        for aside in (-1, 0, 1):
            touched[np.clip(on + up * size[of[k], 0] + aside, 0, len(touched) - 1)] = True
    cell = cells(points, chart)
    known = ~touched[cell]
    return known, _winding(boundary, low, side, size, start)[cell[known]]


def _winding(
    boundary: BoundarySegments, low: FloatArray, side: float, size: IntArray, start: IntArray
) -> IntArray:
    """(cells,) winding number about the middle of each: the boundary parts on its right, summed row by row."""
    s, e, of = boundary.start, boundary.end, boundary.chart
    # rows whose middle lies between both ends, the lower one counted
    a, b = (np.ceil((y[:, 1] - low[of, 1]) / side - 0.5).astype(np.int64) + 1 for y in (s, e))
    count = np.abs(b - a)
    k = np.repeat(np.arange(len(s)), count)
    row = np.minimum(a, b)[k] + ranges(count)
    y = low[of[k], 1] + (row - 0.5) * side
    share = (y - s[k, 1]) / (e[k, 1] - s[k, 1])
    x = s[k, 0] + share * (e[k, 0] - s[k, 0])
    # middles left of x
    column = np.ceil((x - low[of[k], 0]) / side - 0.5).astype(np.int64)
    column = np.clip(column, 0, size[of[k], 0] - 1)
    at = start[of[k]] + row * size[of[k], 0] + column
    passed = np.bincount(at, np.where(b > a, 1.0, -1.0)[k], start[-1])
    # a row of a closed boundary sums up to nothing, so that one sum goes through all
    layers: IntArray = np.rint(np.cumsum(passed[::-1])[::-1]).astype(np.int64)
    return layers
