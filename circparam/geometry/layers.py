"""How many layers of its own chart lie on a point of the plane."""

import numpy as np

from circparam.core.arrays import slices
from circparam.core.types import FloatArray, IntArray
from circparam.geometry.boundary import BoundarySegments
from circparam.geometry.intersect import windings

BLOCK_POINTS = 200_000  # points whose rays are followed together: bounds the memory at about 50 MB


def own_layers(boundary: BoundarySegments, points: FloatArray, chart: IntArray) -> IntArray:
    """(k,) winding number of the boundary of its own chart ((k,) int) about each point (k, 2)."""
    blocks = (windings(boundary, points[k], chart[k]) for k in slices(len(points), BLOCK_POINTS))
    return np.concatenate([np.zeros(0, np.int64), *blocks])
