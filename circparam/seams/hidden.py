"""What seams cost where they are hardly seen: less, by how few directions see an edge."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.geometry.visibility import edge_shares
from circparam.mesh.surface import Surface

DIRECTIONS = 24  # for prices; what is reported is seen from 64
PIXELS = 128
LEAST = 0.05  # price of an edge that nobody sees, where nothing else counts
TYPICAL = 0.5  # of the directions see an edge on a convex shape


def hiding_prices(surface: Surface, strength: float) -> FloatArray:
    """(e,) price of every edge, in its lengths: 1 − strength · (1 − share / TYPICAL), within LEAST and 1 / LEAST.

    share: of DIRECTIONS from which the edge is seen. strength: 0 (all alike) to 1.
    """
    share = edge_shares(surface, DIRECTIONS, PIXELS)
    return np.maximum(1 - strength * (1 - share / TYPICAL), LEAST)
