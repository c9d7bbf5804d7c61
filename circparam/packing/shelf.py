"""Rows of bounding boxes: the plain packer, always fast and always right. Others start from it."""

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles, least_square_angles
from circparam.packing.placement import Placement


def shelf_placement(
    shapes: Shapes, options: PackOptions, angle: FloatArray | None = None
) -> Placement | None:
    """Rows of boxes by falling height at the largest scale at which they fit; None if they never do.

    A fixed scale is the only one tried. A chart with a box longer than a page is turned to its least square.
    """
    if angle is None:
        angle = least_box_angles(shapes, options.rotate)
    box, scale = shapes.boxes(angle), options.fixed_scale
    if scale is not None:
        room = options.resolution - 2 * options.border
        long = (box[:, 2:] - box[:, :2]).max(1) * scale > room
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
    room = options.resolution - 2 * options.border
    low, high = 0.0, room / float(size.max(initial=1e-300))
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
    n, gap, border = len(size), options.box_gap, options.border
    room = options.resolution - 2 * border
    if size.max(initial=0.0) > room * (1 + 1e-12):
        return None
    ends = np.cumsum(size[:, 0] + gap)
    corner, page = np.empty((n, 2)), np.zeros(n, np.int64)
    first, y, tile = 0, 0.0, 0
    while first < n:
        before = ends[first - 1] if first else 0.0
        last = int(np.searchsorted(ends, before + room + gap + 1e-9, side="right"))
        last = max(last, first + 1)
        if y + size[first, 1] > room + 1e-9:
            y, tile = 0.0, tile + 1
            if tile >= options.pages:
                return None
        row = slice(first, last)
        corner[row, 0] = border + ends[row] - before - gap - size[row, 0]
        corner[row, 1] = border + y
        page[row] = tile
        y += size[first, 1] + gap
        first = last
    return corner, page
