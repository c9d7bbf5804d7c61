"""Triangles as cones from the origin: weights of vectors in them, and exact signs."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.geometry.predicates import SignArray

# A 3 × 3 determinant of entries up to 1 is off by at most so many units of its permanent (Shewchuk 1997,
# orient3d).
BOUND = (7 + 56 * 2.0**-53) * 2.0**-53


def determinants(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(k,) determinant of the rows a, b, c, (k, 3) each: positive for a counter-clockwise cone."""
    result: FloatArray = (
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )
    return result


def signs_of(p: FloatArray) -> SignArray:
    """(m,) exact signs of cones (m, 3, 3): 1 counter-clockwise, −1 turned over, 0 flat."""
    a, b, c = p[:, 0], p[:, 1], p[:, 2]
    det = determinants(a, b, c)
    size = (
        np.abs(a[:, 0]) * (np.abs(b[:, 1] * c[:, 2]) + np.abs(b[:, 2] * c[:, 1]))
        + np.abs(a[:, 1]) * (np.abs(b[:, 2] * c[:, 0]) + np.abs(b[:, 0] * c[:, 2]))
        + np.abs(a[:, 2]) * (np.abs(b[:, 0] * c[:, 1]) + np.abs(b[:, 1] * c[:, 0]))
    )
    out = np.sign(det).astype(np.int8)
    for f in np.flatnonzero(~(np.abs(det) > BOUND * size)):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (
            [Fraction(x) for x in row] for row in p[f].tolist()
        )
        exact = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        out[f] = (exact > 0) - (exact < 0)
    return out


def weights_in(q: FloatArray, corners: FloatArray) -> FloatArray:
    """(k, 3) coordinates of directions q (k, 3) in cones (k, 3, 3), up to a positive factor."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.stack([determinants(q, b, c), determinants(a, q, c), determinants(a, b, q)], 1)


def counter_clockwise(p: FloatArray) -> BoolArray:
    """(m,) bool: the cones (m, 3, 3) are counter-clockwise beyond the doubt of floating point."""
    d = p[:, 1] - p[:, 0]
    e = p[:, 2] - p[:, 0]
    det = determinants(p[:, 0], d, e)
    return np.asarray(det > 1e-15 * np.linalg.norm(d, axis=1) * np.linalg.norm(e, axis=1))
