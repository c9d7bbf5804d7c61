"""Smooth regions and flats of a hard surface: where its edges are sharp, and what a seam costs there."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    cross2,
    group_min,
    group_sum,
    next_half_edge,
    slices,
)
from circparam.core.graph import components, nearest, undirected
from circparam.core.records import dataclass
from circparam.mesh.atlas import SeamPrices
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import corner_classes
from circparam.mesh.surface import Surface

NOISE = 3e-7  # of the extent of the mesh: how far single precision and exporters move a point
TURNED = 0.02  # radians by which such a move may turn the normal of a face that is sure of it
NEEDLE = 1e-6  # height over longest edge below which no face is sure of its normal
ACROSS = 3.0  # times as long a sharp edge has to be for a needle to belong with what lies beyond it
FLAT = np.radians(0.5)  # edges that turn less lie inside a flat
LEVEL = np.radians(1.0)  # no face of a flat leans more against the mean of it
SHARP = np.radians(30)  # edges that turn more bound smooth regions
CREASE = np.radians(20)  # so do these where a region cannot be laid out otherwise
CURVED = 0.3  # radians of curvature inside a region up to which it counts as developable
# a flat has at least so many faces to tell a hard surface: quads are cut in two anywhere
FLAT_FACES = 3
# regions are scraps, not parts, where more than MANY have fewer faces in the mean
SCRAPS, MANY = 8, 64
PAIRS = 2  # faces of a region in the mean, from which on sharp creases alone make it a part
ORGANIC, DOUBTFUL, HARD = 0, 1, 2
HARDLY = 0.1  # nor is there any doubt where so few of the creases are blunt
BLUNT, MOSTLY = (
    np.radians(40),
    0.5,
)  # of the creases of a hard surface less than that share turns less
HARD_FLATS, HARD_REGIONS = 0.25, 0.5  # shares of the area from which on a component is hard
# more regions than FEW have at least so many faces in the mean, where there is no doubt
FEW, PARTS = 16, 4
LARGE = 32  # faces of a region in the mean, from which on it is none of a round shape of few
CRUMBS = 0.01  # of the area: less of hard surfaces than that is taken as organic
SURE_FLATS, SURE_REGIONS = 0.6, 0.75  # and from which on there is no doubt
ALL_REGIONS = 0.9  # likewise, of regions between sharp edges


def face_heights(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """((m,) heights of faces over their longest edges, (m,) those edges)."""
    x, y = surface.rest_triangles.T
    dx, dy = x[[1, 2, 0]] - x, y[[1, 2, 0]] - y
    longest = np.sqrt((dx * dx + dy * dy).max(0))
    return 2 * surface.areas / np.maximum(longest, 1e-300), longest


def extent(surface: Surface) -> float:
    """The largest coordinate, seen from the origin or from the middle: what noise scales with."""
    used = np.zeros(len(surface.points), bool)
    used[surface.faces] = True
    axes = surface.points[used].T.copy()
    return max((float(max(np.abs(x).max(), np.ptp(x))) for x in axes if len(x)), default=0.0)


def sure_normals(surface: Surface) -> FloatArray:
    """(m, 3) unit normals; needles, whose own are noise, take that of the face beyond their longest edges.

    Where noise leaves them half a normal, faces beyond a sharp edge count as beyond a shorter one: the needle
    between two holes of a flat is no part of the wall of either.
    """
    height, longest = face_heights(surface)
    noise = NOISE * extent(surface)
    sure = (height > noise / TURNED) & (height > NEEDLE * longest)
    if sure.all() or not sure.any():
        return surface.normals
    fi, fj = surface.edges[:, 0] // 3, surface.edges[:, 1] // 3
    touch = ~sure[fi] | ~sure[fj]
    length = surface.edge_lengths[touch]
    step = 1 / np.maximum(length, 1e-9 * max(float(length.max(initial=0.0)), 1e-300))
    a, b = fi[touch], fj[touch]
    told = (height[a] > noise) & (height[b] > noise)
    along = np.abs((surface.normals[a] * surface.normals[b]).sum(1))
    step *= np.where(told & (along < np.cos(SHARP)), ACROSS, 1.0)
    links = undirected(len(sure), a, b, step)
    _, _, source = nearest(links, np.flatnonzero(sure))
    result: FloatArray = surface.normals[np.where(source >= 0, source, np.arange(len(sure)))]
    return result


def turns(surface: Surface) -> tuple[FloatArray, BoolArray]:
    """((e,) angle between the sure normals of both faces of each edge in radians, (e,) bool: it is concave)."""
    n, points, flat = sure_normals(surface), surface.points, surface.faces.ravel()
    count = len(surface.edges)
    angle, concave = np.empty(count), np.empty(count, bool)
    for k in slices(count):
        h, other = surface.edges[k].T
        a, b = n[h // 3], n[other // 3]
        cross = np.cross(a, b)
        along = points[flat[next_half_edge(h)]] - points[flat[h]]
        angle[k] = np.arctan2(np.linalg.norm(cross, axis=1), (a * b).sum(1))
        concave[k] = (cross * along).sum(1) < 0
    return angle, concave


def flats(surface: Surface, angle: FloatArray) -> tuple[IntArray, BoolArray]:
    """((m,) flat of each face, (e,) bool: edges inside flats). angle: (e,) of each edge.

    A flat is what hangs together across edges that hardly turn, and is level as a whole: a fine tube is not.
    """
    m = len(surface.faces)
    fi, fj = surface.edges[:, 0] // 3, surface.edges[:, 1] // 3
    inside = angle < FLAT
    n, flat = components(m, fi[inside], fj[inside])
    normal = sure_normals(surface)
    mean = np.stack([group_sum(normal[:, d] * surface.areas, flat, n) for d in range(3)], 1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-300)[:, None]
    level = group_min((mean[flat] * normal).sum(1), flat, n) > np.cos(LEVEL)
    inside &= level[flat[fi]]
    return components(m, fi[inside], fj[inside])[1], inside


def seam_prices(surface: Surface) -> SeamPrices:
    """The prices of all edges of a hard surface: sharp and concave ones are cheap, flats dear."""
    angle, concave = turns(surface)
    _, flat = flats(surface, angle)
    price = np.interp(angle, [FLAT, np.radians(5), CREASE, SHARP], [1.6, 1.2, 0.6, 0.4])
    price = np.where(flat | (angle < FLAT), 4.0, price * np.where(concave, 0.8, 1.0))
    return SeamPrices(price, flat, angle >= SHARP, angle >= CREASE)


def corner_angles(rest_triangles: FloatArray) -> FloatArray:
    """(m, 3) angle of every corner."""
    out = np.empty((len(rest_triangles), 3))
    for k in slices(len(out)):
        triangles = rest_triangles[k]
        ahead, back = triangles[:, [1, 2, 0]] - triangles, triangles[:, [2, 0, 1]] - triangles
        out[k] = np.arctan2(np.abs(cross2(ahead, back)), (ahead * back).sum(2))
    return out


def curvature(cut_mesh: CutMesh) -> tuple[FloatArray, BoolArray]:
    """((nv,) 2π less the angles at inner vertices, π less them on boundaries, (nv,) bool: on a boundary)."""
    flat = cut_mesh.faces.ravel()
    total = group_sum(corner_angles(cut_mesh.rest_triangles).ravel(), flat, cut_mesh.n_vertices)
    rim = np.zeros(cut_mesh.n_vertices, bool)
    rim[flat[cut_mesh.boundary]] = True
    return np.where(rim, np.pi, 2 * np.pi) - total, rim


@dataclass(frozen=True, eq=False)
class _Bounded:
    """Regions bounded by edges that turn more than some angle, summed over components.

    unrolls: share of the area in regions that hold hardly any curvature. regions: their number. creases: length
    of the edges between them; blunt: of it where they turn by less than BLUNT.
    """

    unrolls: FloatArray
    regions: IntArray
    creases: FloatArray
    blunt: FloatArray

    @staticmethod
    def of(surface: Surface, angle: FloatArray, limit: float) -> _Bounded:
        """angle: (e,) of every edge."""
        fi, fj = surface.edges[:, 0] // 3, surface.edges[:, 1] // 3
        n, component = surface.components
        total = np.maximum(group_sum(surface.areas, component, n), 1e-300)
        inner = angle < limit
        _, corners = corner_classes(len(surface.faces), surface.edges[inner])
        count, region = components(len(surface.faces), fi[inner], fj[inner])
        cut_mesh = CutMesh(corners, surface.rest_triangles, region, surface.edges[inner])
        defect, rim = curvature(cut_mesh)
        bent = group_sum(np.where(rim, 0.0, np.abs(defect)), cut_mesh.vertex_chart, count)
        unrolls = group_sum(surface.areas * (bent < CURVED)[region], component, n) / total
        _, first = np.unique(region, return_index=True)
        of, length = component[fi[~inner]], surface.edge_lengths[~inner]
        return _Bounded(
            unrolls,
            np.bincount(component[first], minlength=n),
            group_sum(length, of, n),
            group_sum(length * (angle[~inner] < BLUNT), of, n),
        )


def hardness(surface: Surface) -> IntArray:
    """(m,) ORGANIC, DOUBTFUL or HARD: what the component of each face is, by measurement.

    Hard surfaces have much of their area in flats of several faces, or in regions bounded by creases that hold
    hardly any curvature, and their creases are sharp: where most of them are blunt, it may be a round shape of
    few faces, unless all of it unrolls between its sharp edges alone. Scans and organic shapes have neither; a
    soup of tiny regions has no parts worth keeping whole.
    """
    n, component = surface.components
    angle, _ = turns(surface)
    total = np.maximum(group_sum(surface.areas, component, n), 1e-300)
    flat, _ = flats(surface, angle)
    in_flat = (np.bincount(flat) >= FLAT_FACES)[flat]
    share = group_sum(surface.areas * in_flat, component, n) / total
    size = np.bincount(component, minlength=n)
    found = _Bounded.of(surface, angle, CREASE)
    regions, creases, blunt = found.regions, found.creases, found.blunt
    scraps = (regions > MANY) & (regions * SCRAPS > size)
    # fins and combs are boxes beside boxes, of two triangles a side; noise has regions of one face
    scraps &= (blunt >= HARDLY * creases) | (regions * PAIRS > size)
    whole = (regions <= FEW) | (regions * PARTS <= size)
    candidate = (share >= HARD_FLATS) | ((creases > 0) & (found.unrolls >= HARD_REGIONS) & ~scraps)
    clear = (share >= SURE_FLATS) | ((found.unrolls >= SURE_REGIONS) & whole)
    # no round shape of few faces has so much in flats of several, or regions so large that unroll
    plain = (share >= SURE_FLATS) | ((found.unrolls >= SURE_REGIONS) & (regions * LARGE <= size))
    plain &= blunt < (1 - HARDLY) * creases
    sure = plain | (blunt < MOSTLY * creases) & (clear | (blunt < HARDLY * creases))
    if (candidate & ~sure).any():
        # a tube of few sides has blunt creases along it, and unrolls
        parts = _Bounded.of(surface, angle, SHARP)
        sharp = (parts.creases > 0) & (parts.blunt < HARDLY * parts.creases)
        sure |= sharp & (parts.unrolls >= ALL_REGIONS) & (parts.regions * PARTS <= size)
    kind = np.where(candidate, np.where(sure, HARD, DOUBTFUL), ORGANIC)
    if total[kind != ORGANIC].sum() < CRUMBS * total.sum():
        # a few fragments beside an organic shape are not worth a way of their own
        kind[:] = ORGANIC
    result: IntArray = kind[component]
    return result
