"""Rows by size, dropped: very many charts, row by row, each row put on the one below.

A row is an array operation. Its charts lie side by side, and each comes to rest on the columns of the skyline
below. The chart is upright or turned by half, whichever wastes less. Rows take seconds, a skyline minutes.
"""

from functools import partial

import numpy as np

from circparam.core.arrays import ranges
from circparam.core.types import FloatArray, IntArray
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles
from circparam.packing.placement import PackTask, Placement
from circparam.packing.shelf import box_rows
from circparam.packing.skyline import CHART_COLUMNS, Bounds, Profiles, largest_placement, profiles

# Weight of the height at which a chart ends beside the room that it wastes.
HEIGHT_WEIGHT = 0.5


def row_placement(task: PackTask) -> Placement | None:
    """Charts in dropped rows at the largest scale found, or at the fixed one; None if none fits.

    Charts that do not fit at the scale of a known layout are given up: gaps between boxes are narrower, and
    count for more than the shapes of very small charts.
    """
    shapes, options = task.shapes, task.options
    turns = 1 if options.rotate == "none" else 2
    box = least_box_angles(shapes, options.rotate)
    angle = np.asarray(box[:, None] + np.arange(turns) * np.pi)
    return largest_placement(task, partial(_dropped, shapes, options, angle))


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
    if size[:, 0].max() > options.room:
        return None, 2.0
    order = np.argsort(-size[:, 1], kind="stable")
    rows, left = box_rows(size[order, 0], options)
    x = np.empty(n)
    x[order] = left
    centre = x[:, None] - box[:, :, 0]
    cell = float(max((size[:, 0].mean() + options.gap) / CHART_COLUMNS, options.resolution / 8192))
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
        costs.append(waste + HEIGHT_WEIGHT * (height + np.maximum.reduceat(high, run)))
        heights.append(height)
        chart = np.repeat(np.arange(len(row)), count)
        tops.append((at, np.repeat(height, count) + high, chart))
    best = np.argmin(costs, axis=0)
    after = sky.copy()
    for j, (at, top, chart) in enumerate(tops):
        mine = best[chart] == j
        np.maximum.at(after, at[mine], top[mine])
    return best, np.choose(best, heights), after
