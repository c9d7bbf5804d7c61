"""Maps between two surfaces: ``circparam.map_surfaces``, also called by ``circparam map``."""

import os
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Any, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import first_of_each
from circparam.core.monitor import Listener, Monitor
from circparam.core.records import dataclass
from circparam.core.types import IntArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.formats.sidecars import read_landmarks, read_paths
from circparam.maps import landmarks as marking
from circparam.maps.charts import add_charts
from circparam.maps.cover import CoverPoints
from circparam.maps.landmarks import Landmarks
from circparam.maps.map_input import ClosedMesh, MapInput, map_input_of, require_same
from circparam.maps.overlay import refinement
from circparam.maps.solution import Distortion, MapSolution, distortion, face_energies, solve_map
from circparam.maps.surface_map import Places, SurfaceMap, fingerprint
from circparam.mesh.mesh import UVMap
from circparam.pipeline.configure import open_source
from circparam.solvers.tutte.weights import WEIGHTS

POOR_DISTORTION = 1.5  # mean above which more landmarks are advised


@dataclass(frozen=True, eq=False)
class MapResult:
    """A map and its quality.

    map: places both ways. a_to_b, b_to_a: its distortion. inversions: faces turned over in the common domain,
    by exact signs, of A and of B. landmarks: pairs given; landmark_error: largest error, in sizes of B. start:
    the distortion of A → B before relaxation. seconds: of the stages. notes: assumptions and repairs.
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


class Keywords(TypedDict, total=False):
    """Further arguments of ``map_surfaces``, documented there."""

    method: str
    mirrored: bool
    relax: bool
    overlay: bool


def map_surfaces(
    a: Any,
    b: Any,
    *,
    landmarks: npt.ArrayLike | str | os.PathLike[str] | None = None,
    paths: Sequence[Sequence[int]] | None = None,
    charts: bool = False,
    listener: Listener | None = None,
    **keywords: Unpack[Keywords],
) -> MapResult:
    """A one-to-one map between two connected surfaces with as many handles and boundaries.

    a, b: as for ``circparam.unwrap``. landmarks: (k, 2) pairs of vertices of a and b,
    counted from 0, or a file with a pair on each line. The map takes them to each other exactly. None:
    alignment gives some to surfaces in similar poses. paths: sequences of vertices of a that are landmarks. The
    shortest paths between them are the first cuts on both surfaces (a file of landmarks may hold lines ``path 1
    2 3 1``). Without paths, shortest paths between landmarks cut handles. charts: both files have uv whose
    charts correspond, which are mapped chart on chart. method: the weights of the convex maps, any that are
    positive (circle, mean-value, floater, uniform). mirrored: map to the mirror image of b. relax: False keeps
    the composition of the convex maps. overlay: True adds the common refinement of both (``map.overlay``), of
    closed surfaces.

    Returns a MapResult: ``map`` (a SurfaceMap; ``circparam.save_map`` writes it), distortion both ways,
    inversions. Raises InputError for landmarks that name no vertex or the same one twice. Raises TopologyError
    if the surfaces differ, look mirrored, or the landmarks have no common layout. Raises OptionError for a
    method with negative weights, NoResultError if double precision cannot hold the map.
    """
    unknown = set(keywords) - set(Keywords.__annotations__)
    if unknown:
        raise TypeError(f"map_surfaces has no argument {sorted(unknown)[0]!r}")
    method, mirrored = keywords.get("method", "mean-value"), keywords.get("mirrored", False)
    pairs, routes = _pairs(landmarks, paths)
    a, b = open_source(a), open_source(b)
    names = [
        letter if surface.path is None else surface.source.name
        for letter, surface in zip("AB", (a, b), strict=True)
    ]
    layouts = (_layout(a, names[0]), _layout(b, names[1])) if charts else None
    if method not in (good := WEIGHTS.tagged("positive")):  # else the maps may fold
        raise OptionError(
            f"a map needs weights that are positive on every mesh, not {method!r}: "
            f"choose one of {', '.join(good)}"
        )
    monitor = Monitor(listener)
    with monitor.stage("repair"):
        side_a, side_b = map_input_of(a.mesh, names[0]), map_input_of(b.mesh, names[1], mirrored)
        require_same(side_a, side_b)
    with monitor.stage("landmarks"):
        marks = _landmarks(pairs, routes, layouts, side_a, side_b, mirrored)
    solution = solve_map(side_a, side_b, marks, method, keywords.get("relax", True), monitor)
    found = _result(side_a, side_b, marks, solution, method, monitor)
    if not keywords.get("overlay", False):
        return found
    with monitor.stage("overlay"):
        mapped = replace(found.map, overlay=refinement(side_a, side_b, solution))
    return replace(found, map=mapped, seconds=dict(monitor.seconds))


def _pairs(
    landmarks: npt.ArrayLike | str | os.PathLike[str] | None, paths: Sequence[Sequence[int]] | None
) -> tuple[IntArray | None, list[list[int]]]:
    """(landmarks (k, 2), paths) as arguments or files give them."""
    routes = [[int(v) for v in path] for path in paths or []]
    if landmarks is None:
        if routes:
            raise InputError("paths lead from landmark to landmark, and no landmarks are given")
        return None, routes
    if isinstance(landmarks, (str, os.PathLike)):
        return read_landmarks(landmarks), routes + read_paths(landmarks)
    given = np.asarray(landmarks)
    if given.ndim != 2 or given.shape[1] != 2 or not np.issubdtype(given.dtype, np.integer):
        raise InputError(
            f"landmarks have shape {given.shape} and type {given.dtype}: (k, 2) whole numbers are needed"
        )
    return given.astype(np.int64), routes


def _landmarks(
    pairs: IntArray | None,
    paths: list[list[int]],
    layouts: tuple[UVMap, UVMap] | None,
    a: MapInput,
    b: MapInput,
    mirrored: bool,
) -> Landmarks:
    """The pairs as landmarks, guessed ones where they are needed, with paths, and seams or boundaries."""
    if paths and layouts:
        raise OptionError(
            "paths between landmarks and --charts both say where to cut: leave one out"
        )
    if pairs is not None:
        marks = marking.given_landmarks(pairs, a, b)
        if not mirrored:
            marking.refuse_mirrored(marks, a, b)
    elif (a.loops and not a.genus) or layouts:
        marks = Landmarks()
    else:
        marks = marking.guess(a, b)
    if paths:
        marking.add_paths(marks, paths, a)
    if layouts:
        add_charts(marks, layouts, a, b)
    else:
        marking.add_boundaries(marks, a, b)
    if len(marks.a) < 3:
        raise InputError(
            f"{len(marks.a)} landmarks are too few for closed surfaces: give 3 or more pairs of vertices"
        )
    return marks


def _result(
    a: MapInput, b: MapInput, marks: Landmarks, solution: MapSolution, method: str, monitor: Monitor
) -> MapResult:
    """The map by vertices and faces of the files, and its quality."""
    notes = [f"{side.name}: {line}" for side in (a, b) for line in side.notes] + marks.notes
    with monitor.stage("check"):
        exact = np.stack([marks.a, marks.b], 1)[np.array(marks.exact, bool)].reshape(-1, 2)
        to_b = _places(b, solution.on_b, solution.covers[1].mesh, exact)
        to_a = _places(a, solution.on_a, solution.covers[0].mesh, exact[:, ::-1])
        (pa, fa), (pb, fb) = ((s.surface.vertex_points, s.surface.corner_vertex) for s in (a, b))
        there = to_b.take(slice(a.n)).of(pb, fb)
        a_to_b = distortion(pa, fa, there)
        b_to_a = distortion(pb, fb, to_a.take(slice(b.n)).of(pa, fa))
        off = np.linalg.norm(there[exact[:, 0]] - pb[exact[:, 1]], axis=1)
        worst = max(a_to_b.mean, b_to_a.mean)
        if worst > POOR_DISTORTION:
            energy, _ = face_energies(pa, fa, there)
            vertex = fa[int((energy * a.surface.areas).argmax()), 0]
            number = int(np.flatnonzero(a.vertex == vertex)[0])
            notes.append(
                f"the map is far from an isometry (mean distortion {worst:.3g}; 1 is perfect), worst near "
                f"vertex {number} of {a.name}: add a landmark there and at the end of every long thin part"
            )
        mapped = SurfaceMap(
            a.of_file(b.on_file(to_b)),
            b.of_file(a.on_file(to_a)),
            fingerprint(a.mesh),
            fingerprint(b.mesh),
        )
    return MapResult(
        mapped,
        a_to_b,
        b_to_a,
        solution.start,
        (solution.covers[0].inversions, solution.covers[1].inversions),
        len(exact),
        float(off.max(initial=0.0)) / b.size,
        method,
        dict(monitor.seconds),
        notes,
    )


def _places(b: MapInput, on_b: CoverPoints, mesh: ClosedMesh, exact: IntArray) -> Places:
    """Where vertices of A lie on the surface of B; exact (k, 2): vertices of both that go to each other."""
    places = mesh.on_surface(on_b)
    corner = first_of_each(b.surface.corner_vertex.ravel(), b.n)[exact[:, 1]]
    return places.put(exact[:, 0], Places.along(corner, np.zeros(len(exact))))


def _layout(surface: Document, name: str) -> UVMap:
    """The first uv set of a document."""
    found = surface.uv() if surface.uv_sets else None
    if found is None:
        raise InputError(f"{name}: it has no uv, and --charts needs the charts of both surfaces")
    return found
