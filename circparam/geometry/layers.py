"""How many layers of its own chart lie on a point of the plane."""

import numpy as np

from circparam.core.types import FloatArray, IntArray
from circparam.geometry.boundary import BoundarySegments
from circparam.geometry.intersect import windings

BLOCK_POINTS = 200_000  # points whose rays are followed together: bounds the memory at about 50 MB


def own_layers(boundary: BoundarySegments, points: FloatArray, chart: IntArray) -> IntArray:
    """(k,) winding number of the boundary of its own chart ((k,) int) about each point (k, 2)."""
    out = np.zeros(len(points), np.int64)
    for begin in range(0, len(points), BLOCK_POINTS):
        part = slice(begin, begin + BLOCK_POINTS)
        at, _, turns = windings(boundary, points[part], chart[part], own=True)
        out[begin + at] = turns
    return out
