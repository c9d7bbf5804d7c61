"""Rows of bounding boxes: the plain packer, always fast and always right. Others start from it."""

import numpy as np

from circparam.core.types import FloatArray, IntArray
from circparam.packing.options import PackOptions
from circparam.packing.outlines import least_box_angles, least_square_angles
from circparam.packing.placement import PackTask, Placement


def shelf_placement(task: PackTask) -> Placement | None:
    """Rows of boxes by falling height at the largest scale at which they fit; None if they never do.

    A fixed scale is the only one tried. A chart with a box longer than a page is turned to its least square.
    """
    shapes, options = task.shapes, task.options
    angle = least_box_angles(shapes, options.rotate)
    box, scale = shapes.boxes(angle), options.fixed_scale
    if scale is not None:
        long = (box[:, 2:] - box[:, :2]).max(1) * scale > options.room
        if long.any():
            angle = np.where(long, least_square_angles(shapes, options.rotate), angle)
            box = shapes.boxes(angle)
    size = box[:, 2:] - box[:, :2]
    order = np.argsort(-size[:, 1], kind="stable")
    if scale is None:
        scale = _largest_scale(size[order], options)
    placed = None if scale is None else _rows(size[order] * scale, options)
    if placed is None or scale is None:
        return None
    corner, page = np.empty((shapes.n, 2)), np.empty(shapes.n, np.int64)
    corner[order], page[order] = placed
    return Placement(scale, angle, corner - box[:, :2] * scale, page)


def _largest_scale(size: FloatArray, options: PackOptions) -> float | None:
    """Bisection for the scale; None if not even boxes without extent fit."""
    if _rows(np.zeros_like(size), options) is None:
        return None
    low, high = 0.0, options.room / float(size.max(initial=1e-300))
    if _rows(size * high, options) is not None:
        return high
    for _ in range(40):
        middle = (low + high) / 2
        if _rows(size * middle, options) is not None:
            low = middle
        else:
            high = middle
        if high - low < 1e-5 * high:
            break
    return low


def _rows(size: FloatArray, options: PackOptions) -> tuple[FloatArray, IntArray] | None:
    """Lower left corners and pages of boxes (n, 2) sorted by falling height; None if they do not fit."""
    room = options.room
    if size.max(initial=0.0) > room * (1 + 1e-12):
        return None
    start, left = box_rows(size[:, 0], options)
    height = size[start[:-1], 1]
    y, tile, rows = 0.0, 0, []
    for high in height.tolist():
        if y + high > room + 1e-9:
            y, tile = 0.0, tile + 1
        rows.append((options.border + y, tile))
        y += high + options.box_gap
    if tile >= options.pages:
        return None
    row = np.repeat(np.arange(len(rows)), np.diff(start))
    bottom, page = np.array(rows)[row].T
    return np.stack([left, bottom], 1), page.astype(np.int64)


def box_rows(width: FloatArray, options: PackOptions) -> tuple[IntArray, FloatArray]:
    """(where rows of boxes (n,) begin, and n at the end; the left side of each box) in the order given."""
    gap, room = options.box_gap, options.room
    ends = np.cumsum(width + gap)
    rows = [0]
    while rows[-1] < len(width):
        before = ends[rows[-1] - 1] if rows[-1] else 0.0
        last = int(np.searchsorted(ends, before + room + gap + 1e-9, side="right"))
        rows.append(max(last, rows[-1] + 1))
    start = np.array(rows)
    before = np.repeat(np.r_[0.0, ends][start[:-1]], np.diff(start))
    return start, options.border + ends - before - gap - width
