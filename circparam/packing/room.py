"""Room on pages that are in use: charts of fixed sizes go where no other chart lies.

All is drawn on a grid of cells, rather too large than too small: a cell that a triangle touches is used. Charts
are placed as in nesting, the largest first, each where it touches most.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from circparam.core.arrays import ranges
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes, least_box_angles

if TYPE_CHECKING:  # Fourier transforms take 0.1 s to import
    from circparam.packing.nest.masks import Masks
    from circparam.packing.nest.places import Single

# Cells along a page at most: charts get as large on twice as many, to 2 %, in six times the time.
PAGE_CELLS_MOST = 512


@dataclass(frozen=True, eq=False)
class Room:
    """Charts in their places. uv: (nv, 2) in the unit square, u shifted by the page. page: (n,). scale: of the
    sizes asked for."""

    uv: FloatArray
    page: IntArray
    scale: float


def by_page(corners: FloatArray) -> list[FloatArray]:
    """(t, 3, 2) triangles of each page, in its unit square. corners: (m, 3, 2); page k is k to the right."""
    page = np.maximum(np.floor(corners[:, :, 0].mean(1)), 0).astype(np.int64)
    return [corners[page == k] - [k, 0] for k in range(int(page.max(initial=0)) + 1)]


def free_share(pages: Sequence[FloatArray], options: PackOptions) -> float:
    """Free area in pages, without the gaps round placed charts."""
    side = min(options.resolution, PAGE_CELLS_MOST)
    return float(sum(1.0 - cells_of(t * side, side, side).mean() for t in pages))


def find_room(
    shapes: Shapes, pages: Sequence[FloatArray], options: PackOptions, exact: bool
) -> Room | None:
    """Places for charts, whose units are pages, on pages in use; None if there are none.

    pages: (t, 3, 2) triangles on each page, in the unit square. exact: at the sizes of the charts; otherwise
    all shrink alike if needed, by bisection until a size that fits and one that does not differ by 2 %.
    """
    side = min(options.resolution, PAGE_CELLS_MOST)
    # cells round a middle cell with a point nearer than the gap to a point of the middle cell
    gap = options.gap * side / options.resolution
    k = int(np.ceil(gap))
    apart = np.maximum(np.abs(np.arange(-k, k + 1)) - 1, 0)
    reach = np.hypot(apart[:, None], apart) < gap
    border = int(np.ceil(options.border * side / options.resolution))
    used: Single = np.ones((len(pages), side, side), np.float32)
    inner = slice(border, side - border)
    for page, triangles in zip(used, pages, strict=True):
        page[inner, inner] = 0
        _block(page, cells_of(triangles * side, side, side), reach, 0, 0)
    found = _placed(shapes, options, used, reach, 1.0)
    if found is not None or exact:
        return found
    low, high = 1 / 64, 1.0  # at the least, a chart of 64 texels has one
    while high > 1.02 * low:
        middle = float(np.sqrt(low * high))
        got = _placed(shapes, options, used, reach, middle)
        found, low, high = (found, low, middle) if got is None else (got, middle, high)
    return found or _placed(shapes, options, used, reach, low)


def _block(used: Single, cells: BoolArray, reach: BoolArray, row: int, column: int) -> None:
    """Block the cells of a chart at (row, column) of a page, and those in its reach; in place."""
    from scipy.ndimage import binary_dilation

    k = len(reach) // 2
    near = binary_dilation(np.pad(cells, k), reach)
    top, left = max(row - k, 0), max(column - k, 0)
    part = used[top : row - k + near.shape[0], left : column - k + near.shape[1]]
    skip = top - (row - k), left - (column - k)
    part[near[skip[0] :, skip[1] :][: part.shape[0], : part.shape[1]]] = 1


def _placed(
    shapes: Shapes, options: PackOptions, used: Single, reach: BoolArray, scale: float
) -> Room | None:
    """All charts at a scale, the largest first; None if one has no place."""
    from circparam.packing.nest.places import GridPages, spectra_of

    side = used.shape[1]
    angle = least_box_angles(shapes, options.rotate)
    world = shapes.place(angle, np.zeros((shapes.n, 2)), scale * side)
    box = shapes.boxes(angle) * scale * side
    size = box[:, 2:] - box[:, :2]
    if (size.max(1) > side).any():
        return None
    pages = GridPages(used.copy(), side, 2.0)
    order = np.argsort(shapes.chart, kind="stable")
    first = np.searchsorted(shapes.chart[order], np.arange(shapes.n + 1))
    uv, page = np.zeros_like(world), np.zeros(shapes.n, np.int64)
    for c in np.argsort(-size.prod(1), kind="stable").tolist():
        faces = shapes.faces[order[first[c] : first[c + 1]]]
        vertices, local = np.unique(faces, return_inverse=True)
        points = world[vertices] - world[vertices].min(0)
        high, wide = np.maximum(np.ceil(points.max(0)[::-1] - 1e-9).astype(int), 1).tolist()
        cells = cells_of(points[local.reshape(-1, 3)], high, wide)
        masks = _turned(cells, 1 if options.rotate == "none" else 4)
        pick = np.arange(len(masks.angle))
        at = pages.find(masks, spectra_of(masks, side), pick, masks.area)
        if at is None:
            return None
        k, row, column, page[c] = at
        _block(pages.used[page[c]], np.rot90(cells, -k), reach, row, column)
        pages.spectra.pop(int(page[c]), None)
        for _ in range(k):  # a quarter further, grid and all
            points, high, wide = np.stack([high - points[:, 1], points[:, 0]], 1), wide, high
        uv[vertices] = (points + np.array([column, row])) / side
        uv[vertices, 0] += page[c]
    return Room(uv, page, scale)


def _turned(cells: BoolArray, turns: int) -> Masks:
    """The cells (h, w) of a chart turned by quarters."""
    from circparam.packing.nest.masks import Masks

    block = np.zeros((turns, max(cells.shape), max(cells.shape)), bool)
    turned = [np.rot90(cells, -k) for k in range(turns)]
    for mask, one in zip(block, turned, strict=True):
        mask[: one.shape[0], : one.shape[1]] = one
    size = np.array([one.shape for one in turned])
    return Masks(block, size, np.zeros((turns, 2)), np.arange(turns, dtype=np.float64) * np.pi / 2)


def cells_of(triangles: FloatArray, height: int, width: int) -> BoolArray:
    """(height, width) bool, row by y: cells that triangles (t, 3, 2), in cells, touch anywhere.

    The slab of every row of cells cuts each triangle that it meets. The covered part of the row is one
    interval, because triangles are convex.
    """
    t = np.asarray(triangles, np.float64).reshape(-1, 3, 2)
    low = np.clip(np.floor(t[:, :, 1].min(1)), 0, height).astype(np.int64)
    high = np.clip(np.floor(t[:, :, 1].max(1)), -1, height - 1).astype(np.int64)
    count = np.maximum(high - low + 1, 0)
    which = np.repeat(np.arange(len(t)), count)
    row = ranges(count) + low[which]
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for k in range(3):
        a, b = t[which, k], t[which, (k + 1) % 3]
        rise = b[:, 1] - a[:, 1]
        meets = (np.minimum(a[:, 1], b[:, 1]) <= row + 1) & (np.maximum(a[:, 1], b[:, 1]) >= row)
        for y, x in ((a[:, 1], a[:, 0]), (b[:, 1], b[:, 0])):
            inside = np.clip(y, row, row + 1)
            share = np.divide(inside - y, rise, out=np.zeros_like(rise), where=rise != 0)
            at = x + share * (b[:, 0] - a[:, 0])
            left = np.where(meets, np.minimum(left, at), left)
            right = np.where(meets, np.maximum(right, at), right)
    first = np.clip(np.floor(left), 0, width)
    last = np.clip(np.floor(right) + 1, 0, width)
    ok = last > first
    begin = row[ok] * (width + 1) + first[ok].astype(np.int64)
    end = row[ok] * (width + 1) + last[ok].astype(np.int64)
    size = height * (width + 1)
    steps = np.bincount(begin, minlength=size) - np.bincount(end, minlength=size)
    return np.cumsum(steps.reshape(height, width + 1), 1)[:, :width] > 0
