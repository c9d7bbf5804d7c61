"""Triangles as cones from the origin: places on a sphere of triangles, and exact signs.

A closed mesh of genus 0 whose vertices lie on the unit sphere covers the sphere once where every face, seen
from the centre, is counter-clockwise. A place on it is a direction; its weights in a face are the coordinates
of the direction in the three corners, of sum 1.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.geometry.predicates import SignArray
from circparam.maps.sheet import Sheet

# A 3 × 3 determinant of entries up to 1 is off by at most so many units of its permanent (Shewchuk 1997,
# orient3d).
BOUND = (7 + 56 * 2.0**-53) * 2.0**-53
CHUNK = 2_000_000  # pairs of a place and a face that are looked at together
STRAIGHT = 60  # faces that a walk crosses by the edge that it lies farthest behind
WALK = 400  # faces that a walk crosses before every face is tried


def determinants(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(k,) determinant of the rows a, b, c, (k, 3) each: positive for a counter-clockwise cone."""
    result: FloatArray = (
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )
    return result


def signs(points: FloatArray, faces: IntArray) -> SignArray:
    """(m,) exact sign of the cone of each face: 1 counter-clockwise, −1 turned over, 0 flat."""
    return signs_of(points[faces])


def signs_of(p: FloatArray) -> SignArray:
    """(m,) exact signs of cones (m, 3, 3)."""
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


class Locator:
    """Finds the face of a sphere of triangles in which each direction lies.

    sphere: (n, 3) unit vectors of the vertices of a sheet, every cone counter-clockwise.
    """

    def __init__(self, sheet: Sheet, sphere: FloatArray) -> None:
        self.sheet, self.sphere = sheet, sphere
        self.cones = sphere[sheet.faces]
        self._across = sheet.twin.reshape(-1, 3) // 3
        self._tree: cKDTree | None = None

    def direction(self, face: IntArray, w: FloatArray) -> FloatArray:
        """(k, 3) directions of places with weights (k, 3) in faces."""
        q = np.einsum("kc,kcd->kd", w, self.cones[face])
        result: FloatArray = q / np.linalg.norm(q, axis=1)[:, None]
        return result

    def crossed(self, turn: FloatArray, who: IntArray, half_edge: IntArray) -> None:
        """On the sphere there is one frame."""

    def near(self, q: FloatArray) -> IntArray:
        """(k,) a face near each direction, from which to walk."""
        if self._tree is None:
            self._tree = cKDTree(self.sphere)
        vertex = self._tree.query(q)[1]
        result: IntArray = self.sheet.first_out[vertex] // 3
        return result

    def find(self, q: FloatArray, start: IntArray | None = None) -> tuple[IntArray, FloatArray]:
        """(face (k,), weights (k, 3) of sum 1, none negative) of directions q (k, 3).

        start: (k,) a face near each. All walk together, each across the edge that it lies farthest behind.
        """
        face = self.near(q) if start is None else start.copy()
        out = np.empty((len(q), 3))
        open_ = np.arange(len(q))
        for step in range(WALK):
            w = weights_in(q[open_], self.cones[face[open_]])
            if (
                step > STRAIGHT
            ):  # walks may go in circles: take the edges behind which it lies in turn
                w[:, step % 3] *= 1e3
            least = w.argmin(1)
            inside = w[np.arange(len(open_)), least] >= 0
            if step > STRAIGHT:
                w[:, step % 3] *= 1e-3
            out[open_[inside]] = w[inside]
            open_, least = open_[~inside], least[~inside]
            if len(open_) == 0:
                break
            # corner k lies opposite to half-edge k + 1
            face[open_] = self._across[face[open_], (least + 1) % 3]
        else:
            face[open_], out[open_] = self._among_all(q[open_])
        out = np.maximum(out, 0)
        return face, out / out.sum(1, keepdims=True)

    def _among_all(self, q: FloatArray) -> tuple[IntArray, FloatArray]:
        """For directions that no walk leads to (walks may go in circles): the face that they lie least
        outside.
        """
        m = len(self.cones)
        face, out = np.empty(len(q), np.int64), np.empty((len(q), 3))
        step = max(1, CHUNK // m)
        for first in range(0, len(q), step):
            part = q[first : first + step]
            k = len(part)
            w = weights_in(
                np.repeat(part, m, 0), np.broadcast_to(self.cones, (k, m, 3, 3)).reshape(-1, 3, 3)
            ).reshape(k, m, 3)
            total = np.abs(w).sum(2)
            front = np.einsum("kd,mcd->km", part, self.cones) > 0
            score = np.where(front & (total > 0), w.min(2) / np.maximum(total, 1e-300), -np.inf)
            best = score.argmax(1)
            face[first : first + k] = best
            out[first : first + k] = w[np.arange(k), best]
        return face, out


def all_counter_clockwise(points: FloatArray, faces: IntArray) -> BoolArray:
    """(m,) bool: the cone is counter-clockwise beyond the doubt of floating point."""
    return counter_clockwise(points[faces])


def counter_clockwise(p: FloatArray) -> BoolArray:
    """(m,) bool for cones (m, 3, 3)."""
    d = p[:, 1] - p[:, 0]
    e = p[:, 2] - p[:, 0]
    det = determinants(p[:, 0], d, e)
    return np.asarray(det > 1e-15 * np.linalg.norm(d, axis=1) * np.linalg.norm(e, axis=1))
