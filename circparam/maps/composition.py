"""The composed map: A on B through the common domain, and relaxed until it is as near to an isometry as it
gets.
"""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.maps.cones import Locator, all_counter_clockwise, signs
from circparam.maps.distortion import Distortion, distortion
from circparam.maps.domain import Domain
from circparam.maps.landmarks import Landmarks
from circparam.maps.mend import mend
from circparam.maps.places import along_boundaries, with_boundaries
from circparam.maps.relax import Relaxation
from circparam.maps.sides import Side
from circparam.maps.targets import SheetTarget, Sphere, Spot

# weight of what closes boundaries, beside 1 for the surface, where the domain is relaxed
CAP = 1e-3
# between looks at what is still turned over
DOMAIN_STEPS, DOMAIN_TOLERANCE, DOMAIN_ROUNDS = 4, 1e-4, 4
MAP_STEPS, MAP_TOLERANCE = 15, 1e-4
AGAIN = 12  # guarded steps at most, after faces were turned back


def composed(a: Side, b: Side, marks: Landmarks, domain: Domain) -> tuple[IntArray, FloatArray]:
    """(face (n,) of the sheet of B, weights (n, 3)) of the vertices of A."""
    sheet, q = domain.sheets[1], domain.spheres[0][: a.n]
    found = Locator(sheet, domain.spheres[1]).find(q)
    return with_boundaries(found, along_boundaries(a, b, marks, sheet))


def start_of(a: Side, domain: Domain, places: tuple[IntArray, FloatArray]) -> Distortion:
    """The distortion of a composed map."""
    sheet = domain.sheets[1]
    there = np.einsum("kc,kcd->kd", places[1], sheet.points[sheet.faces[places[0]]])
    return distortion(a.surface.vertex_points, a.surface.corner_vertex, there)


def relaxed(
    a: Side,
    b: Side,
    marks: Landmarks,
    domain: Domain,
    places: tuple[IntArray, FloatArray],
    monitor: Monitor,
) -> Domain | None:
    """The domain with A moved over B's surface to low distortion; None where that leaves faces turned over."""
    sheet_b, fixed = domain.sheets[1], fixed_of(a, marks)
    weight = np.where(a.sheet.parent < 0, 0.0, a.sheet.cut_mesh.areas / a.area)
    rest = a.sheet.cut_mesh.rest_triangles / np.sqrt(a.area)
    locator = Locator(sheet_b, domain.spheres[1])
    with monitor.stage("relax"):
        q = _start(a, marks, locator, places)
        target = SheetTarget(locator, 1 / float(np.sqrt(b.area)))
        run = Relaxation(a.sheet.faces, rest, target, fixed, weight)
        run.guard = False
        begun = run.energy(target.at(q))
        spot = run.run(q, MAP_STEPS, MAP_TOLERANCE, monitor).spot
    with monitor.stage("domain"):
        qa, qb = _untied(a, b, marks, locator, spot, monitor)
    with monitor.stage("relax"):
        if not all_counter_clockwise(qa, a.sheet.faces).all():
            qa, left = mend(a.sheet, qa, fixed)
            if left:
                return None
            run.target = SheetTarget(Locator(sheet_b, qb), 1 / float(np.sqrt(b.area)))
            run.guard = True
            moved = run.run(qa, AGAIN, MAP_TOLERANCE, monitor)
            if moved.energy > begun:
                return None
            qa = moved.spot.sphere
    if (signs(qa, a.sheet.faces) <= 0).any() or (signs(qb, sheet_b.faces) <= 0).any():
        return None
    return Domain((a.sheet, sheet_b), (qa, qb))


def _untied(
    a: Side, b: Side, marks: Landmarks, locator: Locator, spot: Spot, monitor: Monitor
) -> tuple[FloatArray, FloatArray]:
    """Directions of both sheets, the domain relaxed until no face of A is turned over in it, or it gets no
    better.

    Convex maps have kinks where patches meet. A face of A may lie well on the surface of B and be turned over
    where the domain bends under it.
    """
    sheet, qb = locator.sheet, locator.sphere
    cut_mesh = sheet.cut_mesh
    areas = cut_mesh.areas * np.where(sheet.parent < 0, CAP, 1.0)
    fixed = np.zeros(sheet.n, bool)
    fixed[: b.n] = b.on_boundary >= 0  # it stays on the arcs that both sheets have
    fixed[b.tips] = True
    rest = cut_mesh.rest_triangles / np.sqrt(areas.sum())
    run: Relaxation | None = None
    face, weights = spot.place
    before = len(a.sheet.faces) + 1
    for _ in range(DOMAIN_ROUNDS):
        there = Locator(sheet, qb)
        qa = _start(a, marks, there, (face[: a.n], weights[: a.n]))
        left = int((~all_counter_clockwise(qa, a.sheet.faces)).sum())
        if left == 0 or left >= before:
            break
        before = left
        target = Sphere(1 / np.sqrt(4 * np.pi))
        run = run or Relaxation(sheet.faces, rest, target, fixed, areas / areas.sum())
        moved = run.run(qb, DOMAIN_STEPS, DOMAIN_TOLERANCE, monitor)
        if moved.steps == 0:
            break
        qb = moved.spot.sphere
    return _start(a, marks, Locator(sheet, qb), (face[: a.n], weights[: a.n])), qb


def fixed_of(a: Side, marks: Landmarks) -> BoolArray:
    """(n,) bool: vertices of the sheet of A that stay: landmarks, boundaries and what closes them."""
    fixed = np.zeros(a.sheet.n, bool)
    fixed[np.array(marks.a)[np.array(marks.exact, bool)]] = True
    fixed[a.n :] = True
    fixed[: a.n] |= a.on_boundary >= 0
    return fixed


def _start(
    a: Side, marks: Landmarks, locator: Locator, places: tuple[IntArray, FloatArray]
) -> FloatArray:
    """(n, 3) directions of the vertices of the sheet of A, from their places on the sheet of B."""
    q = np.einsum("kc,kcd->kd", places[1], locator.cones[places[0]])
    q /= np.linalg.norm(q, axis=1)[:, None]
    q = np.concatenate([q, np.zeros((len(a.tips), 3))])
    for k, exact in enumerate(marks.exact):
        if exact or k in marks.tips:
            q[marks.a[k]] = locator.sphere[marks.b[k]]
    return q
