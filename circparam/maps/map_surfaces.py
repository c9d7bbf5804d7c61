"""The one-to-one map between two surfaces: landmarks, common domain, composition, relaxation, check."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from circparam.core.arrays import IntArray
from circparam.core.monitor import Monitor
from circparam.errors import InputError, OptionError
from circparam.maps import landmarks as marking
from circparam.maps.composition import composed, relaxed, start_of
from circparam.maps.cones import signs
from circparam.maps.distortion import Distortion, distortion
from circparam.maps.domain import Domain, common_domain
from circparam.maps.landmarks import Landmarks
from circparam.maps.places import at_vertices, for_file, on_surface
from circparam.maps.sides import Side, require_same, side_of
from circparam.maps.surface_map import Places, SurfaceMap, fingerprint
from circparam.mesh.mesh import Mesh
from circparam.solvers.tutte.weights import WEIGHTS

POSITIVE = "positive"  # what a row of WEIGHTS must be for its maps to be one to one


@dataclass(frozen=True, eq=False)
class MapResult:
    """A map and what it is worth.

    map: places both ways. a_to_b, b_to_a: its distortion. inversions: faces turned over in the common
    domain, by exact
    signs, of A and of B. landmarks: pairs that were given; landmark_error: how far the worst is off, in
    sizes of B. start:
    the distortion of A → B before relaxation. seconds: of the stages. notes: what was assumed or had to be
    mended.
    """

    map: SurfaceMap
    a_to_b: Distortion
    b_to_a: Distortion
    start: Distortion
    inversions: tuple[int, int]
    landmarks: int
    landmark_error: float
    method: str
    seconds: dict[str, float]
    notes: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """For a report."""
        return {
            "method": self.method,
            "distortion": {"a_to_b": self.a_to_b.as_dict(), "b_to_a": self.b_to_a.as_dict()},
            "distortion_start": self.start.as_dict(),
            "inversions": {"a": self.inversions[0], "b": self.inversions[1]},
            "landmarks": self.landmarks,
            "landmark_error": self.landmark_error,
            "stages": {name: round(s, 3) for name, s in self.seconds.items()},
            "seconds": round(sum(self.seconds.values()), 3),
            "notes": self.notes,
        }


def map_meshes(
    a: Mesh,
    b: Mesh,
    pairs: IntArray | None = None,
    *,
    method: str = "mean-value",
    mirrored: bool = False,
    relax: bool = True,
    monitor: Monitor | None = None,
) -> MapResult:
    """A one-to-one map between two surfaces of genus 0 with as many boundaries.

    pairs: (k, 2) vertices of a and b that correspond, counted from 0; None: guessed where the surfaces lie
    alike. method: row of
    WEIGHTS that is positive. mirrored: b is read as its mirror image. relax: False leaves the composed
    convex maps as
    they are. Raises TopologyError, InputError, OptionError, NoResultError.
    """
    if method not in WEIGHTS.names() or POSITIVE not in WEIGHTS[method].tags:
        good = [name for name in WEIGHTS.names() if POSITIVE in WEIGHTS[name].tags]
        raise OptionError(
            f"a map needs weights that are positive on every mesh, not {method!r}: "
            f"choose one of {', '.join(good)}"
        )
    monitor = monitor or Monitor()
    with monitor.stage("repair"):
        side_a, side_b = side_of(a, "A"), side_of(b, "B", mirrored)
        require_same(side_a, side_b)
    with monitor.stage("landmarks"):
        marks = _landmarks(pairs, side_a, side_b, mirrored)
    domain = common_domain(side_a, side_b, marks, method, monitor)
    with monitor.stage("compose"):
        places = composed(side_a, side_b, marks, domain)
        start = start_of(side_a, domain, places)
    notes = [f"{s.name}: {line}" for s in (side_a, side_b) for line in s.notes] + marks.notes
    if relax:
        found = relaxed(side_a, side_b, marks, domain, places, monitor)
        if found is None:
            notes.append(
                "the relaxation left faces turned over in the common domain: "
                "the map is the composition of the convex maps as they were"
            )
        domain = found or domain
    with monitor.stage("check"):
        checked = _Checked(side_a, side_b, marks, domain)
    return MapResult(
        checked.map(),
        checked.a_to_b,
        checked.b_to_a,
        start,
        checked.inversions,
        len(checked.exact),
        checked.landmark_error,
        method,
        dict(monitor.seconds),
        notes,
    )


def _landmarks(pairs: IntArray | None, a: Side, b: Side, mirrored: bool) -> Landmarks:
    if pairs is not None:
        marks = marking.given_landmarks(pairs, a, b)
        if not mirrored:
            marking.refuse_mirrored(marks, a, b)
    elif a.loops:
        marks = Landmarks()
    else:
        marks = marking.guess(a, b)
    marking.add_boundaries(marks, a, b)
    if len(marks.a) < 3:
        raise InputError(
            f"{len(marks.a)} landmarks are too few for closed surfaces: give 3 or more pairs of vertices"
        )
    return marks


class _Checked:
    """What a map is worth, counted and measured from the domain that it goes through."""

    def __init__(self, a: Side, b: Side, marks: Landmarks, domain: Domain) -> None:
        self.a, self.b = a, b
        exact = np.array(marks.exact, bool)
        self.exact = np.stack([np.array(marks.a)[exact], np.array(marks.b)[exact]], 1)
        first, second = (
            int((signs(q, s.faces)[s.parent >= 0] <= 0).sum())
            for s, q in zip(domain.sheets, domain.spheres, strict=True)
        )
        self.inversions = first, second
        self.to_b = _places(a, b, marks, domain, self.exact)
        turned = replace(marks, a=marks.b, b=marks.a)
        self.to_a = _places(b, a, turned, domain.turned(), self.exact[:, ::-1])
        pa, pb = a.surface.vertex_points, b.surface.vertex_points
        self.there = self.to_b.of(pb, b.surface.corner_vertex)
        back = self.to_a.of(pa, a.surface.corner_vertex)
        self.a_to_b = distortion(pa, a.surface.corner_vertex, self.there)
        self.b_to_a = distortion(pb, b.surface.corner_vertex, back)

    @property
    def landmark_error(self) -> float:
        """How far the worst landmark is off, in sizes of B."""
        goal = self.b.surface.vertex_points[self.exact[:, 1]]
        off = np.linalg.norm(self.there[self.exact[:, 0]] - goal, axis=1)
        return float(off.max(initial=0.0)) / self.b.size

    def map(self) -> SurfaceMap:
        """By the vertices and faces of the files."""
        return SurfaceMap(
            for_file(self.to_b, self.a, self.b),
            for_file(self.to_a, self.b, self.a),
            fingerprint(self.a.mesh),
            fingerprint(self.b.mesh),
        )


def _places(a: Side, b: Side, marks: Landmarks, domain: Domain, exact: IntArray) -> Places:
    """Where the vertices of A lie on the surface of B; exact (k, 2): vertices of both that go to each other."""
    face, w = composed(a, b, marks, domain)
    places = on_surface(face, w, domain.sheets[1])
    return at_vertices(places, exact[:, 0], exact[:, 1], b.surface.corner_vertex)
