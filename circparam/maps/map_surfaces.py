"""The one-to-one map between two surfaces: landmarks, common domain, composition, relaxation, check."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from circparam.core.arrays import IntArray
from circparam.core.monitor import Monitor
from circparam.errors import InputError, OptionError
from circparam.maps import landmarks as marking
from circparam.maps.charts import add_charts
from circparam.maps.closed_mesh import ClosedMesh
from circparam.maps.cover import CoverPoints
from circparam.maps.distortion import Distortion, distortion, face_energies
from circparam.maps.landmarks import Landmarks
from circparam.maps.map_input import MapInput, map_input_of, require_same
from circparam.maps.overlaid import refinement
from circparam.maps.places import at_vertices, for_file, on_surface
from circparam.maps.solution import MapSolution, solve_map
from circparam.maps.surface_map import Places, SurfaceMap, fingerprint
from circparam.mesh.mesh import Mesh, UVMap
from circparam.solvers.tutte.weights import WEIGHTS

POOR = 1.5  # mean distortion above which more landmarks are advised
POSITIVE = "positive"  # what a row of WEIGHTS must be for its maps to be one to one


@dataclass(frozen=True, eq=False)
class MapResult:
    """A map and what it is worth.

    map: places both ways. a_to_b, b_to_a: its distortion. inversions: faces turned over in the common domain,
    by exact signs, of A and of B. landmarks: pairs that were given; landmark_error: how far the worst is off,
    in sizes of B. start: the distortion of A → B before relaxation. seconds: of the stages. notes: what was
    assumed or had to be mended.
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


@dataclass(frozen=True, eq=False)
class Given:
    """What is given with two surfaces.

    pairs: (k, 2) vertices of a and b that correspond, counted from 0; None: guessed where the surfaces lie
    alike. paths: sequences of vertices of a among the pairs; shortest paths between them are the first arcs
    on both. layouts: of a and b, whose charts correspond. method: row of WEIGHTS that is positive.
    mirrored: b is read as its mirror image. relax: False leaves the composed convex maps as they are.
    overlay: the common refinement as well.
    """

    pairs: IntArray | None = None
    paths: list[list[int]] | None = None
    layouts: tuple[UVMap, UVMap] | None = None
    method: str = "mean-value"
    mirrored: bool = False
    relax: bool = True
    overlay: bool = False


STANDARD = Given()


def map_meshes(
    a: Mesh, b: Mesh, given: Given = STANDARD, monitor: Monitor | None = None
) -> MapResult:
    """A one-to-one map between two surfaces with as many handles and boundaries.

    Raises TopologyError, InputError, OptionError, NoResultError.
    """
    method = given.method
    if method not in WEIGHTS.names() or POSITIVE not in WEIGHTS[method].tags:
        good = [name for name in WEIGHTS.names() if POSITIVE in WEIGHTS[name].tags]
        raise OptionError(
            f"a map needs weights that are positive on every mesh, not {method!r}: "
            f"choose one of {', '.join(good)}"
        )
    monitor = monitor or Monitor()
    with monitor.stage("repair"):
        side_a, side_b = map_input_of(a, "A"), map_input_of(b, "B", given.mirrored)
        require_same(side_a, side_b)
    with monitor.stage("landmarks"):
        marks = _landmarks(given, side_a, side_b)
    notes = [f"{s.name}: {line}" for s in (side_a, side_b) for line in s.notes] + marks.notes
    found = solve_map(side_a, side_b, marks, method, given.relax, monitor)
    if given.relax and not found.relaxed:
        notes.append(
            "relaxation turns faces over in the common domain: "
            "the map is the composition of the convex maps without it"
        )
    with monitor.stage("check"):
        checked = _Checked(side_a, side_b, marks, found)
    refined = None
    if given.overlay:
        with monitor.stage("overlay"):
            refined = refinement(side_a, side_b, found)
    return MapResult(
        replace(checked.map(), overlay=refined),
        checked.a_to_b,
        checked.b_to_a,
        found.start,
        found.inversions,
        len(checked.exact),
        checked.landmark_error,
        method,
        dict(monitor.seconds),
        notes + checked.warnings(),
    )


def _landmarks(given: Given, a: MapInput, b: MapInput) -> Landmarks:
    if given.paths and given.layouts:
        raise OptionError(
            "paths between landmarks and --charts both say where to cut: leave one out"
        )
    if given.pairs is not None:
        marks = marking.given_landmarks(given.pairs, a, b)
        if not given.mirrored:
            marking.refuse_mirrored(marks, a, b)
    elif (a.loops and not a.genus) or given.layouts:
        marks = Landmarks()
    else:
        marks = marking.guess(a, b)
    if given.paths:
        marking.add_paths(marks, given.paths, a)
    if given.layouts:
        add_charts(marks, given.layouts, a, b)
    else:
        marking.add_boundaries(marks, a, b)
    if len(marks.a) < 3:
        raise InputError(
            f"{len(marks.a)} landmarks are too few for closed surfaces: give 3 or more pairs of vertices"
        )
    return marks


class _Checked:
    """What a map is worth, counted and measured from the domain that it goes through."""

    def __init__(self, a: MapInput, b: MapInput, marks: Landmarks, found: MapSolution) -> None:
        self.a, self.b = a, b
        exact = np.array(marks.exact, bool)
        self.exact = np.stack([np.array(marks.a)[exact], np.array(marks.b)[exact]], 1)
        ends = self.exact, self.exact[:, ::-1]
        self.to_b = _places(a, b, found.on_b, found.covers[1].mesh, ends[0])
        self.to_a = _places(b, a, found.on_a, found.covers[0].mesh, ends[1])
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

    def warnings(self) -> list[str]:
        """What to do about a map that is far from an isometry."""
        worst = max(self.a_to_b.mean, self.b_to_a.mean)
        if worst <= POOR:
            return []
        energy = face_energies(
            self.a.surface.vertex_points, self.a.surface.corner_vertex, self.there
        )
        weight = energy * self.a.surface.areas
        vertex = self.a.surface.corner_vertex[int(weight.argmax()), 0]
        number = int(np.flatnonzero(self.a.vertex == vertex)[0])
        return [
            f"the map is far from an isometry (mean distortion {worst:.3g}, 1 is one), most of all near vertex "
            f"{number} of A: add a landmark there and at the end of every long thin part"
        ]

    def map(self) -> SurfaceMap:
        """By the vertices and faces of the files."""
        return SurfaceMap(
            for_file(self.to_b, self.a, self.b),
            for_file(self.to_a, self.b, self.a),
            fingerprint(self.a.mesh),
            fingerprint(self.b.mesh),
        )


def _places(
    a: MapInput, b: MapInput, found: CoverPoints, mesh: ClosedMesh, exact: IntArray
) -> Places:
    """Where the vertices of A lie on the surface of B; exact (k, 2): vertices of both that go to each other."""
    places = on_surface(found.face[: a.n], found.weights[: a.n], mesh)
    return at_vertices(places, exact[:, 0], exact[:, 1], b.surface.corner_vertex)
