"""Turn single faces of a sheet back: their surroundings are mapped anew by convex combinations; on the sphere,
and (``lifted_mend``) over a geometry with handles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2
from circparam.core.graph import components
from circparam.maps.cones import all_counter_clockwise
from circparam.maps.convex import combined, row_weights
from circparam.maps.sheet import Sheet
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.untangle import untangle

PATCHES = (4, 8, 2, 12)  # rings of a patch that is untangled, tried in turn
WIDTHS = (0, 1, 2, 3, 5, 8, 12)  # rings round a face that is turned over, tried in turn
TRIES = 2  # of every width; what is mended leaves others to mend


def widened(faces: IntArray, vertices: BoolArray, rings: int) -> BoolArray:
    """(n,) bool: vertices, and those within so many rings round them."""
    out = vertices.copy()
    for _ in range(rings):
        more = out.copy()
        more[faces[out[faces].any(1)]] = True
        out = more
    return out


class Flat(NamedTuple):
    """Some faces in a plane: their vertices (k,), the faces by these (m, 3), uv (k, 2), and the way back."""

    vertices: IntArray
    local: IntArray
    uv: FloatArray
    back: Callable[[FloatArray], FloatArray]


class Ground(Protocol):
    """What vertices of a sheet are moved on, as vectors (n, 3)."""

    def turned(self, q: FloatArray, faces: IntArray) -> BoolArray:
        """(k,) bool: which of some faces are turned over."""

    def filled(self, q: FloatArray, free: BoolArray, weights: FloatArray) -> FloatArray:
        """The free vertices (some, (n,) bool) as weighted means of their neighbours."""

    def flat(self, q: FloatArray, faces: IntArray) -> Flat | None:
        """Some connected faces in a plane, None where they cannot lie in one."""


def mended(sheet: Sheet, q: FloatArray, fixed: BoolArray, ground: Ground) -> tuple[FloatArray, int]:
    """(vectors (n, 3) with fewer faces turned over, how many are left). fixed (n,): vertices that stay.

    Each patch of faces that are turned over is treated for itself, and only what helps is kept.
    """
    weights: FloatArray | None = None
    every = np.arange(len(sheet.faces))
    for rings in WIDTHS:
        for _ in range(TRIES):
            bad = ground.turned(q, every)
            if not bad.any():
                return q, 0
            if weights is None:
                weights = row_weights(sheet, "mean-value")
            free = _round(sheet, bad, rings) & ~fixed
            if free.any():
                q = _kept(sheet, ground, q, ground.filled(q, free, weights), free)
    for rings in PATCHES:
        q = _untangled(sheet, ground, q, fixed, rings)
    return q, int(ground.turned(q, every).sum())


def _round(sheet: Sheet, bad: BoolArray, rings: int) -> BoolArray:
    """(n,) bool: the vertices of bad faces, and so many rings round them."""
    seed = np.zeros(sheet.n, bool)
    seed[sheet.faces[bad]] = True
    return widened(sheet.faces, seed, rings)


def _untangled(
    sheet: Sheet, ground: Ground, q: FloatArray, fixed: BoolArray, rings: int
) -> FloatArray:
    """Patches of so many rings round what is left, each in a plane, by the foldover-free energy."""
    bad = ground.turned(q, np.arange(len(sheet.faces)))
    if not bad.any():
        return q
    inside = _round(sheet, bad, rings)[sheet.faces].all(1)
    h = np.flatnonzero(np.repeat(inside, 3) & np.repeat(inside, 3)[sheet.twin])
    _, label = components(len(sheet.faces), h // 3, sheet.twin[h] // 3)
    out = q.copy()
    for patch in np.unique(label[bad]).tolist():
        faces = np.flatnonzero((label == patch) & inside)
        flat = ground.flat(q, faces)
        if flat is None:
            continue
        found, held = untangled_flat(
            part_of(sheet, faces, flat.local), flat.uv, fixed[flat.vertices]
        )
        out[flat.vertices[~held]] = flat.back(found)[~held]
    return out


def mend(sheet: Sheet, sphere: FloatArray, fixed: BoolArray) -> tuple[FloatArray, int]:
    """``mended`` for directions (n, 3) on the sphere."""
    return mended(sheet, sphere, fixed, _OnSphere(sheet))


@dataclass(frozen=True, eq=False)
class _OnSphere:
    sheet: Sheet

    def turned(self, q: FloatArray, faces: IntArray) -> BoolArray:
        return ~all_counter_clockwise(q, self.sheet.faces[faces])

    def filled(self, q: FloatArray, free: BoolArray, weights: FloatArray) -> FloatArray:
        ends = self.sheet.faces[:, [1, 2, 0]].ravel()
        out = q.copy()
        new = combined(self.sheet, free, weights, lambda h: q[ends[h]])
        out[free] = new / np.maximum(np.linalg.norm(new, axis=1), 1e-300)[:, None]
        return out

    def flat(self, q: FloatArray, faces: IntArray) -> Flat | None:
        """Seen from the centre of the sphere."""
        vertices, local = np.unique(self.sheet.faces[faces], return_inverse=True)
        centre = q[vertices].mean(0)
        centre /= np.linalg.norm(centre)
        high = q[vertices] @ centre
        if (high < 0.1).any():
            return None
        frame = np.linalg.svd(centre[None])[2][1:]
        frame[1] *= np.sign(np.linalg.det(np.stack([frame[0], frame[1], centre])))

        def back(uv: FloatArray) -> FloatArray:
            new = uv @ frame + centre
            result: FloatArray = new / np.linalg.norm(new, axis=1)[:, None]
            return result

        uv = (q[vertices] @ frame.T) / high[:, None]
        return Flat(vertices, local.reshape(-1, 3), uv, back)


def untangled_flat(part: CutMesh, uv: FloatArray, fixed: BoolArray) -> tuple[FloatArray, BoolArray]:
    """(uv (k, 2) of a patch by the foldover-free energy, its boundary and ``fixed`` held; what was held)."""
    corners = uv[part.faces]
    scale = float(
        np.abs(cross2(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).sum() / 2
    )
    unit = np.sqrt(float(part.areas.sum()) / max(scale, 1e-300))
    held = fixed.copy()
    held[part.faces.ravel()[part.boundary]] = True
    found, _ = untangle(part, uv * unit, held)
    return found / unit, held


def part_of(sheet: Sheet, faces: IntArray, local: IntArray) -> CutMesh:
    """Some faces of a sheet as one chart; local: their vertices numbered anew."""
    number = np.full(len(sheet.faces), -1)
    number[faces] = np.arange(len(faces))
    h = (3 * faces[:, None] + np.arange(3)).ravel()
    other = sheet.twin[h]
    inner = (number[other // 3] >= 0) & (h < other)
    pairs = np.stack([h[inner], other[inner]], 1)
    return CutMesh(
        local,
        sheet.cut_mesh.rest_triangles[faces],
        np.zeros(len(faces), np.int64),
        3 * number[pairs // 3] + pairs % 3,
    )


def _kept(
    sheet: Sheet, ground: Ground, q: FloatArray, new: FloatArray, free: BoolArray
) -> FloatArray:
    """``new`` on every patch of free vertices where fewer faces are turned over than before."""
    i, j = sheet.faces.ravel(), sheet.faces[:, [1, 2, 0]].ravel()
    both = free[i] & free[j]
    count, label = components(sheet.n, i[both], j[both])
    touched = np.flatnonzero(free[sheet.faces].any(1))
    f = sheet.faces[touched]
    of = np.where(free[f], label[f], -1).max(1)
    before, after = (np.bincount(of[ground.turned(x, touched)], minlength=count) for x in (q, new))
    take = free & (after < before)[label]
    out = q.copy()
    out[take] = new[take]
    return out
