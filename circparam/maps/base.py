"""A triangulation of a surface with handles in its own geometry: flat for one handle, hyperbolic for more.

Circles round the nodes that touch along the arcs (Thurston; Bobenko and Springborn 2004) make every
triangle of arcs a geodesic one and every node smooth. A place is a vector of three numbers, up to a positive
factor: (x, y, 1) in the plane, a time-like vector of Minkowski's space in the hyperbolic plane. Each
triangle has a frame of its own, and a matrix leads from frame to frame across every arc. In both
geometries, as on the sphere, a geodesic is a plane through the origin, the weights of a place are its
coordinates in three corners, and the sign of a determinant tells which way a face looks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, group_sum
from circparam.errors import NoResultError

STEPS = 200  # of Newton's method; a dozen do
DONE = 1e-13  # angles round a node are a full turn to this much a node
FIT = 1e-9  # and must be to this


@dataclass(frozen=True)
class Geometry:
    """The plane (curved False) or the hyperbolic plane, as vectors of three numbers."""

    curved: bool

    @property
    def metric(self) -> FloatArray:
        """(3,) the diagonal of the inner product."""
        return np.array([1.0, 1.0, -1.0 if self.curved else 0.0])

    def normal(self, q: FloatArray) -> FloatArray:
        """Vectors (..., 3) scaled to lie on the plane or the hyperboloid."""
        if not self.curved:
            return q / q[..., 2:]
        size = q[..., 2] ** 2 - q[..., 0] ** 2 - q[..., 1] ** 2
        result: FloatArray = q / np.sqrt(np.maximum(size, 1e-300))[..., None]
        return result

    def tangents(self, q: FloatArray) -> FloatArray:
        """(n, 3, 2) two tangents at places (n, 3), orthonormal, counter-clockwise."""
        out = np.zeros((len(q), 3, 2))
        out[:, 0, 0] = out[:, 1, 1] = 1.0
        if self.curved:
            x, y, z = q.T
            out[:, 0, 0] += x * x / (1 + z)
            out[:, 1, 1] += y * y / (1 + z)
            out[:, 0, 1] = out[:, 1, 0] = x * y / (1 + z)
            out[:, 2, 0], out[:, 2, 1] = x, y
        return out

    def flat(self, corners: FloatArray, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Triangles (m, 3, 3), seen in the tangent plane of their middle: (places (m, 3, 2), how they move
        with steps in the tangents (m, 3, 3, 2) of the corners: (m, 3, 2, 2)). Straight stays straight, and
        a turn a turn."""
        middle = self.normal(corners.sum(1))
        axes = self.tangents(middle) * self.metric[:, None]
        up = -middle * self.metric if self.curved else np.array([0.0, 0.0, 1.0])
        up = np.broadcast_to(up, middle.shape)
        high = np.einsum("mcd,md->mc", corners, up)[..., None]
        offset = 0.0 if self.curved else middle[:, None, :2]
        place = np.einsum("mcd,mda->mca", corners, axes) / high - offset
        move = np.einsum("mcdb,mda->mcab", frames, axes)
        move -= (place + offset)[..., None] * np.einsum("mcdb,md->mcb", frames, up)[:, :, None]
        return place, move / high[..., None]

    def seen(self, q: FloatArray) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """(places (k, 2) of vectors (k, 3) in the tangent plane of their middle, NaN where they are out of
        sight; the way back)."""
        middle = self.normal(q.sum(0))
        axes = self.tangents(middle[None])[0]
        high = -(q * self.metric) @ middle if self.curved else q[:, 2]
        origin = np.zeros(3) if self.curved else np.r_[middle[:2], 0.0]
        with np.errstate(divide="ignore", invalid="ignore"):
            flat = np.where(high > 0, 1 / high, np.nan)[:, None] * q - origin
        uv: FloatArray = np.asarray((flat * self.metric) @ axes, np.float64)
        return uv, lambda uv: np.asarray(middle + uv @ axes.T, np.float64)

    def at(self, length: FloatArray, angle: FloatArray) -> FloatArray:
        """Places at a distance from (0, 0, 1) in a direction."""
        far, up = (
            (np.sinh(length), np.cosh(length)) if self.curved else (length, np.ones_like(length))
        )
        return np.stack([far * np.cos(angle), far * np.sin(angle), up], -1)

    def frames(self, p: FloatArray, q: FloatArray) -> FloatArray:
        """(k, 3, 3) for places p, q (k, 3): columns are the way from p to q, the way to its left, and p."""
        way = q - (-(p * q * self.metric).sum(1)[:, None] * p if self.curved else p)
        way = way / np.sqrt((way * way * self.metric).sum(1))[:, None]
        if self.curved:
            left = np.cross(p, way) * self.metric
        else:
            left = np.stack([-way[:, 1], way[:, 0], np.zeros(len(way))], 1)
        return np.stack([way, left, p], 2)


@dataclass(frozen=True)
class Base:
    """corners (r, 3, 3): of each triangle of arcs, in its own frame. across (2e, 3, 3): for every arc the
    matrix from the frame of the triangle on its left to the frame of the one on its right. area: of them
    all."""

    geometry: Geometry
    corners: FloatArray
    across: FloatArray
    area: float


def base_of(regions: IntArray, ends: IntArray) -> Base:
    """The geometry of triangles of arcs. regions (r, 3): arcs round each, counter-clockwise; ends (2e, 2): of
    each arc, arc ^ 1 the same backwards. Raises NoResultError where no circles are found."""
    nodes = ends[regions, 0]
    n = int(ends.max()) + 1
    euler = n - len(ends) // 2 + len(regions)
    geometry = Geometry(euler < 0)
    radius = _radii(nodes, n, geometry.curved)
    angle = _angles(radius[nodes], geometry.curved)
    r = radius[nodes]
    zero = np.zeros(len(r))
    corners = np.stack(
        [
            geometry.at(zero, zero),
            geometry.at(r[:, 0] + r[:, 1], zero),
            geometry.at(r[:, 0] + r[:, 2], angle[:, 0]),
        ],
        1,
    )
    place = np.empty((len(ends), 2), np.int64)
    for k in range(3):
        place[regions[:, k]] = np.stack([np.arange(len(regions)), np.full(len(regions), k)], 1)
    start = corners[place[:, 0], place[:, 1]]
    stop = corners[place[:, 0], (place[:, 1] + 1) % 3]
    own = geometry.frames(start, stop)
    twin = (
        np.arange(len(ends)) ^ 1
    )  # in the triangle on the right it leads from its end to its start
    across = geometry.frames(stop[twin], start[twin]) @ np.linalg.inv(own)
    if geometry.curved:
        area = float((np.pi - angle.sum(1)).sum())
    else:
        area = float((corners[:, 1, 0] * corners[:, 2, 1]).sum() / 2)
    return Base(geometry, corners, np.asarray(across, np.float64), area)


def _angles(r: FloatArray, curved: bool) -> FloatArray:
    """(k, 3) angles of the triangles of the centres of touching circles with radii r (k, 3)."""
    result: FloatArray = 2 * np.arctan(np.exp(_log_tangent(r, curved)))
    return result


def _log_tangent(r: FloatArray, curved: bool) -> FloatArray:
    """Logarithms of the tangents of half the angles."""
    s = r.sum(1)
    part, whole = (np.sinh(r), np.sinh(s)) if curved else (r, s)
    log = np.log(part)
    result: FloatArray = (log.sum(1)[:, None] - 2 * log - np.log(whole)[:, None]) / 2
    return result


def _radii(nodes: IntArray, n: int, curved: bool) -> FloatArray:
    """(n,) radii of the circles. Newton's method on a convex energy, in u = ln tanh(r / 2), or ln r."""
    u = np.full(n, np.log(np.tanh(0.25)) if curved else 0.0)
    flat = nodes.ravel()

    def at(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        r: FloatArray = 2 * np.arctanh(np.exp(u)) if curved else np.exp(u)
        angle = _angles(r[nodes], curved)
        return r, 2 * np.pi - group_sum(angle.ravel(), flat, n)

    r, missing = at(u)
    for _ in range(STEPS):
        if np.abs(missing).max() < DONE * n:
            break
        step = _newton(nodes, r, missing, curved)
        share = min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-300))
        while share > 1e-12:
            new = u + share * step
            if not curved or (new < -1e-12).all():
                r_new, less = at(new)
                if np.linalg.norm(less) < np.linalg.norm(missing):
                    break
            share /= 2
        else:
            break
        u, r, missing = new, r_new, less
    if np.abs(missing).max() > FIT:
        raise NoResultError(
            "the layout of the landmarks has no circles that touch (an arc closes a handle too tightly): "
            "add a landmark or two"
        )
    return r


def _newton(nodes: IntArray, r: FloatArray, missing: FloatArray, curved: bool) -> FloatArray:
    """Newton's step for the logarithmic radii."""
    own, n = r[nodes], len(r)
    angle = _angles(own, curved)
    s = own.sum(1)[:, None]
    matrix = np.zeros((n, n))
    for i in range(3):
        for j in range(3):
            if curved:
                far = np.sinh(own[:, j])
                rate = np.cosh(own[:, j]) * (1 if i != j else -1) - far / np.tanh(s[:, 0])
            else:
                rate = (1 if i != j else -1) - own[:, j] / s[:, 0]
            value = np.sin(angle[:, i]) * rate / 2
            matrix = matrix + group_sum(value, nodes[:, i] * n + nodes[:, j], n * n).reshape(n, n)
    free = 0.0 if curved else 1.0 / n  # in the plane a common factor is
    return np.asarray(np.linalg.solve(matrix - free, missing), np.float64)


class Round(Geometry):
    """The unit sphere: directions."""

    def normal(self, q: FloatArray) -> FloatArray:
        """Unit vectors."""
        result: FloatArray = q / np.linalg.norm(q, axis=-1)[..., None]
        return result
