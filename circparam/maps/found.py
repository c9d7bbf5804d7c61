"""A map as found: places both ways, by the sphere for surfaces without handles, else by their own geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.maps.base import Round
from circparam.maps.composition import composed, relaxed, start_of
from circparam.maps.cones import Locator, signs
from circparam.maps.cover import Cover, Development
from circparam.maps.distortion import Distortion, distortion
from circparam.maps.domain import Domain, common_domain
from circparam.maps.handles import (
    Laid,
    Lifted,
    Patched,
    composed_in_patches,
    handle_domain,
    located,
)
from circparam.maps.landmarks import Landmarks
from circparam.maps.lifted import back_again, relaxed_lifted
from circparam.maps.places import along_boundaries, with_boundaries
from circparam.maps.sheet import Sheet
from circparam.maps.sides import Side

PlacesOnSheet = tuple[IntArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Found:
    """there: (face, weights) of the vertices of A on the sheet of B; back: of those of B on the sheet of A.
    sheets: of A and B. inversions: faces turned over in the domain. start: the distortion of A → B before
    relaxation. relaxed: whether it was relaxed. laid: both over the domain, and the places of all vertices of
    the sheet of B on that of A, for the overlay."""

    there: PlacesOnSheet
    back: PlacesOnSheet
    sheets: tuple[Sheet, Sheet]
    inversions: tuple[int, int]
    start: Distortion
    relaxed: bool
    laid: Callable[[], tuple[Laid, PlacesOnSheet]]


def on_sphere(
    a: Side, b: Side, marks: Landmarks, wanted: tuple[str, bool], monitor: Monitor
) -> Found:
    """The map of two surfaces of genus 0 through one sphere. wanted: (weights, whether to relax)."""
    domain = common_domain(a, b, marks, wanted[0], monitor)
    with monitor.stage("compose"):
        places = composed(a, b, marks, domain)
        start = start_of(a, domain, places)
    found = relaxed(a, b, marks, domain, places, monitor) if wanted[1] else None
    domain = found or domain
    with monitor.stage("check"):
        first, second = (
            int((signs(q, s.faces)[s.parent >= 0] <= 0).sum())
            for s, q in zip(domain.sheets, domain.spheres, strict=True)
        )
        there = composed(a, b, marks, domain)
        back = composed(b, a, replace(marks, a=marks.b, b=marks.a), domain.turned())
    return Found(
        there,
        back,
        domain.sheets,
        (first, second),
        start,
        found is not None,
        lambda: _laid_on_sphere(domain),
    )


def _laid_on_sphere(domain: Domain) -> tuple[Laid, PlacesOnSheet]:
    one, two = (
        Cover(Round(False), s, q[s.faces], np.zeros(3 * len(s.faces), np.int64), np.eye(3)[None])
        for s, q in zip(domain.sheets, domain.spheres, strict=True)
    )
    none = np.zeros(0, np.int64)
    whole = Development(one.sheet.faces, none, np.zeros((0, 3, 3, 3)))
    face, w = Locator(two.sheet, domain.spheres[1]).find(domain.spheres[0])
    turn = np.broadcast_to(np.eye(3), (len(face), 3, 3)).copy()
    back = Locator(one.sheet, domain.spheres[0]).find(domain.spheres[1])
    return Laid(one, two, whole, domain.spheres[0], Lifted(face, w, turn)), back


def with_handles(
    a: Side, b: Side, marks: Landmarks, wanted: tuple[str, bool], monitor: Monitor
) -> Found:
    """The map of two surfaces with handles through their own geometry."""
    domain = handle_domain(a, b, marks, wanted[0], monitor)
    one, two = domain.sheets
    turned = replace(marks, a=marks.b, b=marks.a)
    with monitor.stage("compose"):
        lifted = composed_in_patches(a, b, marks, one, two)
        sheet = two.cover.sheet
        there = np.einsum("kc,kcd->kd", lifted.weights, sheet.points[sheet.faces[lifted.face]])
        start = distortion(a.surface.vertex_points, a.surface.corner_vertex, there[: a.n])
    found = relaxed_lifted(a, b, marks, domain, lifted, monitor) if wanted[1] else None
    with monitor.stage("check"):
        if found is None:
            other = composed_in_patches(b, a, turned, two, one)
            return Found(
                (lifted.face, lifted.weights),
                (other.face, other.weights),
                (one.cover.sheet, sheet),
                domain.inversions,
                start,
                False,
                lambda: _laid_in_patches(one, two),
            )
        mine, cover = found.covers
        back = with_boundaries(back_again(found, two), along_boundaries(b, a, turned, mine.sheet))
        return Found(
            (found.lifted.face, found.lifted.weights),
            back,
            (mine.sheet, cover.sheet),
            (mine.inversions, cover.inversions),
            start,
            True,
            lambda: (found.laid(), back_again(found, two)),
        )


def _laid_in_patches(one: Patched, two: Patched) -> tuple[Laid, PlacesOnSheet]:
    lifted = located(one, two)
    back = located(two, one)
    laid = Laid(one.cover, two.cover, one.own(), one.vertices(), lifted)
    return laid, (back.face, back.weights)
