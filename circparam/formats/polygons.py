"""Polygons of a file, and one rule that turns them into triangles, for every format.

The fan from the first corner whose triangles all agree with the polygon's normal (Newell's), else ear
clipping in the coordinate plane in which the polygon is largest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.errors import InputError, NoResultError
from circparam.mesh.mesh import UVMap

# Corners. Beyond this, a polygon that no fan fits is refused: clipping its ears takes quadratic time or more.
MAX_CONCAVE = 20_000


@dataclass(frozen=True)
class Polygons:
    """Polygons of a file and the triangles made inside them.

    corners: (L,) int64 vertex of every polygon corner. start: (p + 1,) int64 offsets of the polygons.
    triangles: (m, 3) int64 into ``corners``. owner: (m,) int64 polygon of each triangle.
    """

    corners: IntArray
    start: IntArray
    triangles: IntArray
    owner: IntArray

    @property
    def labels(self) -> IntArray | None:
        """Polygon label of each triangle for ``Mesh.polygons``; None where all are triangles."""
        return None if (np.diff(self.start) <= 3).all() else self.owner

    def corner_uv(self, uvmap: UVMap, name: str) -> IntArray:
        """(L,) int64: the uv of every polygon corner, from the first triangle that lists it; −1 for none.

        Raises NoResultError where triangles of one polygon disagree: no seam may run inside a polygon.
        """
        out = np.full(len(self.corners), -1, np.int64)
        out[self.triangles.ravel()[::-1]] = uvmap.uv_faces.ravel()[::-1]
        given, kept = uvmap.uv_faces, out[self.triangles]
        differ = (given != kept).any(1)
        if differ.any():
            f = np.flatnonzero(differ)
            a, b = given[f], kept[f]
            same = (a < 0) == (b < 0)
            if len(uvmap.uv):
                same &= (values(uvmap.uv, a) == values(uvmap.uv, b)).all(2)
            wrong = f[~same.all(1)]
            if len(wrong):
                raise NoResultError(
                    f"{name}: polygon {int(self.owner[wrong[0]])} got two uv at one corner: "
                    "a seam may not run inside a polygon"
                )
        return out


def values(uv: FloatArray, index: IntArray) -> FloatArray:
    """Rows of uv; zeros where the index is −1."""
    out: FloatArray = np.where((index >= 0)[..., None], uv[np.maximum(index, 0)], 0.0)
    return out


def triangulate(points: FloatArray, corners: IntArray, start: IntArray) -> Polygons:
    """Triangulate polygons. points: (n, 3). corners: (L,) int64 into points. start: (p + 1,) offsets.

    Polygons of fewer than three corners give no triangle. Triangles come in the order of the polygons.
    Raises InputError for a polygon that no fan fits and that has more than ``MAX_CONCAVE`` corners.
    """
    size = np.diff(start)
    if len(size) and (size == 3).all():
        return Polygons(
            corners, start, np.arange(len(corners)).reshape(-1, 3), np.arange(len(size))
        )
    finite = np.isfinite(points)
    if not finite.all():  # the mesh is refused later, with the place; here any number will do
        points = np.where(finite, points, 0.0)
    count = np.maximum(size - 2, 0)
    at = np.cumsum(count) - count
    triangles = np.empty((int(count.sum()), 3), np.int64)
    for n in np.unique(size[size > 2]).tolist():
        of_size = np.flatnonzero(size == n)
        apex = np.zeros(len(of_size), np.int64)
        fits = np.ones(len(of_size), bool)
        if n > 3:
            p = points[corners[start[of_size][:, None] + np.arange(n)]]
            apex, fits = first_fan(p - p[:, :1])
        k = np.arange(1, n - 1)
        fan = np.stack(
            [
                np.broadcast_to(apex[:, None], (len(apex), n - 2)),
                (apex[:, None] + k) % n,
                (apex[:, None] + k + 1) % n,
            ],
            2,
        )
        triangles[at[of_size][:, None] + np.arange(n - 2)] = fan + start[of_size][:, None, None]
        for i in np.flatnonzero(~fits).tolist():  # concave ones are few
            if n > MAX_CONCAVE:
                raise InputError(
                    f"polygon {int(of_size[i])} is concave and has {n} corners: triangulate it first"
                )
            f = of_size[i]
            triangles[at[f] : at[f] + n - 2] = clip_ears(p[i] - p[i, 0]) + start[f]
    owner = np.repeat(np.arange(len(size)), count)
    return Polygons(corners, start, triangles, owner)


def first_fan(p: FloatArray) -> tuple[IntArray, BoolArray]:
    """First corner of each polygon whose fan agrees with its normal.

    p: (k, n, 3) corners relative to corner 0. Returns ((k,) corner, (k,) whether there is one). A polygon
    without a normal takes corner 0: no other choice is better.
    """
    k, n, _ = p.shape
    with np.errstate(over="ignore", invalid="ignore"):
        normal = np.cross(p, np.roll(p, -1, axis=1)).sum(1)
    apex = np.zeros(k, np.int64)
    flat = ~(np.abs(normal).max(1) > 0)
    fits = flat.copy()
    open_ = np.flatnonzero(~fits)
    for r in range(n):
        if len(open_) == 0:
            break
        q = np.roll(p[open_], -r, axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            side = np.cross(q[:, 1:-1] - q[:, :1], q[:, 2:] - q[:, :1])
            good = (np.einsum("kti,ki->kt", side, normal[open_]) > 0).all(1)
        apex[open_[good]] = r
        fits[open_[good]] = True
        open_ = open_[~good]
    return apex, fits


def clip_ears(p: FloatArray) -> IntArray:
    """Ear clipping of one polygon. p: (n, 3) corners relative to the first. Returns (n − 2, 3) corners."""
    normal = np.cross(p, np.roll(p, -1, axis=0)).sum(0)
    axis = np.cross(np.eye(3)[int(np.argmin(np.abs(normal)))], normal)
    q = p @ np.stack([axis, np.cross(normal, axis)], 1)
    left = list(range(len(p)))
    out: list[tuple[int, int, int]] = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(q, left, k)), 1)
        out.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        left.pop(ear)
    out.append((left[0], left[1], left[2]))
    return np.array(out, np.int64)


def _is_ear(q: FloatArray, left: list[int], k: int) -> bool:
    """Whether corner k of what is left turns left and its triangle holds no other corner.

    Corners at one point with a corner of the triangle do not count: a polygon with a hole comes back along the
    bridge to it, and one that goes round twice would have no ear at all.
    """
    i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
    a, b, c = q[i], q[j], q[m]
    if not _cross(b - a, c - a) > 0:
        return False
    others = q[[v for v in left if v not in (i, j, m)]]
    inside = (_cross(b - a, others - a) >= 0) & (_cross(c - b, others - b) >= 0)
    inside &= _cross(a - c, others - c) >= 0
    for corner in (a, b, c):
        inside &= (others != corner).any(1)
    return not inside.any()


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    result: FloatArray = a[0] * b[..., 1] - a[1] * b[..., 0]
    return result


def polygon_of_corner(start: IntArray) -> IntArray:
    """(L,) polygon of each corner."""
    return np.repeat(np.arange(len(start) - 1), np.diff(start))


def strips(corners: IntArray, start: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles of strips in which −1 restarts. Returns ((m, 3) into ``corners``, (m,) strip).

    Every second triangle of a run is reversed; triangles that repeat a vertex only join strips and are left
    out.
    """
    strip = polygon_of_corner(start)
    first = np.zeros(len(corners), bool)
    first[start[:-1][start[:-1] < len(corners)]] = True
    first[1:] |= corners[:-1] < 0
    index = np.arange(len(corners))
    run = np.maximum.accumulate(np.where(first, index, 0))
    n = max(len(corners) - 2, 0)
    i = index[:n]
    same = (run[i] == run[i + 2]) & (corners[i] >= 0) & (corners[i + 1] >= 0)
    same &= corners[i + 2] >= 0
    a, b, c = corners[i], corners[i + 1], corners[i + 2]
    same &= (a != b) & (b != c) & (c != a)
    i = i[same]
    odd = (i - run[i]) % 2 == 1
    tri = np.stack([np.where(odd, i + 1, i), np.where(odd, i, i + 1), i + 2], 1)
    return tri, strip[i]


def list_start(counts: IntArray) -> IntArray:
    """Offsets of groups of the given sizes, with the total behind them."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
