"""The map between two surfaces: composed over their common domain, then relaxed towards an isometry."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import mask_of
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.distortion import (
    Tail,
    dirichlet_terms,
    energies_at_best_scale,
    has_shape,
)
from circparam.maps.cover import Cover, CoverPoints, Development
from circparam.maps.domain import PatchedMesh, along_boundaries, common_domain, composed, mended
from circparam.maps.geometries import signs_of
from circparam.maps.landmarks import Landmarks
from circparam.maps.map_input import MapInput
from circparam.maps.relax import GeometryTarget, MeshTarget, Relaxation
from circparam.mesh.cut_mesh import rest_triangles_of

CAP_WEIGHT = 1e-3  # weight in the domain's energy of faces that close boundaries; the surface has 1
DOMAIN_STEPS, DOMAIN_TOLERANCE = 4, 1e-4  # Newton's steps, and the gain that ends them
DOMAIN_ROUNDS = 4  # of such steps at most, each followed by a count of the turned faces
MAP_STEPS, MAP_TOLERANCE = 15, 1e-4  # of the map, on the surface of B alone
GUARDED_STEPS = 12  # of the map, after turned faces were mended
MOST_ENERGY = 1e12  # of a face: one that becomes a line has none


@dataclass(frozen=True)
class Distortion:
    """Symmetric Dirichlet energy / 4 of every face, both surfaces at the scale that is best: 1 for an isometry.

    mean: by area. p95, p99: upper bounds for these shares of the area. largest.
    """

    mean: float
    p95: float
    p99: float
    largest: float

    def as_dict(self) -> dict[str, float]:
        """Plain numbers."""
        return {"mean": self.mean, "p95": self.p95, "p99": self.p99, "max": self.largest}


@dataclass(frozen=True, eq=False)
class MapSolution:
    """A map over its domain.

    covers: of both closed meshes. on_b: places of all vertices of the mesh of A on that of B; on_a: the other
    way. start: the distortion of A → B before relaxation.
    """

    covers: tuple[Cover, Cover]
    on_b: CoverPoints
    on_a: CoverPoints
    start: Distortion


def solve_map(
    a: MapInput, b: MapInput, marks: Landmarks, method: str, relax: bool, monitor: Monitor
) -> MapSolution:
    """The map of two surfaces of one topology. method: the weights of the convex maps. marks: get a note where
    the map cannot be relaxed.

    Raises TopologyError if the landmarks have no common layout, NoResultError if double precision cannot
    hold the maps.
    """
    mesh_a, mesh_b = domain = common_domain(a, b, marks, method, monitor)
    cover_a, cover_b = mesh_a.cover, mesh_b.cover
    with monitor.stage("compose"):
        on_b = composed(a, b, marks, mesh_a, mesh_b)
        images = on_b.take(slice(a.n)).of(cover_b.mesh.points, cover_b.mesh.faces)
        start = distortion(a.surface.vertex_points, a.surface.corner_vertex, images)
    better = relaxed(a, b, marks, domain, on_b.take(slice(a.closed.n)), monitor) if relax else None
    if better is not None:
        cover_a, cover_b, on_b = better
    elif relax:
        marks.notes.append(
            "relaxation turns faces over in the common domain: "
            "the map is the composition of the convex maps without it"
        )
    with monitor.stage("check"):
        # faces of B that hold a vertex of A know the frame of a face of A; the others have it from a neighbour
        face, vertex = np.unique(on_b.face, return_index=True)
        corner = cover_a.mesh.first_out[vertex]
        root, way = cover_b.development.rolled_out(face)
        way = (cover_a.development.of(corner) @ on_b.turn[vertex])[root] @ way
        own = mesh_b.first // 3  # the face in whose frame each vertex of B lies
        q = np.einsum("nij,nj->ni", way[own], cover_b.vectors)
        on_a = cover_a.find(q, (corner // 3)[root[own]])
        turned = replace(marks, a=marks.b, b=marks.a)
        on_a.put(*along_boundaries(b, a, turned, cover_a.mesh))
    return MapSolution((cover_a, cover_b), on_b, on_a, start)


def relaxed(
    a: MapInput,
    b: MapInput,
    marks: Landmarks,
    domain: tuple[PatchedMesh, PatchedMesh],
    start: CoverPoints,
    monitor: Monitor,
) -> tuple[Cover, Cover, CoverPoints] | None:
    """(covers of A as read and of B, places of A on B) of low distortion; None if faces stay turned over in the
    domain, or if the repair costs more than the gain.

    A moves over the surface of B without a guard. The domain of B is relaxed until A is unflipped in it. The
    remaining flips are mended there, else in the domain as it was, and A moves on with the guard.
    """
    development, cover_b = domain[0].whole, domain[1].cover
    geometry = cover_b.geometry
    fixed = mask_of(a.closed.n, np.array(marks.a)[np.array(marks.exact, bool)])
    fixed[a.n :] = True
    fixed[: a.n] |= a.on_boundary >= 0
    weight = np.where(a.closed.parent < 0, 0.0, a.closed.cut_mesh.areas / a.area)
    size, scale = float(np.sqrt(a.area)), 1 / float(np.sqrt(b.area))
    with monitor.stage("relax"):
        target = MeshTarget(cover_b, scale)
        run = Relaxation(development, size, target, fixed, weight, guard=False)
        first = target.at(start)
        start_energy = run.energy(first)
        free, _ = run.run(first, MAP_STEPS, MAP_TOLERANCE, monitor)
    with monitor.stage("domain"):
        smooth = _without_kinks(b, domain[1], development, free.on, monitor)
    with monitor.stage("relax"):
        for cover in (smooth, cover_b):  # some flips can be mended in one of the domains alone
            at, q = free, cover.vectors_of(free.on)
            if development.turned(q).any():
                q = mended(geometry, development, fixed, q)
                if development.turned(q).any():
                    continue
                target = MeshTarget(cover, scale)
                run.target, run.guard = target, True
                again = target.at(cover.found_again(q, free.on), q)
                at, energy = run.run(again, GUARDED_STEPS, MAP_TOLERANCE, monitor)
                if energy > start_energy:
                    continue
                q = at.vectors
            cover_a = Cover(geometry, development, q)
            if not cover.inversions and (signs_of(cover_a.cones) > 0).all():
                return cover_a, cover, at.on
    return None


def _without_kinks(
    b: MapInput, mesh_b: PatchedMesh, faces_a: Development, at: CoverPoints, monitor: Monitor
) -> Cover:
    """The mesh of B, its domain relaxed until no face of A is turned over in it, or it gets no better.

    Convex maps have kinks where patches meet. A face of A may lie well on the surface of B and be turned over
    where the domain bends under it.
    """
    cover, mesh = mesh_b.cover, mesh_b.cover.mesh
    turned = faces_a.turned(cover.vectors_of(at)).sum()
    if not turned:
        return cover
    areas = mesh.cut_mesh.areas * np.where(mesh.parent < 0, CAP_WEIGHT, 1.0)
    size, scale = float(np.sqrt(areas.sum())), 1 / float(np.sqrt(mesh_b.base.area))
    fixed: BoolArray = np.zeros(mesh.n, bool)
    fixed[: b.n] = b.on_boundary >= 0  # it stays on the arcs that both meshes have
    fixed[b.n : b.closed.n] = True
    target = GeometryTarget(cover.geometry, scale, cover.development)
    run = Relaxation(cover.development, size, target, fixed, areas / areas.sum())
    for _ in range(DOMAIN_ROUNDS):
        moved, _ = run.run(target.at(cover.vectors), DOMAIN_STEPS, DOMAIN_TOLERANCE, monitor)
        cover = replace(cover, vectors=moved.vectors)
        before, turned = turned, faces_a.turned(cover.vectors_of(at)).sum()
        if not 0 < turned < before:
            break
    return cover


def distortion(points: FloatArray, faces: IntArray, images: FloatArray) -> Distortion:
    """Of the map that takes every face to the flat triangle of the images (n, 3) of its corners."""
    energy, area = face_energies(points, faces, images)
    if not (area > 0).any():
        return Distortion(1.0, 1.0, 1.0, 1.0)
    energy, area = energy[area > 0], area[area > 0]
    tail = Tail.of(energy, area)
    mean = float((energy * area).sum() / area.sum())
    return Distortion(mean, tail.percentile(95), tail.percentile(99), float(energy.max()))


def face_energies(
    points: FloatArray, faces: IntArray, images: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(energy (m,) of the same map, 1 if a face has no shape; area (m,), 0 there)."""
    rest, there = rest_triangles_of(points[faces]), rest_triangles_of(images[faces])
    area = rest[:, 1, 0] * rest[:, 2, 1] / 2
    live = has_shape(area, np.linalg.norm(rest - np.roll(rest, 1, 1), axis=2))
    square, inverse = dirichlet_terms(rest[live], np.nan_to_num(there[live]))
    energies = np.ones(len(faces))
    energies[live] = energies_at_best_scale(square, np.minimum(inverse, MOST_ENERGY), area[live])
    return energies, np.where(live, area, 0.0)
