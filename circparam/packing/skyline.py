"""Skyline: many charts come to rest one by one on the skyline of those below, each at its best angle.

After Lévy, Petitjean, Ray and Maillot 2002 ("Least squares conformal maps", section 4.3). The lower and upper
bound of each column stand for a chart, the skyline for the page. A chart comes to rest where it wastes least.
"""

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import ranges
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles
from circparam.packing.placement import PackTask, Placement

Bounds: TypeAlias = npt.NDArray[np.float32]

# Columns of a chart of average width: 24 cover 3 % less (29 sets of 20 to 300 charts) in the same time.
CHART_COLUMNS = 32

# Directions in a turn at which a chart is tried if it may turn freely: 16 cover 1.8 % more in twice the time.
CHART_TURNS = 8

# Ratio of a scale too large to one that fits at which the search ends: 1.005 covers 0.3 % more in 1.3 times the
# time.
CLOSE_RATIO = 1.01


@dataclass(frozen=True, eq=False)
class Profiles:
    """Column bounds of every chart at every angle, in texels; entry k = chart * angles + angle.

    start: (K + 1,) offsets. lower, upper: bounds of each column, grown by half the gap.
    left: (K,) x of the first column's left side relative to the chart's centre.
    """

    start: IntArray
    lower: Bounds
    upper: Bounds
    left: FloatArray


def profiles(
    shapes: Shapes,
    angle: FloatArray,
    scale: float,
    grow: float,
    cell: float,
    centre: FloatArray | None = None,
) -> Profiles:
    """Bounds of charts at angles (n, k), scaled, grown by ``grow`` texels, in columns of ``cell`` texels.

    centre: (n, k) where on a page centres are to lie; columns then begin at multiples of ``cell`` there.
    """
    n, k = angle.shape
    box = np.stack([shapes.boxes(angle[:, j]) for j in range(k)], 1).reshape(n * k, 4) * scale
    pad = int(np.ceil(grow / cell)) + 1
    left = box[:, 0] - pad * cell
    if centre is not None:
        left = np.floor((left + centre.ravel()) / cell) * cell - centre.ravel()
    width = np.ceil((box[:, 2] - left) / cell).astype(np.int64) + pad
    start = np.r_[0, np.cumsum(width)]
    # single precision: half the time, and rounding far below the margin of the gap
    lower = np.full(start[-1], np.inf, np.float32)
    upper = np.full(start[-1], -np.inf, np.float32)
    own = shapes.owner[shapes.start]
    for j in range(k):
        c, s = np.cos(angle[own, j]), np.sin(angle[own, j])
        a, b = (
            np.stack([c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1]], 1) * scale
            for p in (shapes.points[shapes.start], shapes.points[shapes.end])
        )
        entry = own * k + j
        column, low, high = _column_bounds(a, b, left[entry], start[entry], cell)
        np.minimum.at(lower, column, low.astype(np.float32))
        np.maximum.at(upper, column, high.astype(np.float32))
    return _trimmed(start, *_widened(lower, upper, grow, cell), left, cell)


def _trimmed(
    start: IntArray, lower: Bounds, upper: Bounds, left: FloatArray, cell: float
) -> Profiles:
    """Without the empty columns at both ends; an empty one in between (a chart in parts) bounds nothing."""
    filled = np.flatnonzero(np.isfinite(lower))
    first = filled[np.searchsorted(filled, start[:-1])]
    last = filled[np.searchsorted(filled, start[1:]) - 1]
    count = last - first + 1
    trimmed = np.r_[0, np.cumsum(count)].astype(np.int64)
    at = np.repeat(first - trimmed[:-1], count) + np.arange(trimmed[-1])
    left = left + (first - start[:-1]) * cell
    lower, upper = lower[at], upper[at]
    gap = np.isinf(lower)
    if gap.any():
        top = np.repeat(np.maximum.reduceat(upper, trimmed[:-1]), count)
        bottom = np.repeat(np.minimum.reduceat(lower, trimmed[:-1]), count)
        lower, upper = np.where(gap, top, lower), np.where(gap, bottom, upper)
    return Profiles(trimmed, lower, upper, left)


def _column_bounds(
    a: FloatArray,
    b: FloatArray,
    left: FloatArray,
    first: IntArray,
    cell: float,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """(column, lowest, highest y there) of each column that each edge from a to b runs through."""
    swap = a[:, 0] > b[:, 0]
    a, b = np.where(swap[:, None], b, a), np.where(swap[:, None], a, b)
    c0 = np.floor((a[:, 0] - left) / cell).astype(np.int64)
    c1 = np.floor((b[:, 0] - left) / cell).astype(np.int64)
    count = c1 - c0 + 1
    e = np.repeat(np.arange(len(a)), count)
    column = c0[e] + ranges(count)
    slope = (b[:, 1] - a[:, 1]) / np.maximum(b[:, 0] - a[:, 0], 1e-300)
    x = left[e] + column * cell
    y0 = a[e, 1] + np.clip(x - a[e, 0], 0, None) * slope[e]
    y1 = b[e, 1] - np.clip(b[e, 0] - (x + cell), 0, None) * slope[e]
    steep = c0 == c1
    y0, y1 = np.where(steep[e], a[e, 1], y0), np.where(steep[e], b[e, 1], y1)
    return first[e] + column, np.minimum(y0, y1), np.maximum(y0, y1)


def _widened(lower: Bounds, upper: Bounds, grow: float, cell: float) -> tuple[Bounds, Bounds]:
    """Bounds of the charts grown by a disc; the empty columns at both ends of a chart take it up."""
    low, high = lower - np.float32(grow), upper + np.float32(grow)
    for k in range(1, int(np.ceil(grow / cell)) + 2):
        near = (k - 1) * cell
        if near >= grow:
            break
        rise = np.float32(np.sqrt(grow * grow - near * near))
        low[k:] = np.minimum(low[k:], lower[:-k] - rise)
        low[:-k] = np.minimum(low[:-k], lower[k:] - rise)
        high[k:] = np.maximum(high[k:], upper[:-k] + rise)
        high[:-k] = np.maximum(high[:-k], upper[k:] + rise)
    return low, high


def skyline_placement(task: PackTask) -> Placement | None:
    """Charts by falling size on the skyline, at the largest scale found or the fixed one; None if none fits."""
    shapes, options = task.shapes, task.options
    turns = {"free": CHART_TURNS, "90": 4, "none": 1}[options.rotate]
    base = least_box_angles(shapes, options.rotate) * (options.rotate == "free")
    angle = base[:, None] + np.arange(turns) * (2 * np.pi / turns)
    if shapes.upright is not None and options.rotate == "free":
        quarters = base[:, None] + np.arange(turns) % 4 * (np.pi / 2)
        angle = np.where(shapes.upright[:, None], quarters, angle)
    return largest_placement(task, partial(_stacked, shapes, options, angle))


def largest_placement(
    task: PackTask, place: Callable[[float], tuple[Placement | None, float]]
) -> Placement | None:
    """The placement at the largest scale that fits, or at the fixed scale; None if there is none.

    place: a scale in texels per unit → (placement or None, the height used over the height there is). The
    scale of a known layout is tried first; charts that do not fit at this scale are given up. The area of the
    charts, grown by half the gap, predicts the next scale, within the bounds so far.
    """
    shapes, options, least = task.shapes, task.options, task.reached
    if options.fixed_scale is not None:
        return place(options.fixed_scale)[0]
    reach, page = options.gap / 2, options.pages * float(options.resolution) ** 2
    # area of the charts, grown by half the gap, as a polynomial of the scale
    area, boundary = float(shapes.area.sum()), float(shapes.perimeter * reach)
    disc = float(shapes.n * np.pi * reach * reach)

    def scale_for(share: float) -> float:
        """Scale at which the grown charts have a share of the pages as their area."""
        root = np.sqrt(max(boundary * boundary + 4 * area * (share * page - disc), 0.0))
        smallest = 1e-3 / max(shapes.radius.max(), 1e-300)
        return float(max((root - boundary) / (2 * max(area, 1e-300)), smallest))

    best: Placement | None = None
    low, high = 0.0, np.inf
    scale = least or scale_for(0.5)
    while True:
        placement, fill = place(scale)
        if placement is None:
            high = scale
        else:
            best, low = placement, scale
        if (best is None and least) or high < low * CLOSE_RATIO or task.monitor.expired:
            break
        scale = scale_for(float(np.polyval([area, boundary, disc], scale) / page) / fill)
        if low and not low * CLOSE_RATIO < scale < high:
            scale = np.sqrt(low * high) if np.isfinite(high) else low * CLOSE_RATIO
    return best


def _stacked(
    shapes: Shapes, options: PackOptions, angle: FloatArray, scale: float
) -> tuple[Placement | None, float]:
    """Put all charts on the skyline at a scale, the largest and longest first.

    Returns (placement or None, height used over height there is).
    """
    n, k = angle.shape
    size = shapes.sizes(angle[:, 0])
    mean = float(size[:, 0].mean()) * scale + 2 * options.gap
    cell = float(max(mean / CHART_COLUMNS, options.resolution / 4096))
    grow = options.gap / 2
    shape = profiles(shapes, angle, scale, grow, cell)
    margin = options.border - grow
    room = options.resolution - 2 * margin
    columns = int(room / cell)
    longest = size.max(1) * scale
    grown = shapes.area * scale**2 + longest * options.gap
    order = np.argsort(-grown * longest, kind="stable")
    sky = np.zeros((options.pages, columns), np.float32)
    pick, corner, rest = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n)
    page = np.zeros(n, np.int64)
    for c in order.tolist():
        best = (np.inf, 0, 0, 0.0, 0)
        for tile in range(options.pages):
            below = np.zeros(columns + 1, np.float32)
            below[1:] = np.cumsum(sky[tile])
            for j in range(k):
                e = c * k + j
                part = slice(shape.start[e], shape.start[e + 1])
                lowest = _rest(sky[tile], below, shape.lower[part], shape.upper[part])
                if lowest is not None and lowest[0] < best[0]:
                    best = (lowest[0], j, lowest[1], lowest[2], tile)
            _, j, x, y, at = best
            part = slice(shape.start[c * k + j], shape.start[c * k + j + 1])
            if np.isfinite(best[0]) and y + float(shape.upper[part].max()) <= room:
                break
        if not np.isfinite(best[0]):
            return None, 2.0
        pick[c], corner[c], rest[c], page[c] = j, x, y, at
        span = sky[at, x : x + part.stop - part.start]
        np.maximum(span, y + shape.upper[part], out=span)
    fill = float((sky.max(1).sum()) / (room * options.pages))
    if (sky.max(1) > room).any():
        return None, max(fill, 1.001)
    e = np.arange(n) * k + pick
    offset = np.stack([corner * cell - shape.left[e], rest], 1) + margin
    return Placement(scale, angle[np.arange(n), pick], offset, page), fill


def _rest(
    sky: Bounds, below: Bounds, lower: Bounds, upper: Bounds
) -> tuple[float, int, float] | None:
    """Where a chart comes to rest with the least waste: (cost, first column, height of its centre).

    below: (columns + 1,) area below the skyline left of each column.
    """
    w = len(lower)
    if w > len(sky):
        return None
    # windows along the first axis: the maximum then runs over whole rows at once
    step = sky.strides[0]
    windows = np.ndarray((w, len(sky) - w + 1), sky.dtype, sky, 0, (step, step))
    height = (windows - lower[:, None]).max(0)
    waste = height * w + lower.sum() - (below[w:] - below[:-w])
    cost = waste / w + height + upper.max()
    x = int(cost.argmin())
    return float(cost[x]), x, float(height[x])
