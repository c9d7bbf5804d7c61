"""Geometries of a map's domain, and their triangulations. They are a convex polyhedron on the sphere, and
touching circles in the plane (one handle) or in the hyperbolic plane (more).

A place is a vector of three numbers, up to a positive factor: a direction, (x, y, 1), or a time-like vector of
Minkowski's space. In all three a geodesic is a plane through the origin. The weights of a place are its
coordinates in three corners, and the sign of a determinant gives the orientation of a face.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import root

from circparam.core.arrays import group_sum
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import NoResultError
from circparam.geometry.predicates import SignArray, whole_numbers, whole_signs

ANGLE_LIMIT_RADIANS = 1e-9  # radians off a full turn round a circle that are taken
# least cosine to the middle at which a direction is seen in the tangent plane
IN_SIGHT_COSINE = 0.1

# A 3 × 3 determinant of entries up to 1 is off by at most so many units of its permanent (Shewchuk 1997,
# orient3d).
DETERMINANT_ERROR = (7 + 56 * 2.0**-53) * 2.0**-53


def determinants(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(k,) determinant of the rows a, b, c, (k, 3) each: positive for a counter-clockwise cone."""
    return (
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


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
    unsure = np.flatnonzero(~(np.abs(det) > DETERMINANT_ERROR * size))
    rows: Any = whole_numbers(p[unsure]).swapaxes(0, 1)
    exact: Any = determinants(*rows)
    out[unsure] = whole_signs(exact)
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


@dataclass(frozen=True)
class Geometry:
    """The unit sphere (curvature 1), the plane (0) or the hyperbolic plane (−1)."""

    curvature: int

    @property
    def metric(self) -> FloatArray:
        """(3,) the diagonal of the inner product."""
        return np.array([1.0, 1.0, self.curvature])

    def normal(self, q: FloatArray) -> FloatArray:
        """Vectors (..., 3) scaled to lie on the sphere, the plane or the hyperboloid."""
        if not self.curvature:
            return q / q[..., 2:]
        square = self.curvature * (q * q * self.metric).sum(-1, keepdims=True)
        return q / np.sqrt(np.maximum(square, 1e-300))

    def tangents(self, q: FloatArray) -> FloatArray:
        """(n, 3, 2) two tangents at places (n, 3), orthonormal, counter-clockwise."""
        if self.curvature > 0:
            return tangents(q)
        out = np.zeros((len(q), 3, 2))
        out[:, 0, 0] = out[:, 1, 1] = 1.0
        if self.curvature:
            x, y, z = q.T
            out[:, 0, 0] += x * x / (1 + z)
            out[:, 1, 1] += y * y / (1 + z)
            out[:, 0, 1] = out[:, 1, 0] = x * y / (1 + z)
            out[:, 2, 0], out[:, 2, 1] = x, y
        return out

    def flat(self, corners: FloatArray, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Triangles (m, 3, 3) as flat ones, and how their corners move with steps in the tangents (m, 3, 3, 2).

        On the sphere both stay vectors of three numbers: the triangle is that of the chords. Else they are
        those of the tangent plane at the middle, (m, 3, 2) and (m, 3, 2, 2): straight stays straight.
        """
        if self.curvature > 0:
            return corners, frames
        axes, up, origin = self._plane(self.normal(corners.sum(1)))
        high = np.einsum("mcd,md->mc", corners, up)[..., None]
        place = np.einsum("mcd,mda->mca", corners, axes) / high
        move = np.einsum("mcdb,mda->mcab", frames, axes)
        move -= place[..., None] * np.einsum("mcdb,md->mcb", frames, up)[:, :, None]
        return place - origin[:, None], move / high[..., None]

    def projected(
        self, q: FloatArray, group: IntArray, n: int
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """(uv (k, 2) of vectors (k, 3) in the tangent plane of the middle of their group (k,), NaN if they are
        out of sight; the way back)."""
        middle = self.normal(group_sum(q, group, n))[group]
        axes, up, origin = self._plane(middle)
        high = (q * up).sum(1)
        high[high <= (IN_SIGHT_COSINE if self.curvature > 0 else 0.0)] = np.nan
        uv = np.einsum("kd,kda->ka", q, axes) / high[:, None] - origin
        basis = self.tangents(middle)
        return uv, lambda uv: middle + np.einsum("kda,ka->kd", basis, uv)

    def _plane(self, middle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of the tangent planes at places (k, 3): the axes (k, 3, 2) and the normal (k, 3) whose products with
        a vector are its coordinates and its height, and the coordinates (k, 2) of the place."""
        axes = self.tangents(middle) * self.metric[:, None]
        if self.curvature:
            return axes, self.curvature * middle * self.metric, np.zeros((len(middle), 2))
        return axes, np.broadcast_to([0.0, 0.0, 1.0], middle.shape), middle[:, :2]

    def polar(self, length: FloatArray, angle: FloatArray) -> FloatArray:
        """Places at a distance from (0, 0, 1) in a direction, in the plane or the hyperbolic plane."""
        curved = self.curvature < 0
        far, up = (np.sinh(length), np.cosh(length)) if curved else (length, np.ones_like(length))
        return np.stack([far * np.cos(angle), far * np.sin(angle), up], -1)

    def frames(self, p: FloatArray, q: FloatArray) -> FloatArray:
        """(k, 3, 3) for places p, q (k, 3) off the sphere: columns are the direction from p to q, the direction
        to its left, and p."""
        curved = self.curvature < 0
        way = q - (-(p * q * self.metric).sum(1)[:, None] * p if curved else p)
        way = way / np.sqrt((way * way * self.metric).sum(1))[:, None]
        if curved:
            left = np.cross(p, way) * self.metric
        else:
            left = np.stack([-way[:, 1], way[:, 0], np.zeros(len(way))], 1)
        return np.stack([way, left, p], 2)


def tangents(normal: FloatArray) -> FloatArray:
    """(n, 3, 2) two unit vectors at right angles to each other and to unit vectors (n, 3)."""
    axis = np.eye(3)[np.abs(normal).argmin(1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normal, first)], 2)


@dataclass(frozen=True)
class Base:
    """A triangulation of a geometry by the arcs of a layout.

    corners (r, 3, 3): of each triangle, in its own frame. across (2e, 3, 3): for every arc the matrix from the
    frame of the triangle on its left to that on its right. area: of them all.
    """

    geometry: Geometry
    corners: FloatArray
    across: FloatArray
    area: float


def base_of(regions: IntArray, ends: IntArray) -> Base:
    """The geometry of triangles of arcs. regions (r, 3): arcs round each, counter-clockwise; ends (2e, 2): of
    each arc, arc ^ 1 the same backwards. Raises NoResultError if double precision holds none."""
    nodes = ends[regions, 0]
    euler = int(ends.max()) + 1 - len(ends) // 2 + len(regions)
    if euler > 0:
        across = np.broadcast_to(np.eye(3), (len(ends), 3, 3))
        return Base(Geometry(1), polyhedron(nodes)[nodes], across, 4 * np.pi)
    geometry = Geometry(-1 if euler < 0 else 0)
    curved = geometry.curvature < 0
    radius = _radii(nodes, int(ends.max()) + 1, curved)
    r = radius[nodes]
    angle, zero = _angles(r, curved), np.zeros(len(r))
    sides = (zero, r[:, 0] + r[:, 1], r[:, 0] + r[:, 2])
    corners = [geometry.polar(s, t) for s, t in zip(sides, (zero, zero, angle[:, 0]), strict=True)]
    corner = np.stack(corners, 1)
    place = np.empty((len(ends), 2), np.int64)
    for k in range(3):
        place[regions[:, k]] = np.stack([np.arange(len(regions)), np.full(len(regions), k)], 1)
    start, stop = (corner[place[:, 0], (place[:, 1] + k) % 3] for k in (0, 1))
    # in the triangle on the right it leads from its end to its start
    twin = np.arange(len(ends)) ^ 1
    own = np.linalg.inv(geometry.frames(start, stop))
    across = np.asarray(geometry.frames(stop[twin], start[twin]) @ own, np.float64)
    areas = np.pi - angle.sum(1) if curved else corner[:, 1, 0] * corner[:, 2, 1] / 2
    return Base(geometry, corner, across, float(areas.sum()))


def _angles(r: FloatArray, curved: bool) -> FloatArray:
    """(k, 3) angles of the triangles of the centres of touching circles with radii r (k, 3)."""
    s = r.sum(1)
    part, whole = (np.sinh(r), np.sinh(s)) if curved else (r, s)
    log = np.log(part)
    tangent = np.exp((log.sum(1)[:, None] - 2 * log - np.log(whole)[:, None]) / 2)
    return 2 * np.arctan(tangent)


def _radii(nodes: IntArray, n: int, curved: bool) -> FloatArray:
    """(n,) radii of the circles, by their logarithms, so that the angles round every node are a full turn."""

    def missing(u: FloatArray) -> FloatArray:
        angle = _angles(np.exp(u)[nodes], curved)
        off = 2 * np.pi - group_sum(angle.ravel(), nodes.ravel(), n)
        return off if curved else off + u.mean()  # in the plane a common factor is free

    # below the precision of the angles: Powell's method goes on until rounding ends it
    found = root(missing, np.full(n, -0.5 if curved else 0.0), options={"xtol": 1e-15})
    if not np.abs(found.fun).max() < ANGLE_LIMIT_RADIANS:
        raise NoResultError(
            "the layout of the landmarks has no circles that touch (an arc closes a handle too tightly): "
            "add a landmark or two"
        )
    return np.asarray(np.exp(found.x), np.float64)


def polyhedron(faces: IntArray) -> FloatArray:
    """(k, 3) unit vectors of the vertices of a simple triangulation of the sphere, faces (2k − 4, 3), k ≥ 4.

    Tutte's drawing of a 3-connected plane graph is in equilibrium. It is therefore the shadow of a convex
    surface (Maxwell 1864, Cremona; lifting as in Richter-Gebert 1996). Across an edge the slope changes by the
    stress of the edge times its length, at a right angle to the edge. Every face is counter-clockwise seen from
    a point inside, by exact signs. Raises NoResultError if double precision cannot tell the faces apart
    (hundreds of vertices).
    """
    k = int(faces.max()) + 1
    inner, outer = faces[:-1], faces[-1]
    # Tutte's drawing with unit stresses, the outer face clockwise
    joined = np.zeros((k, k))
    joined[faces.ravel(), faces[:, [1, 2, 0]].ravel()] = 1
    rim = outer[::-1]
    angle = 2 * np.pi * np.arange(3) / 3
    plane = np.zeros((k, 2))
    plane[rim] = np.stack([np.cos(angle), np.sin(angle)], 1)
    free = np.setdiff1d(np.arange(k), rim)
    laplacian = np.diag(joined.sum(1)) - joined
    pull = joined[np.ix_(free, rim)] @ plane[rim]
    plane[free] = np.linalg.solve(laplacian[np.ix_(free, free)], pull)
    # heights of the convex lifting, 0 at the outer face, below 0 inside
    owner = np.full((k, k), -1)
    owner[inner, inner[:, [1, 2, 0]]] = np.arange(len(inner))[:, None]
    i, j = np.nonzero((owner >= 0) & (owner.T >= 0))
    d = plane[j] - plane[i]
    step = np.stack([d[:, 1], -d[:, 0]], 1)  # out of the face on the left of i → j
    jump = np.column_stack([step, -(step * plane[i]).sum(1)])
    one = np.eye(len(inner))
    # height = slope · (x, y, 1) on each face
    slope = np.linalg.lstsq(one[owner[j, i]] - one[owner[i, j]], jump, rcond=None)[0]
    places = np.column_stack([plane, np.ones(k)])
    height = np.zeros(k)
    height[inner] = (slope[:, None] * places[inner]).sum(2)
    height = height - places @ np.linalg.solve(places[outer], height[outer])
    p = np.column_stack([plane, -height / max(float(np.ptp(height)), 1e-300)])
    inside = p.mean(0)
    p -= inside
    p /= np.linalg.norm(p, axis=1)[:, None]
    if (signs_of(p[faces]) > 0).all():
        return p
    raise NoResultError(
        f"{k} landmarks are too many for a common domain in double precision: leave some out"
    )
