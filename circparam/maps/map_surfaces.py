"""The one-to-one map between two surfaces: layout, common domain, composition, relaxation, check."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.errors import InputError, NoResultError, OptionError
from circparam.maps import landmarks as marking
from circparam.maps.cones import Locator, signs
from circparam.maps.distortion import Distortion, distortion
from circparam.maps.embedding import embed
from circparam.maps.landmarks import Landmarks
from circparam.maps.layout import Layout, start_of
from circparam.maps.mend import mend
from circparam.maps.places import (
    along_boundaries,
    at_vertices,
    for_file,
    on_surface,
    with_boundaries,
)
from circparam.maps.polyhedron import polyhedron
from circparam.maps.relax import Relaxation
from circparam.maps.sheet import Sheet
from circparam.maps.sides import Side, require_same, side_of
from circparam.maps.surface_map import Places, SurfaceMap, fingerprint
from circparam.maps.targets import SheetTarget, Sphere
from circparam.maps.tracing import Tracer
from circparam.mesh.mesh import Mesh
from circparam.solvers.tutte.weights import WEIGHTS

POSITIVE = "positive"
CAP = 1e-3  # weight of what closes boundaries, beside 1 for the surface, where the domain is relaxed
DOMAIN_STEPS, DOMAIN_TOLERANCE = 25, 1e-3
MAP_STEPS, MAP_TOLERANCE = 15, 1e-3
AGAIN = 5  # guarded steps after faces were turned back


@dataclass(frozen=True, eq=False)
class MapResult:
    """A map and what it is worth.

    map: places both ways. a_to_b, b_to_a: its distortion. inversions: faces turned over in the common domain, by exact
    signs, of A and of B. landmarks: pairs that were given; landmark_error: how far the worst is off, in sizes of B. start:
    the distortion of A → B before relaxation. seconds: of the stages. notes: what was assumed or had to be mended.
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
class Domain:
    """Both sheets on one sphere: sheets, and the directions (n, 3) of their vertices; every face counter-clockwise."""

    sheets: tuple[Sheet, Sheet]
    spheres: tuple[FloatArray, FloatArray]


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

    pairs: (k, 2) vertices of a and b that correspond, counted from 0; None: guessed where the surfaces lie alike. method: row of
    WEIGHTS that is positive. mirrored: b is read as its mirror image. relax: False leaves the composed convex maps as
    they are. Raises TopologyError, InputError, OptionError, NoResultError.
    """
    if method not in WEIGHTS.names() or POSITIVE not in WEIGHTS[method].tags:
        good = [name for name in WEIGHTS.names() if POSITIVE in WEIGHTS[name].tags]
        raise OptionError(
            f"a map needs weights that are positive on every mesh, not {method!r}: choose one of {', '.join(good)}"
        )
    monitor = monitor or Monitor()
    with monitor.stage("repair"):
        side_a, side_b = side_of(a, "A"), side_of(b, "B", mirrored)
        require_same(side_a, side_b)
    with monitor.stage("landmarks"):
        marks = _landmarks(pairs, side_a, side_b, mirrored)
    domain = common_domain(side_a, side_b, marks, method, monitor)
    notes = [f"{s.name}: {line}" for s in (side_a, side_b) for line in s.notes] + marks.notes
    start, domain, more = _relaxed(side_a, side_b, marks, domain, relax, monitor)
    with monitor.stage("check"):
        return _result(side_a, side_b, marks, domain, start, method, monitor, notes + more)


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


def _laid_out(a: Side, b: Side, marks: Landmarks) -> Layout:
    """The common triangulation of the landmarks."""
    tracers = Tracer(a.sheet, np.array(marks.a)), Tracer(b.sheet, np.array(marks.b))
    layout = Layout(tracers, (np.sqrt(a.area), np.sqrt(b.area)))
    for corners, tip in zip(marks.corners, marks.tips, strict=True):
        for n, i in enumerate(corners):
            j = corners[(n + 1) % len(corners)]
            paths = (
                _along(side, vertices[i], vertices[j])
                for side, vertices in ((a, marks.a), (b, marks.b))
            )
            layout.lay_known(i, j, *paths)
        for i in corners:
            layout.lay_known(
                tip, i, *(np.array([v[tip], v[i]]) for v in (marks.a, marks.b))
            )
    layout.triangulate()
    return layout


def _along(side: Side, start: int, end: int) -> IntArray:
    """The vertices of a boundary from one to another, with the surface on the left."""
    loop = side.loops[int(side.on_boundary[start])]
    first, last = (int(np.flatnonzero(loop == v)[0]) for v in (start, end))
    count = (last - first) % len(loop)
    out: IntArray = loop[(first + np.arange(count + 1)) % len(loop)]
    return out


def common_domain(a: Side, b: Side, marks: Landmarks, method: str, monitor: Monitor) -> Domain:
    """Both sheets on the sphere, landmark on landmark, every face counter-clockwise.

    Raises TopologyError where the landmarks have no common layout, NoResultError where double precision fails.
    """
    with monitor.stage("layout"):
        layout = _laid_out(a, b, marks)
        if layout.k == 3:
            _add_middles(layout, marks, method)
            layout = _laid_out(a, b, marks)
    with monitor.stage("embed"):
        faces = np.array([[layout.ends[arc][0] for arc in r] for r in layout.regions()])
        corners = polyhedron(faces)
        spheres = []
        for tracer in layout.tracers:
            q = embed(tracer, layout.ends, corners, method)
            q /= np.linalg.norm(q, axis=1)[:, None]
            q[tracer.marks] = corners
            fixed = tracer.on
            if (signs(q, tracer.sheet.faces) <= 0).any():
                q, left = mend(tracer.sheet, q, fixed)
                if left:
                    raise NoResultError(
                        f"{left} faces are crushed between landmarks beyond double precision: "
                        "give a landmark at the end of every long thin part"
                    )
            spheres.append(q)
    sheets = tuple(t.sheet for t in layout.tracers)
    return Domain((sheets[0], sheets[1]), (spheres[0], spheres[1]))


def _add_middles(layout: Layout, marks: Landmarks, method: str) -> None:
    """Three landmarks make two triangles and no polyhedron: the middle of each becomes a helper."""
    middles = []
    for tracer in layout.tracers:
        w = embed(tracer, layout.ends, np.eye(3), method)
        found = []
        for region in layout.regions():
            first = int(start_of(tracer, region[0])[0])
            inside = _region_vertices(tracer, first // 3)
            inside = inside[inside < len(tracer.sheet.points)]
            found.append(int(inside[w[inside].min(1).argmax()]))
        middles.append(found)
    for u, v in zip(*middles, strict=True):
        marks.add(u, v, False)


def _region_vertices(tracer: Tracer, face: int) -> IntArray:
    """The vertices inside the region of arcs that a face lies in."""
    from circparam.core.graph import components

    sheet = tracer.sheet
    h = np.flatnonzero(~tracer.on_arcs())
    _, label = components(len(sheet.faces), h // 3, sheet.twin[h] // 3)
    inside = np.unique(sheet.faces[label == label[face]])
    out: IntArray = inside[~tracer.on[inside]]
    return out


def _relaxed(
    a: Side, b: Side, marks: Landmarks, domain: Domain, relax: bool, monitor: Monitor
) -> tuple[Distortion, Domain, list[str]]:
    """(distortion of the composed convex maps, the relaxed domain, notes)."""
    (sheet_a, sheet_b), (qa, qb) = domain.sheets, domain.spheres
    with monitor.stage("compose"):
        edge = along_boundaries(a, b, marks, sheet_b)
        face, w = with_boundaries(Locator(sheet_b, qb).find(qa[: a.n]), edge)
        there = np.einsum("kc,kcd->kd", w, sheet_b.points[sheet_b.faces[face]])
        start = distortion(a.surface.vertex_points, a.sheet.faces[: len(a.surface.faces)], there)
    if not relax:
        return start, domain, []
    with monitor.stage("domain"):
        qb = _relaxed_domain(b, sheet_b, qb, monitor)
    with monitor.stage("relax"):
        found = _relaxed_map(a, b, marks, sheet_b, qb, (face, w), monitor)
    if found is None:
        return start, domain, ["the relaxation left faces turned over: the map is the composition of the convex maps as they were"]
    return start, Domain((a.sheet, sheet_b), (found, qb)), []


def _relaxed_domain(b: Side, sheet: Sheet, q: FloatArray, monitor: Monitor) -> FloatArray:
    """The sheet of B on the sphere, as near to an isometry as it gets: a domain without kinks."""
    cut_mesh = sheet.cut_mesh
    areas = cut_mesh.areas * np.where(sheet.parent < 0, CAP, 1.0)
    scale = np.sqrt(areas.sum())
    fixed = np.zeros(sheet.n, bool)
    fixed[: b.n] = b.on_boundary >= 0  # it stays on the arcs that both sheets have
    fixed[b.tips] = True
    run = Relaxation(
        sheet.faces,
        cut_mesh.rest_triangles / scale,
        Sphere(1 / np.sqrt(4 * np.pi)),
        fixed,
        areas / areas.sum(),
    )
    x = run.run(q, DOMAIN_STEPS, DOMAIN_TOLERANCE, monitor)
    print('DBG domain', x.energy, x.steps)
    return x.spot.sphere


def _relaxed_map(
    a: Side,
    b: Side,
    marks: Landmarks,
    sheet_b: Sheet,
    qb: FloatArray,
    places: tuple[IntArray, FloatArray],
    monitor: Monitor,
) -> FloatArray | None:
    """The vertices of the sheet of A on the sphere of B, None where faces stay turned over."""
    locator = Locator(sheet_b, qb)
    target = SheetTarget(locator, 1 / np.sqrt(b.area))
    fixed = np.zeros(a.sheet.n, bool)
    fixed[[u for u, exact in zip(marks.a, marks.exact, strict=True) if exact]] = True
    fixed[a.n :] = True
    fixed[: a.n] |= a.on_boundary >= 0
    q = np.einsum("kc,kcd->kd", places[1], qb[sheet_b.faces[places[0]]])
    q /= np.linalg.norm(q, axis=1)[:, None]
    q = np.concatenate([q, _tips(a, b, marks, qb)])
    exact = [(u, v) for u, v, e in zip(marks.a, marks.b, marks.exact, strict=True) if e]
    for u, v in exact:
        q[u] = qb[v]
    run = Relaxation(
        a.sheet.faces,
        a.sheet.cut_mesh.rest_triangles / np.sqrt(a.area),
        target,
        fixed,
        np.where(a.sheet.parent < 0, 0.0, a.sheet.cut_mesh.areas / a.area),
    )
    run.guard = False
    moved = run.run(q, MAP_STEPS, MAP_TOLERANCE, monitor)
    q, left = mend(a.sheet, moved.spot.sphere, fixed)

    import os
    if os.environ.get('DBG'):
        from circparam.maps.cones import all_counter_clockwise as acc
        sp=moved.spot
        bad=np.flatnonzero(~acc(sp.sphere,a.sheet.faces)); bad2=np.flatnonzero(~acc(q,a.sheet.faces)); e=run.face_energy(sp); run.guard=False; up=run.upright(sp); run.guard=True
        print('surface turned',(~up).sum())
        for f in (bad2 if left else bad)[:12]:
            c=a.sheet.points[a.sheet.faces[f]].mean(0); print(f,'before mend' if f in bad else 'new','lm dist/edge %.1f'%(np.linalg.norm(a.sheet.points[[u for u,x in zip(marks.a,marks.exact) if x]]-c,axis=1).min()/np.median(a.sheet.edge_lengths)),'E %.2f'%e[f],'up',up[f])
        print('DBG left', left, 'E', moved.energy, moved.steps)
    if left:
        return None
    run.guard = True
    return run.run(q, AGAIN, MAP_TOLERANCE, monitor).spot.sphere


def _tips(a: Side, b: Side, marks: Landmarks, qb: FloatArray) -> FloatArray:
    """(boundaries, 3) directions of the tips over the boundaries of A: those of B's."""
    out = np.zeros((len(a.tips), 3))
    for tip in marks.tips:
        out[marks.a[tip] - a.n] = qb[marks.b[tip]]
    return out


def _result(
    a: Side,
    b: Side,
    marks: Landmarks,
    domain: Domain,
    start: Distortion,
    method: str,
    monitor: Monitor,
    notes: list[str],
) -> MapResult:
    (sheet_a, sheet_b), (qa, qb) = domain.sheets, domain.spheres
    inversions = tuple(
        int((signs(q, s.faces)[s.parent >= 0] <= 0).sum())
        for s, q in zip(domain.sheets, domain.spheres, strict=True)
    )
    exact = [(u, v) for u, v, e in zip(marks.a, marks.b, marks.exact, strict=True) if e]
    to_b = _places(a, b, marks, domain)
    turned = replace(marks, a=marks.b, b=marks.a)
    to_a = _places(b, a, turned, Domain(domain.sheets[::-1], domain.spheres[::-1]))
    file_b, file_a = for_file(to_b, a, b), for_file(to_a, b, a)
    pa, pb = a.surface.vertex_points, b.surface.vertex_points
    there = to_b.of(pb, b.surface.corner_vertex)
    back = to_a.of(pa, a.surface.corner_vertex)
    error = max(
        (float(np.linalg.norm(there[u] - pb[v])) for u, v in exact), default=0.0
    )
    return MapResult(
        SurfaceMap(file_b, file_a, fingerprint(a.mesh), fingerprint(b.mesh)),
        distortion(pa, a.surface.corner_vertex, there),
        distortion(pb, b.surface.corner_vertex, back),
        start,
        (inversions[0], inversions[1]),
        len(exact),
        error / b.size,
        method,
        dict(monitor.seconds),
        notes,
    )


def _places(a: Side, b: Side, marks: Landmarks, domain: Domain) -> Places:
    """Where the vertices of A lie on the surface of B."""
    sheet, q = domain.sheets[1], domain.spheres[0][: a.n]
    found = Locator(sheet, domain.spheres[1]).find(q)
    face, w = with_boundaries(found, along_boundaries(a, b, marks, sheet))
    exact = np.array(marks.exact, bool)
    return at_vertices(
        on_surface(face, w, sheet),
        np.array(marks.a)[exact],
        np.array(marks.b)[exact],
        b.surface.corner_vertex,
    )
