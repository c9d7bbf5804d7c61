"""Turn single faces back over a surface with handles: their surroundings as convex combinations, frame by
frame."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.graph import components
from circparam.core.linalg import Factor
from circparam.maps.base import Geometry
from circparam.maps.cones import counter_clockwise
from circparam.maps.cover import Development
from circparam.maps.mend import (
    PATCHES,
    TRIES,
    WIDTHS,
    part_of,
    row_weights,
    untangled_flat,
    widened,
)
from circparam.maps.sheet import Sheet


def mend_lifted(
    sheet: Sheet, development: Development, geometry: Geometry, q: FloatArray, fixed: BoolArray
) -> tuple[FloatArray, int]:
    """(vectors (n, 3) with fewer faces turned over, how many are left). fixed (n,): vertices that stay."""
    weights: FloatArray | None = None
    for rings in WIDTHS:
        for _ in range(TRIES):
            bad = ~counter_clockwise(development.corners(q))
            if not bad.any():
                return q, 0
            if weights is None:
                weights = row_weights(sheet, "mean-value")
            seed = np.zeros(sheet.n, bool)
            seed[sheet.faces[bad]] = True
            free = widened(sheet.faces, seed, rings) & ~fixed
            if free.any():
                new = _filled(development, geometry, q, free, weights)
                q = _kept(development, q, new, free)
    for rings in PATCHES:
        q = _untangled(sheet, development, geometry, q, (fixed, rings))
    return q, int((~counter_clockwise(development.corners(q))).sum())


def _untangled(
    sheet: Sheet,
    development: Development,
    geometry: Geometry,
    q: FloatArray,
    patches: tuple[BoolArray, int],
) -> FloatArray:
    """Patches of so many rings round what is left, each rolled out flat, by the foldover-free energy."""
    fixed, rings = patches
    bad = ~counter_clockwise(development.corners(q))
    if not bad.any():
        return q
    seed = np.zeros(sheet.n, bool)
    seed[sheet.faces[bad]] = True
    inside = widened(sheet.faces, seed, rings)[sheet.faces].all(1)
    h = np.flatnonzero(np.repeat(inside, 3) & np.repeat(inside, 3)[sheet.twin])
    _, label = components(len(sheet.faces), h // 3, sheet.twin[h] // 3)
    out = q.copy()
    for patch in np.unique(label[bad]).tolist():
        faces = np.flatnonzero((label == patch) & inside)
        part = _rolled_out(sheet, development, faces)
        vertices, local, into = part
        rolled = np.einsum("kab,kb->ka", into, q[vertices])
        uv, back = geometry.seen(rolled)
        if not np.isfinite(uv).all():
            continue
        found, held = untangled_flat(part_of(sheet, faces, local), uv, fixed[vertices])
        new = np.linalg.solve(into, back(found)[..., None])[..., 0]
        out[vertices[~held]] = geometry.normal(np.asarray(new[~held], np.float64))
    return out


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


def _kept(development: Development, q: FloatArray, new: FloatArray, free: BoolArray) -> FloatArray:
    """``new`` on every patch of free vertices where fewer faces are turned over than before."""
    faces = development.faces
    i, j = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    both = free[i] & free[j]
    count, label = components(len(q), i[both], j[both])
    touched = free[faces].any(1)
    of = np.where(free[faces[touched]], label[faces[touched]], -1).max(1)
    before, after = (
        np.bincount(of[~counter_clockwise(development.corners(x)[touched])], minlength=count)
        for x in (q, new)
    )
    take = free & (after < before)[label]
    out = q.copy()
    out[take] = new[take]
    return out
