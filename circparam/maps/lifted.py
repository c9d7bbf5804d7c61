"""Relaxation over a surface with handles: A moves over B's surface, the domain follows, and what no face
turns over in stays one to one. As ``composition.relaxed`` for spheres, with a frame for every face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.maps.composition import (
    AGAIN,
    CAP,
    DOMAIN_ROUNDS,
    DOMAIN_STEPS,
    DOMAIN_TOLERANCE,
    MAP_STEPS,
    MAP_TOLERANCE,
    fixed_of,
)
from circparam.maps.cones import counter_clockwise, signs_of
from circparam.maps.cover import Cover, Development
from circparam.maps.handles import HandleDomain, Laid, Lifted, Patched
from circparam.maps.landmarks import Landmarks
from circparam.maps.lifted_mend import mend_lifted
from circparam.maps.relax import Relaxation
from circparam.maps.sides import Side
from circparam.maps.targets import Plane, SheetTarget, Spot


@dataclass(frozen=True, eq=False)
class Relaxed:
    """A as it was read over B, whose edges stay split. covers: both; spot: the vertices of A on the sheet of B;
    whole: the development of A's faces."""

    covers: tuple[Cover, Cover]
    lifted: Lifted
    whole: Development

    def laid(self) -> Laid:
        """Both over the domain."""
        mine, cover = self.covers
        return Laid(mine, cover, self.whole, _vectors(cover, self.lifted), self.lifted)


def relaxed_lifted(
    a: Side, b: Side, marks: Landmarks, domain: HandleDomain, start: Lifted, monitor: Monitor
) -> Relaxed | None:
    """The map moved to low distortion; None where that leaves faces turned over in the domain."""
    one, two = domain.sheets
    fixed = fixed_of(a, marks)
    weight = np.where(a.sheet.parent < 0, 0.0, a.sheet.cut_mesh.areas / a.area)
    rest = a.sheet.cut_mesh.rest_triangles / np.sqrt(a.area)
    scale = 1 / float(np.sqrt(b.area))
    with monitor.stage("relax"):
        target = SheetTarget(two.cover, scale)
        run = Relaxation(a.sheet.faces, rest, target, fixed, weight, one.whole)
        run.guard = False
        begun = run.energy(spot_of(target, two.cover, start))
        spot = run.run_from(
            spot_of(target, two.cover, start), MAP_STEPS, MAP_TOLERANCE, monitor
        ).spot
    with monitor.stage("domain"):
        cover = _untied(a, b, domain, lifted_of(spot), monitor)
    with monitor.stage("relax"):
        q = _vectors(cover, lifted_of(spot))
        if not counter_clockwise(one.whole.corners(q)).all():
            q, left = mend_lifted(a.sheet, one.whole, domain.base.geometry, q, fixed)
            if left:
                return None
            again = SheetTarget(cover, scale)
            run.target, run.guard = again, True
            moved = run.run_from(
                spot_of(again, cover, found_again(cover, q, lifted_of(spot))),
                AGAIN,
                MAP_TOLERANCE,
                monitor,
            )
            if moved.energy > begun:
                return None
            spot, q = moved.spot, moved.spot.sphere
    index, matrices = one.whole.crossings(a.sheet)
    mine = Cover(domain.base.geometry, a.sheet, one.whole.corners(q), index, matrices)
    if mine.inversions or cover.inversions or (signs_of(mine.cones) <= 0).any():
        return None
    return Relaxed((mine, cover), lifted_of(spot), one.whole)


def lifted_of(spot: Spot) -> Lifted:
    """The places of a spot."""
    face, w = spot.place
    if spot.turn is None:
        raise TypeError("a place over a surface with handles has a turn")
    return Lifted(face, w, spot.turn)


def spot_of(target: SheetTarget, cover: Cover, at: Lifted) -> Spot:
    """Places as a spot of the target."""
    return target.spot(_vectors(cover, at), at.face, at.weights, at.turn)


def _vectors(cover: Cover, at: Lifted) -> FloatArray:
    """(n, 3) places in the frames of the vertices."""
    q: FloatArray = np.einsum("nij,nj->ni", at.turn, cover.direction(at.face, at.weights))
    return q


def found_again(cover: Cover, q: FloatArray, near: Lifted) -> Lifted:
    """Vertices at vectors q (n, 3) in their frames, looked for from faces near them; what has not moved
    keeps its place."""
    moved = (q != _vectors(cover, near)).any(1)
    back = np.linalg.inv(near.turn[moved])
    face, w, turn = cover.find(np.einsum("nij,nj->ni", back, q[moved]), near.face[moved])
    out = Lifted(near.face.copy(), near.weights.copy(), near.turn.copy())
    out.face[moved], out.weights[moved] = face, w
    out.turn[moved] = near.turn[moved] @ turn
    return out


def _untied(a: Side, b: Side, domain: HandleDomain, at: Lifted, monitor: Monitor) -> Cover:
    """The sheet of B, its domain relaxed until no face of A is turned over in it, or it gets no better."""
    one, two = domain.sheets
    cover, geometry = two.cover, domain.base.geometry
    sheet = cover.sheet
    areas = sheet.cut_mesh.areas * np.where(sheet.parent < 0, CAP, 1.0)
    fixed: BoolArray = np.zeros(sheet.n, bool)
    fixed[: b.n] = b.on_boundary >= 0
    fixed[b.tips] = True
    development, q = two.own(), two.vertices()
    run: Relaxation | None = None
    before = len(a.sheet.faces) + 1
    for _ in range(DOMAIN_ROUNDS):
        left = int((~counter_clockwise(one.whole.corners(_vectors(cover, at)))).sum())
        if left == 0 or left >= before:
            break
        before = left
        if run is None:
            rest = sheet.cut_mesh.rest_triangles / np.sqrt(areas.sum())
            plane = Plane(geometry, 1 / float(np.sqrt(domain.base.area)))
            run = Relaxation(
                sheet.faces, rest, plane, fixed, areas / areas.sum(), development, geometry
            )
        moved = run.run(q, DOMAIN_STEPS, DOMAIN_TOLERANCE, monitor)
        if moved.steps == 0:
            break
        q = moved.spot.sphere
        cover = Cover(geometry, sheet, development.corners(q), cover.index, cover.matrices)
    return cover


def back_again(relaxed: Relaxed, two: Patched) -> tuple[IntArray, FloatArray]:
    """(face (n,) of A's sheet, weights (n, 3)) of the vertices of B's sheet."""
    mine, cover = relaxed.covers
    near, way = _nearest(relaxed, cover)
    first = two.first
    q = cover.cones.reshape(-1, 3)[first]
    g = first // 3
    face, w, _ = mine.find(np.einsum("nij,nj->ni", way[g], q), near[g])
    return face, w


def _nearest(relaxed: Relaxed, cover: Cover) -> tuple[IntArray, FloatArray]:
    """Of every face of B's sheet: (a face of A near it (m,), the matrix (m, 3, 3) into its frame)."""
    mine, sheet = relaxed.covers[0], cover.sheet
    at, whole = relaxed.lifted, relaxed.whole
    corner = mine.sheet.first_out
    m, twin = len(sheet.faces), sheet.twin
    near = np.full(m, -1)
    way = np.empty((m, 3, 3))
    face, index = np.unique(at.face, return_index=True)
    near[face] = corner[index] // 3
    way[face] = whole.of(corner[index]) @ at.turn[index]
    front = face
    while len(front):
        h = (3 * front[:, None] + np.arange(3)).ravel()
        h = h[near[twin[h] // 3] < 0]
        target, k = np.unique(twin[h] // 3, return_index=True)
        h = h[k]
        near[target] = near[h // 3]
        way[target] = way[h // 3] @ cover.matrices[cover.index[twin[h]]]
        front = target
    return near, way
