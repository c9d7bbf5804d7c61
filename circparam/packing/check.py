"""Which texel centres triangles cover, as runs along rows: the cost is rows plus covered texels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import FloatArray, IntArray, cross2, ranges
from circparam.packing.options import PackOptions

# A centre this close to an edge counts as covered (texels): the check errs to the safe side.
_EDGE = 1e-6
_ROWS_AT_ONCE = 1_000_000


def covered_runs(corners: FloatArray, height: int) -> Iterator[tuple[IntArray, ...]]:
    """Runs of covered texels of triangles: corners (m, 3, 2) in texels, centres at k + 1/2.

    Yields (triangle, row, first column, number of columns) of the runs that are not empty, block by block.
    Rows outside 0..height-1 are left out; columns are not clipped.
    """
    p = corners - 0.5
    turned = cross2(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) < 0
    p = np.where(turned[:, None, None], p[:, ::-1], p)
    low = np.maximum(np.ceil(p[:, :, 1].min(1) - _EDGE), 0).astype(np.int64)
    high = np.minimum(np.floor(p[:, :, 1].max(1) + _EDGE), height - 1).astype(np.int64)
    count = np.maximum(high - low + 1, 0)
    block = np.cumsum(count) // _ROWS_AT_ONCE
    edges = np.r_[0, np.flatnonzero(np.diff(block)) + 1, len(p)] if len(p) else np.zeros(1, int)
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        triangle = a + np.repeat(np.arange(b - a), count[a:b])
        row = low[triangle] + ranges(count[a:b])
        first, length = _run(p, triangle, row)
        keep = length > 0
        yield triangle[keep], row[keep], first[keep], length[keep]


def _run(p: FloatArray, triangle: IntArray, row: IntArray) -> tuple[IntArray, IntArray]:
    left = np.full(len(triangle), -np.inf)
    right = np.full(len(triangle), np.inf)
    for k in range(3):
        a, b = p[triangle, k], p[triangle, (k + 1) % 3]
        dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
        # only the edges that reach the row bound it, clamped so that none reaches beyond its ends
        t = (row - a[:, 1]) / np.where(dy == 0, 1.0, dy)
        reaches = np.abs(row - (a[:, 1] + b[:, 1]) / 2) <= np.abs(dy) / 2 + _EDGE
        x = a[:, 0] + np.clip(t, 0.0, 1.0) * dx
        left = np.where((dy < 0) & reaches, np.maximum(left, x), left)
        right = np.where((dy > 0) & reaches, np.minimum(right, x), right)
    ok = np.isfinite(left) & np.isfinite(right)
    first = np.ceil(np.where(ok, left, 0.0) - _EDGE).astype(np.int64)
    last = np.floor(np.where(ok, right, -1.0) + _EDGE).astype(np.int64)
    return first, last - first + 1


def owner_raster(
    corners: FloatArray, owner: IntArray, resolution: int
) -> tuple[npt.NDArray[np.int32], int]:
    """Owner of each texel of one page, −1 where empty; and the number of texels with two owners.

    corners: (m, 3, 2) in texels. owner: (m,) non-negative. Returns ((resolution, resolution) int32, count).
    """
    page = np.full(resolution * resolution, -1, np.int32)
    clashes = 0
    for triangle, row, first, length in covered_runs(corners, resolution):
        left = np.maximum(first, 0)
        count = np.maximum(np.minimum(first + length, resolution) - left, 0)
        texel = np.repeat(row * resolution + left, count) + ranges(count)
        who = np.repeat(owner[triangle], count).astype(np.int32)
        before = page[texel]
        page[texel] = who
        clashes += int(((before >= 0) & (before != who)).sum() + (page[texel] != who).sum())
    return page.reshape(resolution, resolution), clashes


def least_gap(page: npt.NDArray[np.int32], padding: int) -> float:
    """Smallest distance below padding + 1 of covered centres of two owners; infinity where there is none."""
    # the nearest texels of two owners lie on their rims, so only rim texels have to look round
    inner = np.zeros(page.shape, bool)
    core = page[1:-1, 1:-1]
    inner[1:-1, 1:-1] = (
        (core == page[:-2, 1:-1])
        & (core == page[2:, 1:-1])
        & (core == page[1:-1, :-2])
        & (core == page[1:-1, 2:])
    )
    y, x = np.nonzero((page >= 0) & ~inner)
    own = page[y, x]
    wide = np.pad(page, padding, constant_values=-1)
    step = wide.shape[1]
    at = (y + padding) * step + x + padding
    flat = wide.ravel()
    found = np.inf
    for dy in range(padding + 1):
        for dx in range(-padding, padding + 1):
            d2 = dx * dx + dy * dy
            if d2 == 0 or d2 >= (padding + 1) ** 2 or d2 >= found or (dy == 0 and dx < 0):
                continue
            other = flat[at + dy * step + dx]
            if ((other != own) & (other >= 0)).any():
                found = d2
    return float(np.sqrt(found))


def border_distance(page: npt.NDArray[np.int32]) -> int:
    """Number of empty texels between what is covered and the border of the page (its side if empty)."""
    rows, columns = np.flatnonzero((page >= 0).any(1)), np.flatnonzero((page >= 0).any(0))
    if len(rows) == 0:
        return len(page)
    last = len(page) - 1
    return int(min(rows[0], columns[0], last - rows[-1], last - columns[-1]))


def shared_texels(
    page: npt.NDArray[np.int32], start: FloatArray, end: FloatArray, owner: IntArray
) -> int:
    """Number of texels that the outlines of two charts run through, or one where another chart covers.

    start, end: (b, 2) outline edges in texels, sampled every half texel; owner: (b,).
    """
    count = np.ceil(np.sqrt(((end - start) ** 2).sum(1)) * 2).astype(np.int64) + 1
    edge = np.repeat(np.arange(len(start)), count)
    t = (ranges(count) / np.maximum(count[edge] - 1, 1))[:, None]
    p = np.floor(start[edge] * (1 - t) + end[edge] * t).astype(np.int64)
    size = len(page)
    texel = np.clip(p[:, 1], 0, size - 1) * size + np.clip(p[:, 0], 0, size - 1)
    low = np.full(size * size, np.iinfo(np.int32).max, np.int32)
    high = np.full(size * size, -1, np.int32)
    np.minimum.at(low, texel, owner[edge].astype(np.int32))
    np.maximum.at(high, texel, owner[edge].astype(np.int32))
    touched = np.unique(texel)
    who = page.ravel()[touched]
    foreign = (who >= 0) & (who != low[touched])
    return int(((low[touched] != high[touched]) | foreign).sum())


@dataclass(frozen=True, eq=False)
class PlacedCharts:
    """Charts as they lie on their pages, to be checked: in uv of the page each part lies on.

    corners: (m, 3, 2) of the faces, owner: (m,) their charts. start, end: (b, 2) outline edges, edge_owner:
    (b,). page: (n,) page of each chart.
    """

    corners: FloatArray
    owner: IntArray
    start: FloatArray
    end: FloatArray
    edge_owner: IntArray
    page: IntArray


def faults(placed: PlacedCharts, options: PackOptions) -> tuple[str | None, FloatArray]:
    """Check a finished layout on the raster, as single-precision numbers, which formats store.

    Returns (what is wrong or None, (pages,) covered share of each page).
    """
    share = np.zeros(options.pages)
    for tile in range(options.pages):
        on = placed.page[placed.owner] == tile
        texels = _single(placed.corners[on]) * options.resolution
        grid, clashes = owner_raster(texels, placed.owner[on], options.resolution)
        share[tile] = (grid >= 0).mean()
        edges = placed.page[placed.edge_owner] == tile
        start, end = _single(placed.start[edges]), _single(placed.end[edges])
        if start.size and (start.min() < 0 or start.max() > 1):
            return "a chart leaves the page", share
        clashes += shared_texels(
            grid, start * options.resolution, end * options.resolution, placed.edge_owner[edges]
        )
        if clashes:
            return f"{clashes} texels are touched by two charts", share
        gap = least_gap(grid, options.padding)
        if gap < options.padding + 1:
            wrong = f"two charts are {gap:.2f} texels apart where {options.padding + 1} are needed"
            return wrong, share
        border = border_distance(grid)
        if border < options.padding:
            wrong = f"{border} texels are free at the border where {options.padding} are needed"
            return wrong, share
    return None, share


def _single(values: FloatArray) -> FloatArray:
    return values.astype(np.float32).astype(np.float64)
