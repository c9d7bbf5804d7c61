"""Signs in rational arithmetic, for tests of what promises to be exact."""

from fractions import Fraction


def exact_sign(a, b, c):
    (ax, ay), (bx, by), (cx, cy) = [tuple(map(Fraction, map(float, p))) for p in (a, b, c)]
    det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (det > 0) - (det < 0)
