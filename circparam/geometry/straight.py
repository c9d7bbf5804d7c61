"""Straight borders of charts: the two perpendicular directions along which most of an outline runs."""

import numpy as np

from circparam.core.arrays import group_sum
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray

BINS_PER_QUARTER = 180  # of a quarter turn: half a degree each
# Border along the directions of a chart, over the side of a square of its area, from which on it is a straight
# one. A square has 4, a regular polygon of 16 sides 0.9 along two perpendicular directions.
LONG_BORDER_SIDES = 1.0
PARALLEL = np.pi / 2 / BINS_PER_QUARTER  # radians from an axis: resolution of directions
# texels: rounding of uv to single precision on the largest page, and of what packing adds
ON_TEXEL = 0.01
_QUARTER = np.pi / 2


@dataclass(frozen=True, eq=False)
class Directions:
    """angle: (n,) of the two perpendicular directions of each chart, 0 ≤ angle < a quarter turn and a bit.
    length: (n,) of the border along them. share: (n,) of the whole border. along: (b,) bool, edges along them.
    """

    angle: FloatArray
    length: FloatArray
    share: FloatArray
    along: BoolArray


def directions(edges: FloatArray, owner: IntArray, n: int) -> Directions:
    """The directions along which most of the border of n charts runs: edges (b, 2), owner (b,) their charts."""
    length = np.hypot(edges[:, 0], edges[:, 1])
    turn = np.mod(np.arctan2(edges[:, 1], edges[:, 0]), _QUARTER)
    # directions of edges in bins, each with its two neighbours: none is torn apart at the end of a bin
    key = np.minimum((turn / _QUARTER * BINS_PER_QUARTER).astype(np.int64), BINS_PER_QUARTER - 1)
    weight = group_sum(length, owner * BINS_PER_QUARTER + key, n * BINS_PER_QUARTER).reshape(
        n, BINS_PER_QUARTER
    )
    near = weight + np.roll(weight, 1, 1) + np.roll(weight, -1, 1)
    best = near.argmax(1)
    whole = near[np.arange(n), best]
    # the mean direction of those edges, about the middle of the best bin
    middle = (best + 0.5) / BINS_PER_QUARTER * _QUARTER
    off = np.mod(turn - middle[owner] + _QUARTER / 2, _QUARTER) - _QUARTER / 2
    along = np.abs(off) <= 1.5 * _QUARTER / BINS_PER_QUARTER
    counted = np.where(along, length, 0.0)
    mean = group_sum(counted * off, owner, n) / np.maximum(group_sum(counted, owner, n), 1e-300)
    share = whole / np.maximum(weight.sum(1), 1e-300)
    return Directions(middle + mean, whole, share, along)


def straight_edges(edges: FloatArray, owner: IntArray, area: FloatArray) -> BoolArray:
    """(b,) bool: border edges along the directions of their chart, where these have a long part of its border.

    edges: (b, 2). owner: (b,) their charts. area: (n,) of the charts.
    """
    found = directions(edges, owner, len(area))
    long = (found.length >= LONG_BORDER_SIDES * np.sqrt(np.maximum(area, 0.0))) & (found.length > 0)
    return found.along & long[owner]


def axis_parallel(edges: FloatArray) -> BoolArray:
    """(b,) bool: edges (b, 2) that lie along an axis, up to half a degree."""
    turn = np.mod(np.arctan2(edges[:, 1], edges[:, 0]), _QUARTER)
    return np.minimum(turn, _QUARTER - turn) <= PARALLEL


def on_multiples(tail: FloatArray, head: FloatArray, block: float) -> BoolArray:
    """(b,) bool: edges tail (b, 2) to head (b, 2), in texels, on a multiple of ``block`` in u or in v."""
    whole = block * np.rint(tail / block)
    off = np.maximum(np.abs(tail - whole), np.abs(head - whole))
    return off.min(1) <= ON_TEXEL
