"""Scan conversion, a z-buffer and gaps between labels in plain NumPy: no loop over faces or pixels.

``fragments`` samples triangles: each centre belongs to one of two faces that share an edge, as a picture
wants it. ``row_crossings`` is the scan conversion of closed boundaries, where the inside is found by counting.
Pixels and texels have their centres at k + ½.
"""

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import blocks, ranges, slices
from circparam.core.compiled import kd_tree
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray

LabelGrid: TypeAlias = npt.NDArray[np.int32]

CHUNK_FRAGMENTS = 4_000_000  # fragments at once: bounds the memory at about 0.3 GB
# rows of a page at once: arrays of 4096 texels a row stay in the cache, a third of the time
BAND_ROWS = 32
# texels: a gap looked for up to here is found offset by offset, beyond by trees, in less time there
NEAR_TEXELS = 16


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
        left, right = extremes(x)
        first, last = (np.clip(np.ceil(end - 0.5), 0, height) for end in extremes(y))
        seen = (last > first) & (right > 0.5) & (left <= width - 0.5)
        # a sum is finite if all its terms are; coordinates too large for that are no pixels
        seen &= np.isfinite(x[:, 0] + x[:, 1] + x[:, 2] + y[:, 0] + y[:, 1] + y[:, 2])
    face = np.flatnonzero(seen)
    # corners by rising y, equal ones as they stood
    xs, ys = list(x[face].T), list(y[face].T)
    for a, b in ((0, 1), (1, 2), (0, 1)):
        swap = ys[a] > ys[b]
        for c in (xs, ys):
            c[a], c[b] = np.where(swap, c[b], c[a]), np.where(swap, c[a], c[b])
    x, y = np.stack(xs, 1), np.stack(ys, 1)
    top = first[face].astype(np.int64)
    rows = last[face].astype(np.int64) - top
    # an upper bound of each face's pixels decides where the chunks end
    most = rows * np.minimum((right - left)[face] + 1, width)
    for part in blocks(most.astype(np.int64), CHUNK_FRAGMENTS):
        if rows[part].size:
            yield _fill(x[part], y[part], face[part], top[part], rows[part], width)


def extremes(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """((m,) least, (m,) largest of three values (m, 3)): columns at a time, which is several times faster."""
    a, b, c = values[:, 0], values[:, 1], values[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


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
    Returns ((height, width) face or −1, (height, width) depth, infinite if empty,
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


def shared_texels(page: LabelGrid, start: FloatArray, end: FloatArray, owner: IntArray) -> int:
    """Number of texels that the outlines of two charts run through, or one where another chart covers.

    start, end: (b, 2) outline edges in texels, sampled every half texel; owner: (b,).
    """
    count = np.ceil(np.sqrt(((end - start) ** 2).sum(1)) * 2).astype(np.int64) + 1
    edge = np.repeat(np.arange(len(start)), count)
    t = (ranges(count) / np.maximum(count[edge] - 1, 1))[:, None]
    p = np.floor(start[edge] * (1 - t) + end[edge] * t).astype(np.int64)
    size = len(page)
    texel = np.clip(p[:, 1], 0, size - 1) * size + np.clip(p[:, 0], 0, size - 1)
    who, own = page.ravel()[texel], owner[edge].astype(page.dtype)
    last = np.empty(size * size, page.dtype)
    last[texel] = own  # one of the lines through it
    if not ((last[texel] != own) | ((who >= 0) & (who != own))).any():
        return 0
    low = np.full(size * size, np.iinfo(page.dtype).max, page.dtype)
    high = np.full(size * size, -1, page.dtype)
    np.minimum.at(low, texel, own)
    np.maximum.at(high, texel, own)
    touched = np.flatnonzero(high >= 0)
    who = page.ravel()[touched]
    foreign = (who >= 0) & (who != low[touched])
    return int(((low[touched] != high[touched]) | foreign).sum())


def row_crossings(
    start: FloatArray, end: FloatArray, height: int
) -> tuple[IntArray, IntArray, FloatArray]:
    """Where edges cross the lines through the centres of rows 0..height−1, y = row + ½.

    start, end: (e, 2). An edge crosses a row if its lower end is at or below the row's line and its upper end
    above. A shared end point then counts once, so a closed boundary crosses each row an even number of times.
    Returns (edge (k,), row (k,), x (k,)), edges in ascending order.
    """
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    first = np.clip(np.ceil(low - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), 0, height).astype(np.int64)
    count = last - first
    edge = np.repeat(np.arange(len(start)), count)
    row = first[edge] + ranges(count)
    t = (row + 0.5 - start[edge, 1]) / (end[edge, 1] - start[edge, 1])
    return edge, row, start[edge, 0] + t * (end[edge, 0] - start[edge, 0])


def smallest_gap(grid: LabelGrid, search: int) -> tuple[float, tuple[int, int] | None]:
    """Smallest distance between texels of two labels (≥ 0), looked for up to ``search``; and the two labels.

    grid: (h, w), −1 if empty. (infinity, None) where there is none within the search.
    """
    if search > NEAR_TEXELS:
        at, own = _ends(grid)
        return _gap_by_trees(np.stack(np.divmod(at, grid.shape[1]), 1), own, search)
    for distance, own, other in _neighbours(grid, search):
        pair = sorted((int(own[0]), int(other[0])))
        return distance, (pair[0], pair[1])
    return np.inf, None


def crowded_labels(grid: LabelGrid, gap: int) -> IntArray:
    """Labels with a texel nearer than ``gap`` to one of another label; of a wide gap only the nearest two."""
    if gap > NEAR_TEXELS:
        distance, pair = smallest_gap(grid, gap)
        return np.array(pair if pair is not None and distance < gap else (), np.int64)
    found = [np.r_[own, other] for far, own, other in _neighbours(grid, gap) if far < gap]
    return np.unique(np.concatenate(found)) if found else np.zeros(0, np.int64)


def _ends(grid: LabelGrid) -> tuple[IntArray, LabelGrid]:
    """((k,) texels where a label ends, (k,) their labels): texels nearest to another label are such."""
    high, wide = grid.shape
    found = [np.zeros(0, np.int64)]
    for k in slices(high, BAND_ROWS):
        here = grid[k]
        # no texel of the border has four neighbours
        inner = np.zeros(here.shape, bool)
        inner[:, 1:-1] = (here[:, 1:-1] == here[:, 2:]) & (here[:, 1:-1] == here[:, :-2])
        first, last = int(k.start == 0), len(here) - int(k.stop == high)
        if first < last:
            middle, rows = here[first:last], (k.start + first, k.start + last)
            inner[first:last] &= middle == grid[rows[0] - 1 : rows[1] - 1]
            inner[first:last] &= middle == grid[rows[0] + 1 : rows[1] + 1]
        inner[:first] = inner[last:] = False
        found.append(np.flatnonzero((here >= 0) & ~inner) + k.start * wide)
    at = np.concatenate(found)
    return at, grid.ravel()[at]


def _neighbours(grid: LabelGrid, search: int) -> Iterator[tuple[float, LabelGrid, LabelGrid]]:
    """(distance, labels, other labels at that distance), by rising distance up to ``search``."""
    wide, flat = grid.shape[1], grid.ravel()
    at, own = _ends(grid)
    y, x = np.divmod(at, wide)
    if len(at) and 2 * min(y[0], x.min(), len(grid) - 1 - y[-1], wide - 1 - x.max()) < search:
        # otherwise texels beyond one border would match empty texels along another
        grid = np.pad(grid, search, constant_values=-1)
        wide, flat = grid.shape[1], grid.ravel()
        at = (y + search) * wide + x + search
    dy, dx = np.mgrid[0 : search + 1, -search : search + 1].reshape(2, -1)
    square = dy * dy + dx * dx
    half = ((dy > 0) | (dx > 0)) & (square <= search * search)  # the other half looks back
    order = np.lexsort((dx[half], dy[half], square[half]))
    step = (dy * wide + dx)[half][order]
    for offset, distance in zip(step.tolist(), square[half][order].tolist(), strict=True):
        other = flat[np.minimum(at + offset, len(flat) - 1)]
        hit = (other >= 0) & (other != own)
        if hit.any():
            yield float(np.sqrt(distance)), own[hit], other[hit]


def _gap_by_trees(
    texels: IntArray, label: LabelGrid, search: int
) -> tuple[float, tuple[int, int] | None]:
    """``smallest_gap`` of texels (k, 2) of labels (k,): the work hardly grows with the search.

    Two labels differ in a bit. The nearest texels of two labels are found by searching, for each bit, from the
    texels with the bit to those without.
    """
    names, index = np.unique(label, return_inverse=True)
    best = search * search + 1
    pair: tuple[int, int] | None = None
    for bit in range(int(len(names) - 1).bit_length()):
        with_bit = (index >> bit) & 1 == 1
        a, b = np.flatnonzero(with_bit), np.flatnonzero(~with_bit)
        distance, nearest = kd_tree(texels[b]).query(
            texels[a], distance_upper_bound=np.sqrt(best) + 0.5
        )
        found = np.flatnonzero(np.isfinite(distance))
        near = np.asarray(nearest)[found]
        square = ((texels[a[found]] - texels[b[near]]) ** 2).sum(1)
        if len(square) and square.min() < best:
            k = int(square.argmin())
            best = int(square[k])
            one, other = int(label[a[found[k]]]), int(label[b[near[k]]])
            pair = (min(one, other), max(one, other))
    return (np.inf, None) if pair is None else (float(np.sqrt(best)), pair)


def free_border(grid: LabelGrid) -> int:
    """Empty texels between the covered ones and the nearest border of the page (its side if empty)."""
    covered = grid >= 0
    rows, columns = np.flatnonzero(covered.any(1)), np.flatnonzero(covered.any(0))
    if len(rows) == 0:
        return len(grid)
    last = len(grid) - 1
    return int(min(rows[0], columns[0], last - rows[-1], last - columns[-1]))
