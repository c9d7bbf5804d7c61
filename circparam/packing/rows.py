"""Rows by size, dropped: very many charts, row by row, each row put on the one below.

A row is an array operation. Its charts lie side by side, and each comes to rest on the columns of the skyline
below. The chart is upright or turned by half, whichever wastes less. Rows take seconds, a skyline minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, ranges
from circparam.core.monitor import Monitor
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles
from circparam.packing.placement import Placement
from circparam.packing.skyline import Bounds, Profiles, ScaleSearch, profiles, scale_for

COLUMNS = 16  # of a chart of average width
PASSES = 6  # scales that are tried: the height used at one tells the next
SHARE = 0.5  # of the pages that grown charts cover in the end, about
ANGLES = 12  # of a quarter turn that are tried for boxes, before the finer ones
SAMPLE = 3000  # charts that tell the scale of many more
SAMPLED = 3  # scales that are tried for the sample
SAFE = 0.997  # of the scale of the sample is tried first: to exceed the page costs a pass
FULL = 0.985  # height used of that there is, at which a page of more than a sample is full
REACHED_BY_SKYLINE = 1.2  # times the scale of rows, at most: 1.08 of 12,000 equal triangles
CLOSE = 1.004  # ratio of a scale that is too large to one that fits, at which the search ends
STEEP = 0.5  # weight of a chart's own top beside the room that it wastes


def row_placement(
    shapes: Shapes, options: PackOptions, monitor: Monitor, boxes: Placement | None = None
) -> Placement | None:
    """Charts in dropped rows at the largest scale found, or at the fixed one; None if none fits.

    boxes: a layout of boxes. The layout by boxes is returned if a sample of very many charts does not reach its
    scale. Gaps between boxes are narrower, and count for more than the shapes of such small charts.
    """
    angle = _angles(shapes, options)
    if options.fixed_scale is not None:
        return _dropped(shapes, options, angle, options.fixed_scale)[0]
    scale = scale_for(shapes, options, SHARE)
    sampled = _scale_by_sample(shapes, options, angle, scale)
    if sampled is not None and boxes is not None and sampled < boxes.scale:
        return boxes
    best: Placement | None = None
    search = ScaleSearch(shapes, options, scale if sampled is None else sampled)
    for _ in range(PASSES):
        placement, fill = _dropped(shapes, options, angle, search.scale)
        best = best if placement is None else placement
        if placement is not None and shapes.n > SAMPLE and fill >= FULL:
            break
        search = search.after(placement is not None, fill)
        if search.closed(CLOSE) or (best is not None and monitor.expired):
            break
    return best


def hopeless(shapes: Shapes, options: PackOptions) -> bool:
    """Whether the user fixed so large a scale that a sample of the charts says that no skyline holds them."""
    scale = options.fixed_scale
    if scale is None:
        return False
    sampled = _scale_by_sample(shapes, options, _angles(shapes, options), scale)
    return sampled is not None and scale > REACHED_BY_SKYLINE * sampled


def _angles(shapes: Shapes, options: PackOptions) -> FloatArray:
    """(n, turns) upright as boxes are least, and turned by half."""
    turns = 1 if options.rotate == "none" else 2
    box = least_box_angles(shapes, options.rotate, steps=ANGLES)
    return np.asarray(box[:, None] + np.arange(turns) * np.pi)


def _scale_by_sample(
    shapes: Shapes, options: PackOptions, angle: FloatArray, scale: float
) -> float | None:
    """Scale that may just fill the pages: that of a sample on a page as much smaller; None for fewer charts.

    scale: tried first. None too where the page of the sample would be hardly smaller, or too small for a chart.
    """
    every = shapes.n // SAMPLE
    side = np.sqrt(options.pages / max(every, 1)) * (options.resolution - 2 * options.border)
    widest = 2 * float(shapes.radius.max()) * scale
    if every < 2 or not 2 * widest < side < 0.8 * options.resolution:
        return None
    box = shapes.boxes(angle[:, 0])
    chosen = np.argsort(box[:, 3] - box[:, 1], kind="stable")[every // 2 :: every]
    sample = shapes.part(chosen)
    page = replace(options, resolution=int(side + 2 * options.border), pages=1)
    search = ScaleSearch(sample, page, scale)
    for _ in range(SAMPLED):
        placement, fill = _dropped(sample, page, angle[np.sort(chosen)], search.scale)
        if abs(fill - 1) <= 1 - FULL:
            break
        search = search.after(placement is not None, fill)
    return SAFE * search.scale


def _dropped(
    shapes: Shapes, options: PackOptions, angle: FloatArray, scale: float
) -> tuple[Placement | None, float]:
    """All charts in rows at a scale: (placement or None, height used over the height there is)."""
    n, turns = angle.shape
    box = np.stack([shapes.boxes(angle[:, j]) for j in range(turns)], 1) * scale
    size = box[:, 0, 2:] - box[:, 0, :2]
    grow = options.gap / 2
    margin = options.border - grow
    room = options.resolution - 2 * margin
    if size[:, 0].max() > options.resolution - 2 * options.border:
        return None, 2.0
    order = np.argsort(-size[:, 1], kind="stable")
    rows, left = _rows(size[order, 0], options)
    x = np.empty(n)
    x[order] = left
    centre = x[:, None] - box[:, :, 0]
    cell = float(max((size[:, 0].mean() + options.gap) / COLUMNS, options.resolution / 8192))
    shape = profiles(shapes, angle, scale, grow, cell, centre)
    column = np.rint((centre.ravel() + shape.left) / cell).astype(np.int64) + 1
    sky = np.zeros(int(options.resolution / cell) + 4, np.float32)
    rest, pick, page = np.zeros(n), np.zeros(n, np.int64), np.zeros(n, np.int64)
    used = 0.0
    tile = 0
    for first, last in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        row = order[first:last]
        best, height, after = _row(shape, sky, row, column, turns)
        if after.max() > room and sky.any() and tile + 1 < options.pages:
            used, tile = used + float(sky.max()), tile + 1
            best, height, after = _row(shape, np.zeros_like(sky), row, column, turns)
        sky = after
        pick[row], rest[row], page[row] = best, height, tile
    fill = (used + float(sky.max())) / (room * options.pages)
    if sky.max() > room:
        return None, max(fill, 1.001)
    k = np.arange(n)
    offset = np.stack([centre[k, pick], rest + margin], 1)
    return Placement(scale, angle[k, pick], offset, page), fill


def _rows(width: FloatArray, options: PackOptions) -> tuple[IntArray, FloatArray]:
    """(where rows of boxes (n,) begin, and n at the end; the left side of each box) in the order given."""
    gap, room = options.box_gap, options.resolution - 2 * options.border
    ends = np.cumsum(width + gap)
    rows = [0]
    while rows[-1] < len(width):
        before = ends[rows[-1] - 1] if rows[-1] else 0.0
        rows.append(max(int(np.searchsorted(ends, before + room + gap)), rows[-1] + 1))
    start = np.array(rows)
    before = np.repeat(np.r_[0.0, ends][start[:-1]], np.diff(start))
    return start, options.border + ends - before - gap - width


def _row(
    shape: Profiles, sky: Bounds, row: IntArray, column: IntArray, turns: int
) -> tuple[IntArray, FloatArray, Bounds]:
    """Charts (k,) put down: (turn of each, height of its centre, the skyline afterwards).

    column: (n · turns,) where the columns of each chart begin at each turn.
    """
    costs, heights, tops = [], [], []
    for j in range(turns):
        e = row * turns + j
        count = shape.start[e + 1] - shape.start[e]
        run = np.cumsum(count) - count
        at = np.repeat(column[e], count) + ranges(count)
        entry = np.repeat(shape.start[e], count) + ranges(count)
        low, high = shape.lower[entry], shape.upper[entry]
        height = np.maximum.reduceat(sky[at] - low, run)
        waste = height + np.add.reduceat(low - sky[at], run) / count
        costs.append(waste + STEEP * (height + np.maximum.reduceat(high, run)))
        heights.append(height)
        chart = np.repeat(np.arange(len(row)), count)
        tops.append((at, np.repeat(height, count) + high, chart))
    best = np.argmin(costs, axis=0)
    after = sky.copy()
    for j, (at, top, chart) in enumerate(tops):
        mine = best[chart] == j
        np.maximum.at(after, at[mine], top[mine])
    return best, np.choose(best, heights), after
