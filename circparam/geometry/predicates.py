"""Exact signs of plane determinants: floating point where its error bound decides, exact arithmetic elsewhere.

Three steps, each for the signs that the earlier one left open. First, the determinant in float64 with the error
bound of Shewchuk (1997, orient2d, bound A). Second, the exact sum of twelve floats (two-product,
grow-expansion), still in array operations. Third, rationals for coordinates further apart than the range of
float64.
"""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.types import FloatArray

SignArray: TypeAlias = npt.NDArray[np.int8]
EPS = 2.0**-53
ROUNDING_BOUND = (3 + 16 * EPS) * EPS
TINY_PRODUCT = 1e-290  # products below it may have lost digits to underflow
SPLITTER = 134217729.0  # 2^27 + 1


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
        out[unsure[rest]] = _exact(a[rest], b[rest], c[rest])
    return out


def _exact(a: FloatArray, b: FloatArray, c: FloatArray) -> SignArray:
    """Signs where the error bound does not decide."""
    p = np.stack([a, b, c], 1)
    size = np.abs(p)
    exponent = np.frexp(size)[1]
    top = np.where(size > 0, exponent, -5000).max((1, 2))
    low = np.where(size > 0, exponent, 5000).min((1, 2))
    wide = top - low > 900
    out = np.zeros(len(p), np.int8)
    if (~wide).any():
        # scaled to 2^450 at most, 2^-450 at least: neither the products nor their errors leave the range
        scaled = np.ldexp(p[~wide], (450 - top[~wide])[:, None, None])
        out[~wide] = _expansion_sign(scaled)
    if not wide.any():
        return out
    from fractions import Fraction  # takes 5 ms to import

    for k in np.flatnonzero(wide):
        (ax, ay), (bx, by), (cx, cy) = ((Fraction(x), Fraction(y)) for x, y in p[k].tolist())
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        out[k] = (det > 0) - (det < 0)
    return out


def _expansion_sign(p: FloatArray) -> SignArray:
    """Sign of ax·by − ay·bx + bx·cy − by·cx + cx·ay − cy·ax, summed without error."""
    terms: list[FloatArray] = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        for x, y in ((p[:, i, 0], p[:, j, 1]), (-p[:, i, 1], p[:, j, 0])):
            terms += _two_product(x, y)
    expansion: list[FloatArray] = []
    for term in terms:  # grow-expansion: the parts never overlap, and their sum stays exact
        grown: list[FloatArray] = []
        total = term
        for part in expansion:
            total, rest = _two_sum(total, part)
            grown.append(rest)
        expansion = [*grown, total]
    sign = np.zeros(len(p))
    for part in expansion:  # from the smallest to the largest: the largest that is not zero decides
        sign = np.where(part != 0, np.sign(part), sign)
    return sign.astype(np.int8)


def _two_sum(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x + y as rounded sum and exact rest (Knuth)."""
    total = x + y
    virtual = total - x
    return total, (x - (total - virtual)) + (y - virtual)


def _two_product(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x · y as rounded product and exact rest (Dekker, Veltkamp)."""
    product = x * y
    xh, xl = _split(x)
    yh, yl = _split(y)
    return product, xl * yl - (((product - xh * yh) - xl * yh) - xh * yl)


def _split(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    big = SPLITTER * x
    high = big - (big - x)
    return high, x - high
