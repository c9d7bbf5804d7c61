"""What seams cost where they are hardly seen: the less, the fewer directions see an edge."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.geometry.visibility import edge_shares
from circparam.mesh.surface import Surface

DIRECTIONS = 64
FEWER, LARGE = 24, 20_000  # directions for surfaces of more faces than that
PIXELS = 128
TYPICAL = 0.5  # of the directions see an edge of a convex shape
LEAST = 0.2  # of that: what is seen from fewer is as good as hidden
POWER = 4.0  # of the share in the price, at full strength


def hiding_prices(surface: Surface, strength: float) -> FloatArray:
    """(e,) price of every edge, in its lengths: (share / TYPICAL) to the power POWER · strength.

    share: of all directions from which the edge is seen, and no less than LEAST · TYPICAL. strength: from 0,
    where all edges are alike, to 1. An edge on a convex place costs its length; one down a groove that half as
    many directions see costs a quarter of it at a strength of ½.
    """
    count = DIRECTIONS if len(surface.faces) <= LARGE else FEWER
    share = edge_shares(surface, count, PIXELS)
    price: FloatArray = np.maximum(share / TYPICAL, LEAST) ** (POWER * strength)
    return price
