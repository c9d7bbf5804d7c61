"""Thick lines on a raster, and averaging it down."""

import numpy as np

from circparam.core.arrays import mask_of, ranges
from circparam.core.types import FloatArray


def draw_lines(
    start: FloatArray,
    stop: FloatArray,
    shape: tuple[int, int],
    radius: float,
    z_buffer: FloatArray | None = None,
    bias: float = 0.0,
) -> FloatArray:
    """Mask of thick line segments with round ends.

    start, stop: (s, 2) pixels, or (s, 3) with a depth that is tested against z_buffer + bias.
    shape: (height, width). radius: half the line's width in pixels. Returns (height, width) of 0 and 1.
    """
    height, width = shape
    mask = np.zeros(shape)
    ok = np.isfinite(start).all(1) & np.isfinite(stop).all(1)
    start, stop = start[ok], stop[ok]
    if len(start) == 0:
        return mask
    steps = np.ceil(np.abs(stop - start)[:, :2].max(1) / 0.7).astype(np.int64) + 1
    steps = np.minimum(steps, 4 * (height + width))
    s = np.repeat(np.arange(len(start)), steps)
    t = (ranges(steps) / np.maximum(steps - 1, 1)[s])[:, None]
    p = start[s] * (1 - t) + stop[s] * t
    column, row = np.floor(p[:, 0]).astype(np.int64), np.floor(p[:, 1]).astype(np.int64)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    if z_buffer is not None:
        inside[inside] &= p[inside, 2] <= z_buffer[row[inside], column[inside]] + bias
    touched = mask_of(height * width, row[inside] * width + column[inside])
    hit = np.flatnonzero(touched)
    reach = int(np.ceil(radius))
    dy, dx = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disk = dx**2 + dy**2 <= radius**2
    for oy, ox in zip(dy[disk].tolist(), dx[disk].tolist(), strict=True):
        r, c = hit // width + oy, hit % width + ox
        keep = (r >= 0) & (r < height) & (c >= 0) & (c < width)
        mask[r[keep], c[keep]] = 1
    return mask


def shrink(image: FloatArray, factor: int) -> FloatArray:
    """Average blocks of factor × factor pixels: (h·f, w·f, c) → (h, w, c)."""
    if factor == 1:
        return image
    h, w = image.shape[0] // factor, image.shape[1] // factor
    return image.reshape(h, factor, w, factor, -1).mean((1, 3))
