"""Scan conversion and a z-buffer in plain NumPy: no display, no GPU, no loop over faces or pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, ranges

CHUNK = 4_000_000  # fragments at once: bounds the memory at about 0.3 GB


@dataclass(frozen=True, eq=False)
class Fragments:
    """Pixels covered by faces: pixel = row · width + column, row 0 at the top."""

    pixel: IntArray
    face: IntArray


def fragments(xy: FloatArray, width: int, height: int) -> Iterator[Fragments]:
    """The pixels whose centres lie in each triangle, in chunks, faces in ascending order.

    xy: (m, 3, 2) corners in pixels, x to the right, y down, the first pixel's centre at (0.5, 0.5).
    Triangles with NaN corners cover nothing.
    """
    x, y = np.ascontiguousarray(xy[..., 0]), np.ascontiguousarray(xy[..., 1])
    with np.errstate(invalid="ignore"):
        first = np.clip(np.ceil(y.min(1) - 0.5), 0, height)
        last = np.clip(np.ceil(y.max(1) - 0.5), 0, height)
        seen = (last > first) & (x.max(1) > 0.5) & (x.min(1) <= width - 0.5)
    face = np.flatnonzero(seen & np.isfinite(xy).all((1, 2)))
    x, y = x[face], y[face]
    order = np.argsort(y, axis=1, kind="stable")
    x, y = np.take_along_axis(x, order, 1), np.take_along_axis(y, order, 1)
    top = first[face].astype(np.int64)
    rows = last[face].astype(np.int64) - top
    # an upper bound of each face's pixels decides where the chunks end
    bound = np.cumsum(rows * np.minimum(np.ptp(x, axis=1) + 1, width))
    ends = np.arange(CHUNK, bound[-1] + CHUNK, CHUNK) if len(bound) else np.zeros(0)
    start = 0
    for stop in np.unique(np.minimum(np.searchsorted(bound, ends) + 1, len(face))):
        part = slice(start, int(stop))
        start = int(stop)
        if rows[part].size:
            yield _fill(x[part], y[part], face[part], top[part], rows[part], width)


def _fill(
    x: FloatArray, y: FloatArray, face: IntArray, top: IntArray, rows: IntArray, width: int
) -> Fragments:
    """Pixels of triangles whose corners are sorted by y."""
    t = np.repeat(np.arange(len(face)), rows)
    row = top[t] + ranges(rows)
    centre = row + 0.5
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (x[:, [2, 1, 2]] - x[:, [0, 0, 1]]) / (y[:, [2, 1, 2]] - y[:, [0, 0, 1]])
    xa = x[t, 0] + (centre - y[t, 0]) * slope[t, 0]
    lower = centre >= y[t, 1]
    corner = lower.astype(np.int64)
    xb = x[t, corner] + (centre - y[t, corner]) * slope[t, 1 + corner]
    left = np.clip(np.ceil(np.minimum(xa, xb) - 0.5), 0, width).astype(np.int64)
    right = np.clip(np.ceil(np.maximum(xa, xb) - 0.5), 0, width).astype(np.int64)
    count = np.maximum(right - left, 0)
    s = np.repeat(np.arange(len(t)), count)
    return Fragments(row[s] * width + left[s] + ranges(count), face[t[s]])


def rasterise(
    xy: FloatArray, width: int, height: int, depth: FloatArray | None = None
) -> tuple[IntArray, FloatArray, IntArray]:
    """The face seen at every pixel.

    xy: (m, 3, 2) corners in pixels. depth: (m, 3), smaller is nearer; without it the lowest face wins.
    Returns ((height, width) face or −1, (height, width) depth, infinite where empty,
    (height, width) number of faces that cover the pixel).
    """
    size = width * height
    best = np.full(size, np.iinfo(np.uint64).max, np.uint64)
    layers = np.zeros(size, np.int64)
    low, span = 0.0, 1.0
    if depth is not None:
        finite = depth[np.isfinite(depth)]
        low = float(finite.min()) if finite.size else 0.0
        span = max(float(finite.max()) - low, 1e-300) if finite.size else 1.0
    for part in fragments(xy, width, height):
        layers += np.bincount(part.pixel, minlength=size)
        key = part.face.astype(np.uint64)
        if depth is not None:
            b = barycentric(xy, part.face, part.pixel, width)
            z = (b * depth[part.face]).sum(1)
            level = ((z - low) / span * 0xFFFF_FFF0).astype(np.uint64)
            key |= level << np.uint64(32)
        np.minimum.at(best, part.pixel, key)
    hit = layers > 0
    face = np.where(hit, (best & np.uint64(0xFFFF_FFFF)).astype(np.int64), -1)
    z_out = np.full(size, np.inf)
    z_out[hit] = low + (best[hit] >> np.uint64(32)).astype(np.float64) / 0xFFFF_FFF0 * span
    shape = (height, width)
    return face.reshape(shape), z_out.reshape(shape), layers.reshape(shape)


def barycentric(xy: FloatArray, face: IntArray, pixel: IntArray, width: int) -> FloatArray:
    """(f, 3) barycentric coordinates of pixel centres in faces; inside the face up to rounding, clamped."""
    px = pixel % width + 0.5
    py = pixel // width + 0.5
    c = xy[face]
    ax, ay = c[:, 1, 0] - c[:, 0, 0], c[:, 1, 1] - c[:, 0, 1]
    bx, by = c[:, 2, 0] - c[:, 0, 0], c[:, 2, 1] - c[:, 0, 1]
    dx, dy = px - c[:, 0, 0], py - c[:, 0, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / (ax * by - ay * bx)
        v = np.nan_to_num((dx * by - dy * bx) * inverse, posinf=0.0, neginf=0.0)
        w = np.nan_to_num((ax * dy - ay * dx) * inverse, posinf=0.0, neginf=0.0)
    out = np.clip(np.stack([1 - v - w, v, w], 1), 0, 1)
    out /= out.sum(1, keepdims=True)
    return out
