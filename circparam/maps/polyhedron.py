"""A small triangulation of the sphere as a convex polyhedron round the origin: Tutte's drawing, lifted.

Tutte's drawing of a 3-connected plane graph is in equilibrium, so it is the shadow of a convex surface (Maxwell
1864, Cremona; the lifting as in Richter-Gebert 1996): across an edge the slope changes by the stress of the
edge times its length, at a right angle to it. Seen from a point inside every face is then counter-clockwise.
"""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import NoResultError
from circparam.maps.cones import signs


def polyhedron(faces: IntArray) -> FloatArray:
    """(k, 3) unit vectors of the vertices of a simple triangulation of the sphere, faces (2k − 4, 3), k ≥ 4.

    Every face is counter-clockwise seen from outside, by exact signs. Raises NoResultError where double
    precision cannot tell the faces apart (hundreds of vertices).
    """
    k = int(faces.max()) + 1
    plane = _drawing(faces, k)
    height = _lifted(faces, plane)
    p = np.column_stack([plane, -height / max(float(np.ptp(height)), 1e-300)])
    inside = p.mean(0)
    p -= inside
    p /= np.linalg.norm(p, axis=1)[:, None]
    if (signs(p, faces) > 0).all():
        return p
    raise NoResultError(
        f"{k} landmarks are too many for a common domain in double precision: leave some out"
    )


def _drawing(faces: IntArray, k: int) -> FloatArray:
    """(k, 2) Tutte's drawing with unit stresses; the last face is the outer one, clockwise in the drawing."""
    joined = np.zeros((k, k))
    joined[faces.ravel(), faces[:, [1, 2, 0]].ravel()] = 1
    outer = faces[-1][::-1]
    angle = 2 * np.pi * np.arange(3) / 3
    out = np.zeros((k, 2))
    out[outer] = np.stack([np.cos(angle), np.sin(angle)], 1)
    free = np.setdiff1d(np.arange(k), outer)
    laplacian = np.diag(joined.sum(1)) - joined
    out[free] = np.linalg.solve(
        laplacian[np.ix_(free, free)], joined[np.ix_(free, outer)] @ out[outer]
    )
    return out


def _lifted(faces: IntArray, plane: FloatArray) -> FloatArray:
    """(k,) heights of the convex lifting, 0 at the outer face, below 0 inside."""
    inner = faces[:-1]
    owner = {(int(f[c]), int(f[(c + 1) % 3])): n for n, f in enumerate(inner) for c in range(3)}
    slope = np.full((len(inner), 3), np.nan)  # height = slope · (x, y, 1) on each face
    slope[0] = 0
    stack = [0]
    while stack:
        f = stack.pop()
        for c in range(3):
            i, j = int(inner[f, c]), int(inner[f, (c + 1) % 3])
            g = owner.get((j, i))
            if g is None or not np.isnan(slope[g, 0]):
                continue
            d = plane[j] - plane[i]
            step = np.array([d[1], -d[0]])  # out of f, which lies on the left of i → j
            slope[g] = slope[f] + np.r_[step, -step @ plane[i]]
            stack.append(g)
    height = np.zeros(len(plane))
    height[inner.ravel()] = (
        slope[np.repeat(np.arange(len(inner)), 3)]
        * np.column_stack([plane[inner.ravel()], np.ones(inner.size)])
    ).sum(1)
    outer = faces[-1]
    base = np.linalg.solve(np.column_stack([plane[outer], np.ones(3)]), height[outer])
    result: FloatArray = height - np.column_stack([plane, np.ones(len(plane))]) @ base
    return result
