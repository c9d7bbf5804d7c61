"""What charts were before a change."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, first_of_runs, group_sum


def main_parts(chart: IntArray, before: IntArray, areas: FloatArray) -> BoolArray:
    """(m,) bool: the face was in that earlier chart from which its chart has most of its area."""
    width = int(before.max()) + 1
    pairs, inverse = np.unique(chart * width + before, return_inverse=True)
    inverse = inverse.reshape(-1)
    area = group_sum(areas, inverse, len(pairs))
    now = pairs // width
    order = np.lexsort((-area, now))
    main = np.zeros(len(pairs), bool)
    main[order[first_of_runs(now[order])]] = True
    result: BoolArray = main[inverse]
    return result
