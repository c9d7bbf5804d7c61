"""Smooth regions and flats of a hard surface: where its edges are sharp, and what a seam costs there."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from circparam.core.arrays import (
    ends_of,
    first_of_each,
    group_min,
    group_sum,
    mask_of,
    slices,
    unit,
)
from circparam.core.graph import components, nearest, undirected
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.intrinsic import corner_angles
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import corner_classes
from circparam.mesh.surface import Surface

Measured = TypeVar("Measured")

NOISE = 3e-7  # of the extent of the mesh: single precision and exporters move a point so far
NEEDLE = 1e-6  # height over longest edge: no normal of a flatter face is sure
ACROSS = 2.0  # times its length: a sharp edge counts so long when a needle looks for the face it belongs to
# edges that turn less lie inside a flat, and noise turns sure normals by less
FLAT = np.radians(0.5)
LEVEL = 2 * FLAT  # no face of a flat leans more against its mean normal
SHARP = np.radians(30)  # edges that turn more bound smooth regions
CREASE = np.radians(20)  # edges that turn more bound regions that cannot be laid out otherwise
BLUNT = 2 * CREASE  # creases that turn less may come from few faces on a round shape
CURVED = 0.3  # radians of curvature: a region with less counts as developable
FLAT_FACES = 2  # facets of several faces have more: any quad is cut in two
# of the area of its component: a designer's flat has more, facets of round shapes less (figures in
# docs/experiments/hard-surfaces.md)
LARGE_FLAT = 0.01
REGION_FACES = 2  # at least in the mean region of a part: noise has regions of one face
# of the area in flats: a surface with more is made of facets, and is hard for sure if creases bound large ones
MOST_FLAT = 0.5
MOST_REGIONS = 0.75  # of the area in developable regions between creases: a hard surface has more
MOST_BLUNT = 0.5  # of the length of its creases: a hard surface has fewer blunt ones


def face_heights(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """((m,) heights of faces over their longest edges, (m,) those edges)."""
    x, y = surface.rest_triangles.T
    dx, dy = x[[1, 2, 0]] - x, y[[1, 2, 0]] - y
    longest = np.sqrt((dx * dx + dy * dy).max(0))
    return 2 * surface.areas / np.maximum(longest, 1e-300), longest


def extent(surface: Surface) -> float:
    """The largest coordinate, seen from the origin or from the middle: what noise scales with."""
    axes = surface.points[mask_of(len(surface.points), surface.faces)].T.copy()
    return max((float(max(np.abs(x).max(), np.ptp(x))) for x in axes if len(x)), default=0.0)


def kept(measure: Callable[[Surface], Measured]) -> Callable[[Surface], Measured]:
    """A measurement of surfaces that is made once for each, and kept as long as the surface is used."""
    known: WeakKeyDictionary[Surface, Measured] = WeakKeyDictionary()

    @wraps(measure)
    def once(surface: Surface) -> Measured:
        if surface not in known:
            known[surface] = measure(surface)
        return known[surface]

    return once


@kept
def sure_normals(surface: Surface) -> FloatArray:
    """(m, 3) unit normals; needles, whose own are noise, take that of the face beyond their longest edges.

    Where noise leaves them half a normal, faces beyond a sharp edge count as beyond a shorter one: the needle
    between two holes of a flat is no part of the wall of either.
    """
    height, longest = face_heights(surface)
    noise = NOISE * extent(surface)
    sure = (height > noise / FLAT) & (height > NEEDLE * longest)
    if sure.all() or not sure.any():
        return surface.normals
    fi, fj = surface.sides
    touch = ~sure[fi] | ~sure[fj]
    length = surface.edge_lengths[touch]
    step = 1 / np.maximum(length, 1e-9 * max(float(length.max(initial=0.0)), 1e-300))
    a, b = fi[touch], fj[touch]
    told = (height[a] > noise) & (height[b] > noise)
    along = np.abs((surface.normals[a] * surface.normals[b]).sum(1))
    step *= np.where(told & (along < np.cos(SHARP)), ACROSS, 1.0)
    links = undirected(len(sure), a, b, step)
    _, _, source = nearest(links, np.flatnonzero(sure))
    return surface.normals[np.where(source >= 0, source, np.arange(len(sure)))]


@kept
def turns(surface: Surface) -> tuple[FloatArray, BoolArray]:
    """((e,) angle between the sure normals of both faces of each edge in radians, (e,) bool: it is concave)."""
    n, points = sure_normals(surface), surface.points
    count = len(surface.edges)
    angle, concave = np.empty(count), np.empty(count, bool)
    for k in slices(count):
        h, other = surface.edges[k].T
        a, b = n[h // 3].T, n[other // 3].T
        start, end = ends_of(surface.faces, h)
        along = (points[end] - points[start]).T
        x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        angle[k] = np.arctan2(
            np.sqrt(x * x + y * y + z * z), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        )
        concave[k] = x * along[0] + y * along[1] + z * along[2] < 0
    return angle, concave


@kept
def flats(surface: Surface) -> tuple[IntArray, BoolArray]:
    """((m,) flat of each face, (e,) bool: edges inside flats).

    A flat is what hangs together across edges that hardly turn, and is level as a whole: a fine tube is not.
    """
    inside = _level(surface, turns(surface)[0] < FLAT)
    return components(len(surface.faces), *surface.sides[:, inside])[1], inside


@kept
def level_edges(surface: Surface) -> BoolArray:
    """(e,) bool: edges inside flats, and those of curved rows of quads that lie inside one quad.

    A row of quads along a bent tube turns less than a flat from each to the next, but is not level. The edges
    across a quad turn by no more than errors of NOISE in all three coordinates let them.
    """
    error = 2 * np.sqrt(3) * NOISE * extent(surface)
    slack = error / np.maximum(face_heights(surface)[0], 1e-300)
    inside, angle = flats(surface)[1], turns(surface)[0]
    even = ~inside & (angle < np.minimum(slack[surface.sides].sum(0), FLAT))
    return inside | _level(surface, even)


def _level(surface: Surface, inside: BoolArray) -> BoolArray:
    """(e,) bool: the edges ``inside`` ((e,) bool), but for those of patches that are not level as a whole."""
    n, patch = components(len(surface.faces), *surface.sides[:, inside])
    normal = sure_normals(surface)
    mean = unit(group_sum(normal * surface.areas[:, None], patch, n))
    level = group_min((mean[patch] * normal).sum(1), patch, n) > np.cos(LEVEL)
    return inside & level[patch[surface.sides[0]]]


def curvature(cut_mesh: CutMesh) -> tuple[FloatArray, BoolArray]:
    """((nv,) 2π less the angles at inner vertices, π less them on boundaries, (nv,) bool: on a boundary)."""
    angles = corner_angles(cut_mesh).ravel()
    total = group_sum(angles, cut_mesh.faces.ravel(), cut_mesh.n_vertices)
    rim = cut_mesh.on_boundary
    return np.where(rim, np.pi, 2 * np.pi) - total, rim


def hard_components(surface: Surface) -> BoolArray:
    """(m,) bool: the component of the face may be a hard surface, by measurement.

    Much of its area lies in developable regions between creases that are sharp: blunt ones may come from few
    faces on a round shape, but not the lines of a tube, which is developable across them. Or what lies in flats
    lies mostly in large ones: fillets join the regions of a part. Few scans and organic shapes have either.
    """
    n, component = surface.components
    large = large_flats(surface)
    large_share = _share_in_flats(surface, large)
    several = np.bincount(flats(surface)[0]) > FLAT_FACES
    flat_share = _share_in_flats(surface, large | several)
    count, region, developable = developable_regions(surface)
    region_share = area_share(surface, developable[region])
    hard: BoolArray = large_share > flat_share / 2
    regions = np.bincount(component[first_of_each(region, count)], minlength=n)
    wide = np.bincount(component) >= REGION_FACES * regions
    developed = (region_share >= MOST_REGIONS) & wide & ~hard
    if developed.any():
        hard[developed] = _creased_sharply(surface.part(developed[component]))
    return hard[component]


def _creased_sharply(surface: Surface) -> BoolArray:
    """(components,) bool: most of the length of its creases is sharp, or the rim of a tube."""
    n, component = surface.components
    angle, _ = turns(surface)
    on = angle >= CREASE
    of, length = component[surface.sides[0, on]], surface.edge_lengths[on]
    _, smooth, tube = developable_regions(surface, BLUNT)
    round_shape = (angle[on] < BLUNT) & ~tube[smooth[surface.sides[0, on]]]
    blunt, creases = group_sum(length * round_shape, of, n), group_sum(length, of, n)
    return blunt <= MOST_BLUNT * creases


def surely_hard(surface: Surface) -> BoolArray:
    """(m,) bool: large flats that creases bound cover most of the component of the face."""
    share = _share_in_flats(surface, creased_flats(surface))
    return (share >= MOST_FLAT)[surface.components[1]]


def _share_in_flats(surface: Surface, chosen: BoolArray) -> FloatArray:
    """(components,) share of the area in the chosen flats ((flats,) bool)."""
    return area_share(surface, chosen[flats(surface)[0]])


def area_share(surface: Surface, faces: BoolArray) -> FloatArray:
    """(components,) share of the area in those faces ((m,) bool)."""
    n, component = surface.components
    total = np.maximum(group_sum(surface.areas, component, n), 1e-300)
    return group_sum(surface.areas * faces, component, n) / total


def edges_inside(surface: Surface, chosen: BoolArray) -> BoolArray:
    """(e,) bool: edges inside the chosen flats ((flats,) bool)."""
    flat, inside = flats(surface)
    return inside & chosen[flat[surface.sides[0]]]


def large_flats(surface: Surface) -> BoolArray:
    """(flats,) bool: flats of several faces that have as much of their component as a designer gives them."""
    n, component = surface.components
    flat, _ = flats(surface)
    whole = group_sum(surface.areas, component, n)
    count = int(flat.max(initial=-1)) + 1
    of_flat = component[first_of_each(flat, count)]
    large = group_sum(surface.areas, flat, count) > LARGE_FLAT * whole[of_flat]
    return large & (np.bincount(flat) > 1)


def facets(surface: Surface) -> BoolArray:
    """(e,) bool: edges inside flats of organic components that are mostly flats: bent tubes of quads."""
    flat, inside = flats(surface)
    share = _share_in_flats(surface, np.bincount(flat) > 1)[surface.components[1]]
    inside = inside & (share >= MOST_FLAT)[surface.sides[0]]
    if inside.any():
        inside &= ~hard_components(surface)[surface.sides[0]]
    return inside


def creased_flats(surface: Surface) -> BoolArray:
    """(flats,) bool: large flats whose rim is creases or boundary, at least half of it."""
    flat, _ = flats(surface)
    large = large_flats(surface) & (np.bincount(flat) > FLAT_FACES)
    left, right = flat[surface.sides]
    length = np.where(left == right, 0.0, surface.edge_lengths)
    length = np.where(turns(surface)[0] >= CREASE, length, -length)
    balance = group_sum(length, left, len(large)) + group_sum(length, right, len(large))
    balance += group_sum(surface.boundary_lengths, flat[surface.boundary // 3], len(large))
    return large & (balance >= 0)


def developable_regions(
    surface: Surface, crease: float = CREASE
) -> tuple[int, IntArray, BoolArray]:
    """(number of regions between creases, (m,) region of each face, (regions,) bool: hardly any curvature).

    crease: radians by which the edges between two regions turn at least.
    """
    inner = turns(surface)[0] < crease
    edges = surface.edges[inner]
    _, corners = corner_classes(len(surface.faces), edges)
    count, region = components(len(surface.faces), *surface.sides[:, inner])
    cut_mesh = CutMesh(corners, surface.rest_triangles, region, edges)
    defect, rim = curvature(cut_mesh)
    bent = group_sum(np.where(rim, 0.0, np.abs(defect)), cut_mesh.vertex_chart, count)
    return count, region, bent < CURVED
