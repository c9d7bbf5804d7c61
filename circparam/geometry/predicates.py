"""Exact signs of plane determinants: floating point where its error bound decides, whole numbers elsewhere.

First comes the determinant in float64 with the error bound of Shewchuk (1997, orient2d, bound A). Signs that it
leaves open are those of determinants of whole numbers, which Python has of any length.
"""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.types import FloatArray

SignArray: TypeAlias = npt.NDArray[np.int8]
EPS = 2.0**-53
ROUNDING_BOUND = (3 + 16 * EPS) * EPS
TINY_PRODUCT = 1e-290  # products below it may have lost digits to underflow


def orientation(a: FloatArray, b: FloatArray, c: FloatArray) -> SignArray:
    """(n,) exact sign of the doubled area of the triangles abc: 1 counter-clockwise, −1 clockwise, 0 on a line.

    a, b, c: (n, 2) float64, finite.
    """
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        left = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1])
        right = (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        det = left - right
        size = np.abs(left) + np.abs(right)
        sure = (np.abs(det) > ROUNDING_BOUND * size) & (size > TINY_PRODUCT) & (size < np.inf)
    if sure.all():
        return np.sign(det).astype(np.int8)
    out = np.sign(np.where(sure, det, 0.0)).astype(np.int8)
    unsure = np.flatnonzero(~sure)
    a, b, c = a[unsure], b[unsure], c[unsure]
    # two equal points, or all on one axis-parallel line: exactly zero
    same_x, same_y = a[:, 0] == b[:, 0], a[:, 1] == b[:, 1]
    third_x, third_y = a[:, 0] == c[:, 0], a[:, 1] == c[:, 1]
    rest = ~((same_x | third_y) & (same_y | third_x))
    if rest.any():
        whole = whole_numbers(np.stack([a[rest], b[rest], c[rest]], 1))
        (ax, ay), (bx, by), (cx, cy) = whole.transpose(1, 2, 0)
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        out[unsure[rest]] = whole_signs(det)
    return out


def whole_numbers(p: FloatArray) -> npt.NDArray[np.object_]:
    """Coordinates p (n, k, d) as whole numbers of any length, in units of the lowest bit of each of the n."""
    mantissa, exponent = np.frexp(p)
    exponent = np.where(mantissa == 0, exponent.max(initial=0), exponent)  # zero has any
    shift = exponent - exponent.min((1, 2), keepdims=True)
    numbers = np.ldexp(mantissa, 53).astype(np.int64).astype(object)
    return np.asarray(numbers << shift.astype(object))


def whole_signs(values: npt.NDArray[np.object_]) -> SignArray:
    """(n,) the signs of whole numbers (n,): 1, 0 or −1."""
    return (values > 0).astype(np.int8) - (values < 0).astype(np.int8)
