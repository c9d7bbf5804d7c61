"""Turn single faces back over a surface with handles: their surroundings as convex combinations, frame by
frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.linalg import Factor
from circparam.maps.base import Geometry
from circparam.maps.cones import counter_clockwise
from circparam.maps.cover import Development
from circparam.maps.mend import Flat, mended
from circparam.maps.sheet import Sheet


def mend_lifted(
    sheet: Sheet, development: Development, geometry: Geometry, q: FloatArray, fixed: BoolArray
) -> tuple[FloatArray, int]:
    """``mended`` for vectors (n, 3) of vertices in their frames."""
    return mended(sheet, q, fixed, _InFrames(sheet, development, geometry))


@dataclass(frozen=True, eq=False)
class _InFrames:
    sheet: Sheet
    development: Development
    geometry: Geometry

    def turned(self, q: FloatArray, faces: IntArray) -> BoolArray:
        return ~counter_clockwise(self.development.corners(q)[faces])

    def filled(self, q: FloatArray, free: BoolArray, weights: FloatArray) -> FloatArray:
        return _filled(self.development, self.geometry, q, free, weights)

    def flat(self, q: FloatArray, faces: IntArray) -> Flat | None:
        """Rolled out."""
        vertices, local, into = _rolled_out(self.sheet, self.development, faces)
        uv, lifted = self.geometry.seen(np.einsum("kab,kb->ka", into, q[vertices]))
        if not np.isfinite(uv).all():
            return None

        def back(found: FloatArray) -> FloatArray:
            new = np.linalg.solve(into, lifted(found)[..., None])[..., 0]
            return self.geometry.normal(np.asarray(new, np.float64))

        return Flat(vertices, local, uv, back)


def _rolled_out(
    sheet: Sheet, development: Development, faces: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """(vertices (k,) of some connected faces, the faces by these, (k, 3, 3) from the frame of each to one
    frame)."""
    index, matrices = development.crossings(sheet)
    way = {int(faces[0]): np.eye(3)}
    among = set(faces.tolist())
    front = [int(faces[0])]
    while front:
        f = front.pop()
        for h in (3 * f, 3 * f + 1, 3 * f + 2):
            g = int(sheet.twin[h]) // 3
            if g in among and g not in way:
                way[g] = way[f] @ matrices[index[sheet.twin[h]]]
                front.append(g)
    vertices, first, local = np.unique(sheet.faces[faces], return_index=True, return_inverse=True)
    own = 3 * faces[first // 3] + first % 3
    into = np.stack([way[int(f)] for f in faces[first // 3]]) @ development.of(own)
    return vertices, local.reshape(-1, 3), into


def _filled(
    development: Development, geometry: Geometry, q: FloatArray, free: BoolArray, w: FloatArray
) -> FloatArray:
    """The free vertices as weighted means of their neighbours, each in its own frame: blocks of 3 × 3."""
    faces = development.faces
    i, j = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    h = np.flatnonzero(free[i])
    i, j, w = i[h], j[h], w[h]
    way = np.linalg.inv(development.of(h)) @ development.of(h // 3 * 3 + (h + 1) % 3)
    number, n = np.cumsum(free) - 1, int(free.sum())
    inner = free[j]
    value = np.einsum("kab,kb->ka", way[~inner], q[j[~inner]]) * w[~inner][:, None]
    b = np.stack([group_sum(value[:, d], number[i[~inner]], n) for d in range(3)], 1)
    block = way[inner] * w[inner][:, None, None]
    rows = 3 * number[i[inner]][:, None, None] + np.arange(3)[None, :, None]
    cols = 3 * number[j[inner]][:, None, None] + np.arange(3)[None, None, :]
    shape = block.shape
    matrix = sps.identity(3 * n, format="csr") - sps.csr_matrix(
        (
            block.ravel(),
            (np.broadcast_to(rows, shape).ravel(), np.broadcast_to(cols, shape).ravel()),
        ),
        shape=(3 * n, 3 * n),
    )
    out = q.copy()
    new = Factor(matrix).solve(b.ravel()).reshape(-1, 3)
    good = new[:, 2] > np.hypot(new[:, 0], new[:, 1]) if geometry.curved else new[:, 2] > 0
    out[np.flatnonzero(free)[good]] = geometry.normal(new[good])
    return out
