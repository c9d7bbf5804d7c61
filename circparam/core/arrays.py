"""The few array operations that NumPy lacks and every room needs."""

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.compiled import compressed_rows
from circparam.core.types import BoolArray as BoolArray
from circparam.core.types import ComplexArray as ComplexArray
from circparam.core.types import FloatArray as FloatArray
from circparam.core.types import IntArray as IntArray

SLICE_ROWS = 8192  # rows of a large array per slice
BLOCK_ENTRIES = 1_000_000  # entries that rows make at once: bounds the memory at about 0.2 GB


def next_half_edge(h: IntArray) -> IntArray:
    """The next half-edge in the same face: 3f → 3f+1 → 3f+2 → 3f."""
    after = h + 1
    after -= 3 * (after // 3 * 3 == after)
    return after


def ends_of(faces: IntArray, h: IntArray) -> tuple[IntArray, IntArray]:
    """((k,), (k,)) vertices from which and to which half-edges (k,) of faces (m, 3) run."""
    flat = faces.ravel()
    return flat[h], flat[next_half_edge(h)]


def slices(count: int, size: int = SLICE_ROWS) -> list[slice]:
    """Slices through ``count`` rows, a fixed number at a time, so that intermediate arrays stay in the cache.

    Work on all faces of a large mesh takes a half to a fifth of the time, and no further memory.
    """
    return [slice(k, min(k + size, count)) for k in range(0, count, size)]


def blocks(counts: IntArray, most: int = BLOCK_ENTRIES) -> list[slice]:
    """Slices through rows that make so many entries each: about ``most`` entries; at least one slice."""
    ends = np.flatnonzero(np.diff(np.cumsum(counts) // most)) + 1
    return [slice(a, b) for a, b in pairwise([0, *ends.tolist(), len(counts)])]


def edge_keys(a: IntArray, b: IntArray, n: int) -> IntArray:
    """One number for each undirected edge a–b between nodes 0..n−1: the same for a–b and b–a, no two alike."""
    return np.minimum(a, b) * n + np.maximum(a, b)


def ranges(counts: IntArray) -> IntArray:
    """``[0..c0-1, 0..c1-1, ...]`` in one array: the running index inside each group of given size."""
    counts = np.asarray(counts, np.int64)
    total = int(counts.sum())
    return np.arange(total) - np.repeat(np.cumsum(counts) - counts, counts)


def first_of_runs(sorted_keys: IntArray) -> IntArray:
    """Index of the first element of every run of equal values in a sorted array."""
    new = np.ones(len(sorted_keys), bool)
    np.not_equal(sorted_keys[1:], sorted_keys[:-1], out=new[1:])
    return np.flatnonzero(new)


def first_of_groups(groups: IntArray, *keys: npt.NDArray[Any]) -> IntArray:
    """Index of the member of every group that sorts first by the keys, the first of equals; groups ascend.

    keys: (k,) each, as long as ``groups``; the first one counts most.
    """
    order = np.lexsort((*keys[::-1], groups))
    return order[first_of_runs(groups[order])]


def doubles(values: np.ndarray) -> FloatArray:
    """Numbers of a file as float64. A signalling NaN becomes a quiet one, without a warning from NumPy."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def stable_order(keys: IntArray) -> IntArray:
    """The order that sorts keys (n,), equal ones as they stood: ``np.argsort(keys, kind="stable")``.

    Counting sorts by digits, the lowest first. A digit has at most eight times as many values as there are
    keys. This takes a third to an eighth of ``argsort``, which is faster for more than four digits.
    """
    n, longest = len(keys), int(keys.max(initial=1)).bit_length()
    digits = -(-longest // (n.bit_length() + 2))
    if digits > 4 or keys.min(initial=0) < 0:
        return np.argsort(keys, kind="stable")
    bits = -(-longest // digits)
    order = np.arange(n, dtype=np.int32)
    for digit in range(digits):
        rest = keys if digit == 0 else keys[order] >> (digit * bits)
        value = rest if digit == digits - 1 else rest & ((1 << bits) - 1)
        order = compressed_rows(1 << bits, value, order)[1]
    return order.astype(np.int64)


def sorted_distinct(values: IntArray) -> IntArray:
    """The values of an array of any shape, each once, in ascending order.

    ``np.unique`` of NumPy 2.3 and later uses a hash table: 10 to 100 times slower than a sort.
    """
    largest = values.max(initial=0)
    if largest <= 8 * values.size and values.min(initial=0) >= 0:
        return np.flatnonzero(mask_of(int(largest) + 1, values.ravel()))
    ordered = np.sort(values, axis=None)
    return ordered[first_of_runs(ordered)]


def numbered(values: IntArray) -> tuple[IntArray, IntArray]:
    """(the values (n,), each once, ascending; (n,) which of them each is): ``np.unique`` by counting sorts."""
    order = stable_order(values)
    ordered = values[order]
    head = first_of_runs(ordered)
    number = np.repeat(np.arange(len(head)), np.diff(np.append(head, len(values))))
    return ordered[head], scattered(len(values), order, number)


def numbered_rows(rows: FloatArray) -> tuple[IntArray, IntArray]:
    """((k,) the first of each different row of (n, d), in ascending order; (n,) which of these each row is).

    −0 equals 0.
    """
    columns = np.ascontiguousarray(rows.T) + 0.0
    order = np.lexsort(columns[::-1])
    new = np.arange(len(order)) == 0
    for values in columns:
        ordered = values[order]
        new[1:] |= ordered[1:] != ordered[:-1]
    return order[new], scattered(len(order), order, np.cumsum(new) - 1)


def first_of_each(groups: IntArray, n: int) -> IntArray:
    """(n,) the first member of each of ``n`` groups, none of which is empty."""
    out = np.empty(n, np.int64)
    out[groups[::-1]] = np.arange(len(groups))[::-1]  # of several the last one stays
    return out


def interpolated(weights: FloatArray, corners: FloatArray) -> FloatArray:
    """(k, d) values at places with barycentric weights (k, 3) in faces with values (k, 3, d) at the corners."""
    return np.einsum("kc,kcd->kd", weights, corners)


def group_sum(values: FloatArray, groups: IntArray, n: int) -> FloatArray:
    """(n,) or (n, d) sums of the values (k,) or (k, d) of each of ``n`` groups, added in index order."""
    if values.ndim == 2:
        return np.stack([group_sum(column, groups, n) for column in values.T], axis=1)
    return np.bincount(groups, values, n).astype(np.float64, copy=False)


def group_count(groups: IntArray, n: int) -> IntArray:
    """Number of members of each of ``n`` groups."""
    return np.bincount(groups, minlength=n).astype(np.int64, copy=False)


def group_min(values: FloatArray, groups: IntArray, n: int) -> FloatArray:
    """Smallest value of each of ``n`` groups (infinity where a group is empty)."""
    out = np.full(n, np.inf)
    np.minimum.at(out, groups, values)
    return out


def group_max(values: FloatArray, groups: IntArray, n: int) -> FloatArray:
    """Largest value of each of ``n`` groups (minus infinity where a group is empty)."""
    out = np.full(n, -np.inf)
    np.maximum.at(out, groups, values)
    return out


def group_boxes(points: FloatArray, groups: IntArray, n: int) -> tuple[FloatArray, FloatArray]:
    """((n, d) lower, (n, d) upper corner of the box round the points (k, d) of each of ``n`` groups).

    The box of an empty group is infinite, the wrong way round.
    """
    low, high = (np.full((n, points.shape[1]), x) for x in (np.inf, -np.inf))
    np.minimum.at(low, groups, points)
    np.maximum.at(high, groups, points)
    return low, high


def dot(a: FloatArray, b: FloatArray) -> float:
    """Inner product whose rounding does not depend on the number of threads, as that of a BLAS does."""
    return float((a * b).sum())


def dot2(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products of plane vectors, over the last axis: several times as fast as a sum over it."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


def dot3(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products of vectors in space, over the last axis, as ``dot2``."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def cross2(a: FloatArray, b: FloatArray) -> FloatArray:
    """z component of the cross product of plane vectors, over the last axis."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def cross_areas(corners: FloatArray) -> FloatArray:
    """(m,) twice the signed areas of plane triangles (m, 3, 2); positive is counter-clockwise."""
    return cross2(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def normals_of(corners: FloatArray) -> FloatArray:
    """(m, 3) normals of triangles (m, 3, 3), twice their area long."""
    ax, ay, az = (corners[:, 1] - corners[:, 0]).T
    bx, by, bz = (corners[:, 2] - corners[:, 0]).T
    out = np.empty((len(corners), 3))
    out[:, 0], out[:, 1], out[:, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out


def unit(vectors: FloatArray) -> FloatArray:
    """(..., d) vectors of length 1; those of length 0 stay."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def norms2(vectors: FloatArray) -> FloatArray:
    """(n,) lengths of plane vectors (n, 2); sums over an axis of length 2 take NumPy many times as long."""
    x, y = vectors[:, 0], vectors[:, 1]
    return np.sqrt(x * x + y * y)


def mask_of(n: int, places: IntArray | BoolArray) -> BoolArray:
    """(n,) bool: true at some places, false elsewhere."""
    out = np.zeros(n, bool)
    out[places] = True
    return out


def scattered(n: int, places: IntArray | BoolArray, values: IntArray) -> IntArray:
    """(n,) the values at some places, the last of several, −1 elsewhere."""
    out = np.full(n, -1)
    out[places] = values
    return out


def positions_in(n: int, numbers: IntArray) -> IntArray:
    """(n,) where each of the numbers 0 to n − 1 stands in a list without repetitions (k,), −1 if nowhere."""
    return scattered(n, numbers, np.arange(len(numbers)))


def found_in(keys: IntArray, asked: IntArray) -> IntArray:
    """Where each asked number stands among keys (n,) in any order, the first of equal ones; −1 if nowhere."""
    if len(keys) == 0:
        return np.full(asked.shape, -1)
    order = stable_order(keys)
    at = order[np.minimum(np.searchsorted(keys[order], asked), len(keys) - 1)]
    return np.where(keys[at] == asked, at, -1)


def norms3(vectors: FloatArray) -> FloatArray:
    """(n,) lengths of vectors (n, 3), the numbers of ``np.linalg.norm`` in a third of the time."""
    x, y, z = vectors.T
    return np.sqrt(x * x + y * y + z * z)


def doubled_areas(a: FloatArray, b: FloatArray) -> FloatArray:
    """(n,) length of the vector products of rows (n, 3), without the products themselves."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return np.sqrt(x * x + y * y + z * z)


def relabel(labels: IntArray) -> tuple[int, IntArray]:
    """Labels renumbered 0..n-1 in order of first appearance; returns (n, labels)."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = positions_in(len(first), np.argsort(first))
    return len(first), rank[inverse.reshape(-1)]
