"""The common domain of a map: both surfaces over one triangulation by arcs, patch on patch, no face flipped.

Patches are laid by convex combination maps: every free vertex is a weighted mean of its neighbours (Tutte,
Floater). A shortest path along edges zigzags, and a patch whose boundary zigzags is sheared where it is laid
straight. So two patches at a time are mapped onto a square first, and its diagonal becomes the arc between
them: it runs over the surface as smoothly as the map is. Single faces that lie turned over are turned back by
untangling their surroundings.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import (
    first_of_each,
    group_count,
    group_sum,
    interpolated,
    mask_of,
    next_half_edge,
    scattered,
)
from circparam.core.graph import matching
from circparam.core.linalg import HeldFactor
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import InputError, NoResultError
from circparam.geometry.intrinsic import signed_areas
from circparam.maps.cover import Cover, CoverPoints, Development, own_development, whole_development
from circparam.maps.geometries import Base, Geometry, base_of, signs_of
from circparam.maps.landmarks import Landmarks
from circparam.maps.layout import Layout, Tracer, laid_out
from circparam.maps.map_input import ClosedMesh, MapInput
from circparam.maps.surface_map import Places
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.region import cut_out, grow
from circparam.solvers.tutte.embed import assemble
from circparam.solvers.tutte.weights import WEIGHTS, half_edge_weights
from circparam.solvers.untangle import untangle

PATCH_DISTANCE = 10.0  # distance between patches in the search for faces near a place
SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
LEAST_SPLIT_SHARE = 0.05  # of an edge, that a split keeps from its ends
DIAGONAL_OFFSET = 1e-6  # of the square: vertices of regular meshes lie on the diagonal
# rings round turned faces in a patch that is untangled, tried in turn: small patches keep the most
UNTANGLED_RINGS = (1, 2, 4, 8, 16)


@dataclass(frozen=True, eq=False)
class PatchedMesh:
    """One mesh over a base, the domain of both meshes. patch (m,) of each face, places (m, 3, 3): its corners
    in barycentric coordinates of the patch; cover; first (n,): the half-edge whose face gives the frame of each
    vertex; whole: the development before edges were split."""

    base: Base
    patch: IntArray
    places: FloatArray
    cover: Cover
    first: IntArray
    whole: Development


def common_domain(
    a: MapInput, b: MapInput, marks: Landmarks, method: str, monitor: Monitor
) -> tuple[PatchedMesh, PatchedMesh]:
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
        straighten(layout, method, 2 * len(marks.known))
    with monitor.stage("embed"):
        regions = np.array(layout.regions())
        base = base_of(regions, np.array(layout.ends))
        first, second = (
            _patched(t, side, base, regions, method)
            for t, side in zip(layout.tracers, (a, b), strict=True)
        )
    return first, second


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
    q = interpolated(places.reshape(-1, 3)[first], base.corners[patch[first // 3]])
    cover = Cover(base.geometry, development, base.geometry.normal(q))
    if (signs_of(cover.cones) <= 0).any():
        q = mended(base.geometry, development, tracer.on, cover.vectors)
        cover = replace(cover, vectors=q)
        collapsed = int((signs_of(cover.cones) <= 0).sum())
        if collapsed:
            raise NoResultError(
                f"{collapsed} faces collapse between landmarks, beyond double precision: "
                "give a landmark at the end of every long thin part"
            )
    return PatchedMesh(
        base, patch, places, cover, first, whole_development(development, side.closed)
    )


def composed(
    a: MapInput, b: MapInput, marks: Landmarks, one: PatchedMesh, two: PatchedMesh
) -> CoverPoints:
    """All vertices of the mesh of A on the mesh of B, each looked for in its patch, boundaries by length."""
    patch, place = one.patch[one.first // 3], one.places.reshape(-1, 3)[one.first]
    tree = cKDTree(np.column_stack([PATCH_DISTANCE * two.patch, two.places.mean(1)]))
    near = tree.query(np.column_stack([PATCH_DISTANCE * patch, place]))[1]
    found = two.cover.find(one.cover.vectors, np.asarray(near, np.int64))
    return found.put(*along_boundaries(a, b, marks, two.cover.mesh))


def along_boundaries(
    a: MapInput, b: MapInput, marks: Landmarks, mesh: ClosedMesh
) -> tuple[IntArray, CoverPoints]:
    """(vertices (k,) on the boundaries of A, their places on the mesh of B): by length between two corners.

    The edges along boundaries are never split, so they are those of the surface.
    """
    vertices, half_edges, shares = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
    for corners in marks.corners:
        loop_a, at_a = a.from_corners([marks.a[c] for c in corners])
        loop_b, at_b = b.from_corners([marks.b[c] for c in corners])
        k = np.clip(np.searchsorted(at_b, at_a, side="right") - 1, 0, len(loop_b) - 1)
        end = np.r_[at_b[1:], float(len(corners))]
        vertices.append(loop_a)
        half_edges.append(mesh.half_edges(loop_b, np.roll(loop_b, -1))[k])
        shares.append(np.clip((at_a - at_b[k]) / (end[k] - at_b[k]), 0, 1))
    on = Places.along(np.concatenate(half_edges), np.concatenate(shares))
    turn = np.broadcast_to(np.eye(3), (len(on.face), 3, 3))
    return np.concatenate(vertices), CoverPoints(on.face, on.weights, turn)


def straighten(layout: Layout, weights: str, first: int) -> None:
    """Replace the arcs from number ``first`` on by diagonals, on both meshes, in place.

    An arc is the diagonal of its two regions, which must make a quadrilateral. Arcs that have no region in
    common are replaced together.
    """
    region = layout.region_of()
    left = np.arange(first, len(layout.ends), 2)
    corners = [{layout.ends[side][0] for side in _sides(layout, arc)} for arc in left.tolist()]
    left = left[[len(own) == 4 for own in corners]]
    while len(left):
        now = matching(-np.arange(float(len(left))), region[left], region[left ^ 1], len(region))
        for tracer in layout.tracers:
            _lay_diagonals(tracer, layout, left[now].tolist(), weights)
            tracer.split_chords()
        left = np.delete(left, now)


def _lay_diagonals(tracer: Tracer, layout: Layout, arcs: list[int], weights: str) -> None:
    """Replace some arcs of one mesh, whose pairs of patches do not touch each other."""
    mesh, region = tracer.mesh, layout.region_of()
    name = np.full(len(region), -1)
    name[region[arcs]] = name[region[[arc ^ 1 for arc in arcs]]] = np.arange(len(arcs))
    of_face = name[tracer.regions(layout.regions())]
    sides = [_sides(layout, arc) for arc in arcs]
    uv = laid_in_polygons(tracer, of_face, sides, SQUARE, weights).reshape(-1, 2)
    h = np.flatnonzero((of_face >= 0).repeat(3))
    h = h[(h < mesh.twin[h]) & (of_face[mesh.twin[h] // 3] == of_face[h // 3])]
    following = next_half_edge(h)
    a, b = mesh.faces.ravel()[h], mesh.faces.ravel()[following]
    side_a, side_b = (uv[k, 0] - uv[k, 1] - DIAGONAL_OFFSET for k in (h, following))
    ends = tracer.marks[np.array([layout.ends[arc] for arc in arcs])][of_face[h // 3]]
    cross = (
        ((side_a > 0) != (side_b > 0)) & (a[:, None] != ends).all(1) & (b[:, None] != ends).all(1)
    )
    t = (side_a / np.where(cross, side_a - side_b, 1.0))[cross]
    h, following = h[cross], following[cross]
    along = ((1 - t)[:, None] * uv[h] + t[:, None] * uv[following]).sum(1)
    new, middle = mesh.split(h, np.clip(t, LEAST_SPLIT_SHARE, 1 - LEAST_SPLIT_SHARE))
    tracer.renew(new)
    split_by = np.full(len(uv), -1)
    split_by[h] = split_by[mesh.twin[h]] = middle
    order = np.lexsort((along, of_face[h // 3]))
    for number, arc in enumerate(arcs):
        own = order[of_face[h[order] // 3] == number]
        i, j = tracer.marks[list(layout.ends[arc])]
        path = np.concatenate([[i], middle[own], [j]])
        # the old path, with the vertices that split it
        if (new.half_edges(path[:-1], path[1:]) < 0).any():
            old = tracer.arcs[arc]
            between = split_by[mesh.half_edges(old[:-1], old[1:])]
            path = np.stack([old, np.r_[between, -1]], 1).ravel()
            path = path[path >= 0]
        tracer.lay(arc, path)


def _sides(layout: Layout, arc: int) -> list[int]:
    """The arcs round the two regions of an arc, counter-clockwise from its start, the right one first."""
    right, left = layout.after(arc ^ 1), layout.after(arc)
    return [right, layout.after(right), left, layout.after(left)]


def laid_in_polygons(
    tracer: Tracer, polygon: IntArray, arcs: list[list[int]], corners: FloatArray, weights: str
) -> FloatArray:
    """(m, 3, d) places of the corners of faces in flat convex polygons with corners (c, d).

    polygon (m,): that of each face, −1 if it lies in none and has no places. arcs: those round each polygon,
    laid along its sides by arc length; no polygon has a landmark twice. Inner vertices are one linear system.
    weights: row of WEIGHTS.
    """
    mesh, own = tracer.mesh, np.flatnonzero(polygon >= 0)
    # a vertex between two polygons has a place in each
    labels = polygon[own][:, None] * mesh.n + mesh.faces[own]
    key, faces = np.unique(labels, return_inverse=True)
    part = CutMesh(
        faces.reshape(-1, 3),
        mesh.cut_mesh.rest_triangles[own],
        polygon[own],
        np.zeros((0, 2), np.int64),
    )
    w = half_edge_weights(mesh.cut_mesh, WEIGHTS[weights].function).reshape(-1, 3)[own]
    # along the sides of the polygons: keys polygon · n + vertex, and places
    keys, along = [], []
    for number, own_arcs in enumerate(arcs):
        for arc, start, end in zip(own_arcs, corners, np.roll(corners, -1, 0), strict=True):
            path = tracer.arcs[arc]
            t = mesh.shares(path)[:, None]
            keys.append(number * mesh.n + path)
            along.append((1 - t) * start + t * end)
    side, first = np.unique(np.concatenate(keys), return_index=True)
    places = np.zeros((len(key), corners.shape[1]))
    free = np.ones(len(key), bool)
    at = np.searchsorted(key, side)
    places[at], free[at] = np.concatenate(along)[first], False
    system = HeldFactor(assemble(part, w.ravel(), free), ~free)
    places = system.solve(np.zeros_like(places), places[~free])
    out = np.zeros((len(mesh.faces), 3, corners.shape[1]))
    out[own] = places[part.faces]
    return out


def mended(
    geometry: Geometry, development: Development, fixed: BoolArray, q: FloatArray
) -> FloatArray:
    """Vectors (n, 3) of the vertices with fewer faces turned over than by q (n, 3).

    development: of a mesh over the geometry. fixed (n,): vertices that stay. Patches of some rings round turned
    faces, each in the tangent plane of its middle, are untangled by the foldover-free energy. Patches with
    vertices out of sight stay.
    """
    mesh = development.mesh
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    for rings in UNTANGLED_RINGS:
        turned = development.turned(q)
        if not turned.any():
            break
        near = mask_of(mesh.n, mesh.faces[grow(mesh.cut_mesh, turned, rings)])
        region = np.asarray(near[mesh.faces].all(1))
        part, vertices, rest = cut_out(mesh.cut_mesh, region, fixed)
        faces = np.flatnonzero(mask_of(mesh.n, vertices[~rest])[mesh.faces].any(1))
        own, n = part.vertex_chart, part.n_charts
        # all vertices of a patch in the frame of its first face
        patch = scattered(len(mesh.faces), faces, part.chart)
        within = (patch[face] >= 0) & (patch[face] == patch[mesh.twin // 3])
        way = development.rolled_out(faces[first_of_each(part.chart, n)], within)[1]
        corner = first_of_each(part.faces.ravel(), len(vertices))
        corner = 3 * faces[corner // 3] + corner % 3
        into = way[corner // 3] @ development.of(corner)
        seen = np.einsum("kab,kb->ka", into, q[vertices])
        uv, back = geometry.projected(seen, own, n)
        rest |= group_count(own[~np.isfinite(uv).all(1)], n)[own] > 0
        uv = np.nan_to_num(uv)
        area = group_sum(np.abs(signed_areas(part.faces, uv)), part.chart, n)
        unit = np.sqrt(part.chart_areas / np.maximum(area, 1e-300))[own][:, None]
        found, _ = untangle(part, uv * unit, rest)
        new = np.linalg.solve(into, back(found / unit)[..., None])[..., 0]
        q = q.copy()
        q[vertices[~rest]] = geometry.normal(np.asarray(new, np.float64))[~rest]
    return q
