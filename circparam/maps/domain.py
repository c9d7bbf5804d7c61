"""The common domain of a map: both surfaces over one triangulation by arcs, patch on patch, no face flipped."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, NoResultError
from circparam.maps.convex import laid_in_polygons
from circparam.maps.cover import Cover, CoverPoints, Development, own_development, whole_development
from circparam.maps.geometries import Base, base_of, signs_of
from circparam.maps.landmarks import Landmarks
from circparam.maps.layout import laid_out
from circparam.maps.map_input import MapInput
from circparam.maps.mend import mended
from circparam.maps.places import along_boundaries
from circparam.maps.straighten import straighten
from circparam.maps.tracing import Tracer

PATCH_DISTANCE = 10.0  # distance between patches in the search for faces near a place


@dataclass(frozen=True, eq=False)
class PatchedMesh:
    """One mesh of the domain. patch (m,) of each face, places (m, 3, 3): its corners in barycentric coordinates
    of the patch; cover; first (n,): the half-edge whose face gives the frame of each vertex; whole: the
    development before edges were split."""

    patch: IntArray
    places: FloatArray
    cover: Cover
    first: IntArray
    whole: Development


@dataclass(frozen=True, eq=False)
class Domain:
    """Both meshes over one triangulation."""

    base: Base
    meshes: tuple[PatchedMesh, PatchedMesh]


def common_domain(
    a: MapInput, b: MapInput, marks: Landmarks, method: str, monitor: Monitor
) -> Domain:
    """Both meshes over one geometry by convex maps of the patches between arcs. Helpers are added to ``marks``.

    Raises TopologyError if the landmarks have no common layout, NoResultError if double precision
    cannot hold the maps.
    """
    with monitor.stage("layout"):
        layout = laid_out(a, b, marks)
        for u, v in zip(*(t.marks[len(marks.a) :] for t in layout.tracers), strict=True):
            marks.add(int(u), int(v), False)
    if layout.k < 4 and not a.genus:
        raise InputError(
            "the three landmarks lie so close that no fourth pair fits between them: give one more"
        )
    with monitor.stage("straighten"):
        straighten(layout, method, 2 * marks.arcs)
    with monitor.stage("embed"):
        regions = np.array(layout.regions())
        base = base_of(regions, np.array(layout.ends))
        first, second = (
            _patched(t, side, base, regions, method)
            for t, side in zip(layout.tracers, (a, b), strict=True)
        )
    return Domain(base, (first, second))


def _patched(
    tracer: Tracer, side: MapInput, base: Base, regions: IntArray, method: str
) -> PatchedMesh:
    """One mesh over the base; regions (r, 3): the arcs round each patch."""
    mesh = tracer.mesh
    patch = tracer.regions(regions.tolist())
    places = laid_in_polygons(tracer, patch, regions.tolist(), np.eye(3), method)
    index = np.zeros(3 * len(mesh.faces), np.int64)
    for arc, path in tracer.arcs.items():
        if (base.across[arc] != np.eye(3)).any():
            index[mesh.half_edges(path[:-1], path[1:])] = arc + 1
    matrices = np.concatenate([np.eye(3)[None], base.across])
    development, first = own_development(mesh, index, matrices)
    q = np.einsum("vp,vpd->vd", places.reshape(-1, 3)[first], base.corners[patch[first // 3]])
    cover = Cover(base.geometry, development, base.geometry.normal(q))
    if (signs_of(cover.cones) <= 0).any():
        q, _ = mended(base.geometry, development, tracer.on, cover.vectors)
        cover = replace(cover, vectors=q)
        collapsed = int((signs_of(cover.cones) <= 0).sum())
        if collapsed:
            raise NoResultError(
                f"{collapsed} faces are crushed between landmarks beyond double precision: "
                "give a landmark at the end of every long thin part"
            )
    return PatchedMesh(patch, places, cover, first, whole_development(development, side.closed))


def composed(
    a: MapInput, b: MapInput, marks: Landmarks, one: PatchedMesh, two: PatchedMesh
) -> CoverPoints:
    """All vertices of the mesh of A on the mesh of B, each looked for in its patch, boundaries by length."""
    patch, place = one.patch[one.first // 3], one.places.reshape(-1, 3)[one.first]
    tree = cKDTree(np.column_stack([PATCH_DISTANCE * two.patch, two.places.mean(1)]))
    near = tree.query(np.column_stack([PATCH_DISTANCE * patch, place]))[1]
    found = two.cover.find(one.cover.vectors, np.asarray(near, np.int64))
    return found.put(*along_boundaries(a, b, marks, two.cover.mesh))
