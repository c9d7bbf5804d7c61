"""Points of a layout near a few places."""

import numpy as np

from circparam.core.arrays import group_boxes
from circparam.core.compiled import kd_tree
from circparam.core.types import BoolArray, FloatArray, IntArray


def centres(uv: FloatArray, faces: IntArray) -> FloatArray:
    """(m, 2) centre of each face (m, 3) of a layout (n, 2)."""
    return (uv[faces[:, 0]] + uv[faces[:, 1]] + uv[faces[:, 2]]) / 3


def within(
    points: tuple[FloatArray, IntArray], places: tuple[FloatArray, IntArray], reach: FloatArray
) -> BoolArray:
    """(m,) bool: points that have a place of their own group nearer than the reach of the group.

    points, places: (m, 2) and (k, 2) with their groups (m,) and (k,). reach: (n,) by groups.
    """
    at, group = points
    to, of = places
    low, high = group_boxes(to, of, len(reach))
    whole = np.isinf(reach) & np.isfinite(low[:, 0])
    out: BoolArray = whole[group]
    with np.errstate(invalid="ignore"):  # a group without places has no box
        near = at >= (low - reach[:, None])[group]
        near &= at <= (high + reach[:, None])[group]
    some = np.flatnonzero(near[:, 0] & near[:, 1] & ~out)
    if len(some) == 0:
        return out
    # groups are layers of space that lie far apart
    apart = 4.0 * float(np.ptp(np.concatenate([at, to]), axis=0).max())
    apart += float(reach[np.isfinite(reach)].max(initial=1.0))
    tree = kd_tree(np.c_[to, of * apart])
    at, group = at[some], group[some]
    far, _ = tree.query(np.c_[at, group * apart], distance_upper_bound=float(reach[of].max()))
    out[some] = far < reach[group]
    return out
