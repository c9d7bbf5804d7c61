"""The layout of one mesh on another mesh of the same shape: seams follow, and no face flips.

Every face of the target takes the chart that covers most of it. Every corner takes the closest point of that
chart, on one side of each seam. Neighbours whose shared corners have the same uv stay connected; all other
edges are seams. Flipped or overlapping faces try another chart or another side of a seam. A linear program
moves the rest by the least drift (``least_drift``). The few faces that it cannot mend go to free room
(``_lay_anew``).
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sps
from scipy.spatial import cKDTree

from circparam.core.arrays import (
    cross_areas,
    first_of_groups,
    group_sum,
    interpolated,
    next_half_edge,
    slices,
    unit,
)
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import NoResultError
from circparam.geometry.closest import Nearest, closest_on_triangles, samples_of, walked
from circparam.geometry.distortion import Tail
from circparam.geometry.gradient_transfer import space_gradients, turn_gradients
from circparam.geometry.intrinsic import signed_areas
from circparam.maps.least_drift import LEAST_HEIGHT_PAGES, faults, heights, meetings, mend
from circparam.maps.surface_map import Places
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import faces_across
from circparam.mesh.surface import Surface
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.room import by_page, find_room

CANDIDATE_SAMPLES = 12  # nearest samples whose faces are tried for the closest point
WALK_STEPS = 64  # to neighbours, for as long as one is nearer
CHART_SAMPLE_BOUNDS = (50_000, 1_000_000)  # samples of a surface
UV_WEIGHT = 0.3  # of a distance in uv against one in space, in the choice of a side of a seam
PLACES_AT_ONCE = 20_000  # places sought at once: some kilobytes each
LAYER_DIAGONALS = 10.0  # diagonals by which charts lie apart
# Probes of a face that choose its chart, its middle first: the nearest point to the middle leads the corners.
PROBES = np.array(
    [
        [4, 4, 4], [8, 2, 2], [2, 8, 2], [2, 2, 8],
        [6, 5, 1], [1, 6, 5], [5, 1, 6], [5, 6, 1], [1, 5, 6], [6, 1, 5],
    ]
) / 12  # fmt: skip
SAME_EDGE_SHARE = 0.25  # of an edge in uv, by which its faces may place its ends apart,
SAME_PAGE_SHARE = 1 / 2048  # and of the page at most: the ends move to their middle
RELABEL_ROUNDS = 12  # rounds in which faces at fault go to charts of their neighbours; most need 3
LOOSENING_ROUNDS = 3  # rounds in which faces at fault are let go
PAIRS_AT_ONCE = 4_000_000  # of triangles and faces, whose boxes are compared


@dataclass(frozen=True, eq=False)
class SurfacePoints(Places):
    """Places on a surface. distance: (p,) from the places they were sought for."""

    distance: FloatArray


def _in_blocks(find: Callable[..., SurfacePoints], *arrays: np.ndarray) -> SurfacePoints:
    """A search for the rows of arrays, block by block, which bounds the memory."""
    blocks = slices(len(arrays[0]), PLACES_AT_ONCE)
    return SurfacePoints.joined(*(find(*(a[k] for a in arrays)) for k in blocks))


class SourceCharts:
    """A surface with its layout; closest points on any chart, or on one chart near a known place."""

    def __init__(self, atlas: Atlas) -> None:
        surface = atlas.surface
        self.atlas = atlas
        self.count, self.chart = atlas.charts()
        self.corners = surface.corners
        self.gradients = space_gradients(atlas)
        box = np.ptp(self.corners.reshape(-1, 3), axis=0)
        self.diagonal = max(float(np.linalg.norm(box)), 1e-300)
        self.beside = faces_across(len(surface.faces), surface.edges[~atlas.cut])
        ratio = np.abs(cross_areas(atlas.corners)) / 2 / np.maximum(surface.areas, 1e-300)
        self.scale = float(np.sqrt(max(Tail.of(ratio, surface.areas).percentile(50), 1e-300)))
        self.sample, bary = samples_of(surface.areas, CHART_SAMPLE_BOUNDS)
        self.places = interpolated(bary, self.corners[self.sample])
        uv = interpolated(bary, atlas.corners[self.sample])
        self.free = cKDTree(self.places)
        self.layered = cKDTree(self._lifted(self.places, self.chart[self.sample], uv))

    def _lifted(self, places: FloatArray, chart: IntArray, uv: FloatArray) -> FloatArray:
        """(p, 6) places lifted apart by chart, and across a seam of one chart by uv."""
        layer = chart[:, None] * (LAYER_DIAGONALS * self.diagonal)
        return np.concatenate([places, layer, UV_WEIGHT / self.scale * uv], axis=1)

    def anywhere(self, places: FloatArray, normals: FloatArray) -> SurfacePoints:
        """The closest points; where possible, on faces whose normals agree with the given ones."""
        found = self.sample[_nearest(self.free, places)]
        bary, d2 = closest_on_triangles(places[:, None], self.corners[found])
        away = np.einsum("pkc,pc->pk", self.atlas.surface.normals[found], normals) <= 0
        away &= ~away.all(1)[:, None]
        best = np.where(away, np.inf, d2).argmin(1)
        rows = np.arange(len(places))
        return SurfacePoints(found[rows, best], bary[rows, best], np.sqrt(d2[rows, best]))

    def on_chart(self, places: FloatArray, chart: IntArray, expected: FloatArray) -> SurfacePoints:
        """The closest points of charts (p,), each on the side of seams where the expected uv (p, 2) lies."""
        first = self._walked(places, self._sampled(places, chart, expected))
        # a walk ends at a vertex whose faces beside it are as near: samples round that place lead further
        return self._walked(places, self._sampled(places, chart, self.uv(first)), first)

    def _sampled(self, places: FloatArray, chart: IntArray, expected: FloatArray) -> SurfacePoints:
        """The best points on faces with near samples; ``distance`` holds squared distances."""
        lifted = self._lifted(places, chart, expected)
        found = self.sample[_nearest(self.layered, lifted)]
        bary, d2 = closest_on_triangles(places[:, None], self.corners[found])
        uv = np.einsum("pjk,pjkc->pjc", bary, self.atlas.corners[found])
        off = ((uv - expected[:, None]) ** 2).sum(2) * (UV_WEIGHT / self.scale) ** 2
        off[self.chart[found] != chart[:, None]] = np.inf
        best = (d2 + off).argmin(1)
        rows = np.arange(len(places))
        return SurfacePoints(found[rows, best], bary[rows, best], d2[rows, best])

    def _walked(
        self, places: FloatArray, start: SurfacePoints, other: SurfacePoints | None = None
    ) -> SurfacePoints:
        """Walk to neighbouring faces of the same chart while one is nearer; ``start`` holds squared distances.

        other: points with distances. They stay where the walk ends no nearer.
        """

        def best(rows: IntArray, faces: IntArray) -> Nearest:
            bary, gap = closest_on_triangles(places[rows][:, None], self.corners[faces])
            first = np.arange(len(rows)), gap.argmin(1)
            return faces[first], bary[first], gap[first]

        face, bary, d2 = walked(
            (start.face, start.weights, start.distance), self.beside, best, WALK_STEPS
        )
        out = SurfacePoints(face, bary, np.sqrt(d2))
        if other is not None:
            stay = np.flatnonzero(other.distance <= out.distance)
            out.put(stay, other.take(stay))
        return out

    def uv(self, spots: SurfacePoints) -> FloatArray:
        """(p, 2) places of points in the layout."""
        return interpolated(spots.weights, self.atlas.corners[spots.face])

    def expected(self, spots: SurfacePoints, places: FloatArray, normals: FloatArray) -> FloatArray:
        """(p, 2) uv of places beside points, continued along the plane of the normals."""
        there = interpolated(spots.weights, self.corners[spots.face])
        normal = self.atlas.surface.normals[spots.face]
        turned = turn_gradients(self.gradients[spots.face], normal, normals)
        return self.uv(spots) + np.einsum("pdx,px->pd", turned, places - there)


def _nearest(tree: cKDTree, places: FloatArray) -> IntArray:
    return tree.query(places, k=min(CANDIDATE_SAMPLES, tree.n))[1].reshape(len(places), -1)


@dataclass(frozen=True, eq=False)
class CarriedLayout:
    """A layout on the target.

    drift: (m, 3) distance in uv of every corner from the closest point of its chart, 0 for loose faces. inside:
    (m,) the same at the middle of every face, where a flat face cuts through a curved surface. loose: (m,)
    bool, faces in free room. least: lower bound, in uv, on the largest drift of any layout without flips.
    faulty: (m,) bool, faces that stay flipped or overlap.
    """

    atlas: Atlas
    drift: FloatArray
    inside: FloatArray
    loose: BoolArray
    least: float
    faulty: BoolArray

    @property
    def loose_share(self) -> float:
        """Share of the surface in free room."""
        areas = self.atlas.surface.areas
        return float(areas[self.loose].sum() / areas.sum())

    @property
    def farthest(self) -> FloatArray:
        """(3,) the vertex with the largest drift."""
        surface = self.atlas.surface
        face, corner = np.unravel_index(int(self.drift.argmax()), self.drift.shape)
        return np.asarray(surface.points[surface.faces[face, corner]])


def carry_charts(source: SourceCharts, target: Surface) -> CarriedLayout:
    """The layout of the charts on a target of the same shape."""
    m, k = len(target.faces), len(PROBES)
    places = np.einsum("kc,mcx->mkx", PROBES, target.corners)
    normals = np.repeat(target.normals, k, axis=0)
    probed = _in_blocks(source.anywhere, places.reshape(-1, 3), normals)
    chart = source.chart[probed.face].reshape(m, k)
    votes = (chart[:, :, None] == chart[:, None, :]).sum(2)
    # the first of the probes with the most votes leads the face; its chart may not hold the middle
    led = probed.take(np.arange(m) * k + votes.argmax(1))
    corners = _corner_points(source, target, led, np.arange(len(target.faces)))
    # 1 for a chart of the source, −1 for one that lies clockwise
    given = source.atlas.corners
    area = signed_areas(np.arange(3 * len(given)).reshape(-1, 3), given.reshape(-1, 2))
    sign = np.where(group_sum(area, source.chart, source.count) < 0, -1.0, 1.0)
    for _ in range(RELABEL_ROUNDS):
        if not _relabel(source, target, (probed, led, corners), sign):
            break
    uv = source.uv(corners).reshape(-1, 3, 2)
    of_face = sign[source.chart[led.face]]  # a chart of the target lies on one of the source
    atlas = Atlas(target, _seams(source, target, led, uv), uv)
    # faces that stay at fault are cut loose, and the rest is mended again
    loose = np.zeros(len(uv), bool)
    edges = atlas.surface.edges
    for left in range(LOOSENING_ROUNDS, -1, -1):
        atlas.cut |= loose[edges // 3].any(1)
        atlas.corners[:] = uv
        cut_mesh, _ = atlas.open()
        tight = group_sum(~loose, cut_mesh.chart, cut_mesh.n_charts) > 0
        part, vertices, faces = cut_mesh.subset(tight)
        joined = _means(cut_mesh, uv)
        joined[vertices] = mend(part, joined[vertices], of_face[faces])
        atlas.scatter(cut_mesh, joined)
        faulty = np.zeros(len(uv), bool)
        faulty[faces] = faults(part, joined[vertices], of_face[faces])
        if not faulty.any() or not left:
            break
        loose |= faulty
    drift = np.linalg.norm(atlas.corners - uv, axis=2)
    drift[loose] = 0.0
    least = max(0.0, float(-heights(uv[~loose], of_face[~loose])[0].min(initial=0.0) / 2))
    _lay_anew(atlas, loose, source.scale)
    places = target.corners.mean(1)
    expected = source.expected(led, places, target.normals)
    middle = source.uv(_in_blocks(source.on_chart, places, source.chart[led.face], expected))
    inside = np.linalg.norm(atlas.corners.mean(1) - middle, axis=1)
    inside[loose] = 0.0
    return CarriedLayout(atlas, drift, inside, loose, least, faulty)


def _lay_anew(atlas: Atlas, loose: BoolArray, scale: float) -> None:
    """Lay faces ((m,) bool, with all edges cut) beside the charts of an atlas, without distortion. In place.

    scale: uv units per unit of the mesh. Raises NoResultError where no page has room.
    """
    if not loose.any():
        return
    cut_mesh, _ = atlas.open()
    face = np.flatnonzero(loose)
    corner = np.arange(3 * len(face)).reshape(-1, 3)
    flat = scale * cut_mesh.rest_triangles[face].reshape(-1, 2)
    shapes = shapes_of(corner, flat, np.arange(len(face)))
    room = find_room(shapes, by_page(atlas.corners[~loose]), PackOptions(), True)
    if room is None:
        raise NoResultError(
            f"{len(face)} faces overlap others, and no page has room for them: give a finer mesh"
        )
    atlas.corners[face] = room.uv[corner]


def _corner_points(
    source: SourceCharts, target: Surface, led: SurfacePoints, faces: IntArray
) -> SurfacePoints:
    """The closest points (3f,) for the corners of faces (f,), on the charts that lead them."""
    lead = led.take(np.repeat(np.arange(len(faces)), 3))
    places = target.points[target.faces[faces]].reshape(-1, 3)
    normals = np.repeat(target.normals[faces], 3, axis=0)
    expected = source.expected(lead, places, normals)
    return _in_blocks(source.on_chart, places, source.chart[lead.face], expected)


def _relabel(
    source: SourceCharts,
    target: Surface,
    points: tuple[SurfacePoints, SurfacePoints, SurfacePoints],
    sign: FloatArray,
) -> bool:
    """Let other probes or neighbours lead faces at fault, so that they are less so; whether any did.

    A fault is as large as the face is turned, or as deep as it lies in another one. points: those of the
    probes, those that lead, those of the corners.
    """
    probed, led, corners = points
    uv = source.uv(corners).reshape(-1, 3, 2)
    height = heights(uv, sign[source.chart[led.face]])[0]
    bad = height <= 0
    cut_mesh, _ = Atlas(target, _seams(source, target, led, uv), uv).open()
    bad[meetings(cut_mesh, _means(cut_mesh, uv)).ravel() // 3] = True
    face = np.flatnonzero(bad)
    now = np.zeros(len(uv))
    now[face] = np.maximum(_depths(uv[face], face, uv), -height[face])
    face = face[now[face] > LEAST_HEIGHT_PAGES]
    if len(face) == 0:
        return False
    # pairs of faces at fault and all faces that share a vertex with them
    m = len(target.faces)
    corner = np.arange(3 * m)
    shape = (m, int(target.corner_vertex.max()) + 1)
    at = sps.csr_matrix((np.ones(3 * m), (corner // 3, target.corner_vertex.ravel())), shape)
    pairs = (at[face] @ at.T).tocoo()
    other, beside = face[pairs.row], pairs.col.astype(np.int64)
    own = np.repeat(face, len(PROBES))
    probe = len(PROBES) * own + np.tile(np.arange(len(PROBES)), len(face))
    face = np.concatenate([own, other])
    lead = SurfacePoints.joined(probed.take(probe), led.take(beside))
    found = _corner_points(source, target, lead, face)
    there = source.uv(found).reshape(-1, 3, 2)
    fault = -heights(there, sign[source.chart[lead.face]])[0]
    rows = np.flatnonzero(fault < now[face] / 2)
    fault = np.maximum(fault[rows], _depths(there[rows], face[rows], uv))
    good = fault < now[face[rows]] / 2
    rows, fault = rows[good], fault[good]
    if len(rows) == 0:
        return False
    # of several with a little fault the one whose corners lie nearest, else the one with the least fault
    far = found.distance.reshape(-1, 3).max(1)[rows]
    worth = np.where(fault < 2 * SAME_PAGE_SHARE, far, source.diagonal + fault)
    rows = rows[first_of_groups(face[rows], worth)]
    own, new = ((3 * k[:, None] + np.arange(3)).ravel() for k in (face[rows], rows))
    led.put(face[rows], lead.take(rows))
    corners.put(own, found.take(new))
    return True


def _depths(triangles: FloatArray, own: IntArray, corners: FloatArray) -> FloatArray:
    """(c,) how deep triangles (c, 3, 2) lie in faces with corners (m, 3, 2), other than their own face (c,).

    The depth of two triangles is the least way along a normal of one of their sides that parts them.
    """
    low, high = corners.min(1), corners.max(1)
    out = np.zeros(len(triangles))
    for k in slices(len(triangles), max(1, PAIRS_AT_ONCE // max(1, len(corners)))):
        some = triangles[k]
        near = (some.min(1)[:, None] < high).all(2) & (some.max(1)[:, None] > low).all(2)
        near[np.arange(len(some)), own[k]] = False
        i, j = np.nonzero(near)
        a, b = some[i], corners[j]
        least = np.full(len(i), np.inf)
        for p in (a, b):
            side = p[:, [1, 2, 0]] - p
            normal = unit(np.stack([-side[..., 1], side[..., 0]], -1))
            x, y = (np.einsum("kcx,knx->knc", q, normal) for q in (a, b))
            way = np.minimum(x.max(2) - y.min(2), y.max(2) - x.min(2))
            least = np.minimum(least, way.min(1))
        np.maximum.at(out[k], i, least)
    return out


def _seams(source: SourceCharts, target: Surface, led: SurfacePoints, uv: FloatArray) -> BoolArray:
    """(e,) bool: edges whose faces lie on other charts, or see the ends of the edge at other places."""
    i, j = target.edges[:, 0], target.edges[:, 1]
    flat = uv.reshape(-1, 2)
    a, b = flat[i], flat[next_half_edge(i)]
    apart = np.maximum(
        np.linalg.norm(a - flat[next_half_edge(j)], axis=1), np.linalg.norm(b - flat[j], axis=1)
    )
    length = source.scale * target.edge_lengths
    chart = source.chart[led.face]
    return (chart[i // 3] != chart[j // 3]) | (
        apart > np.minimum(SAME_EDGE_SHARE * length, SAME_PAGE_SHARE)
    )


def _means(cut_mesh: CutMesh, corners: FloatArray) -> FloatArray:
    """(nv, 2) mean uv of the corners of each vertex."""
    flat, n = cut_mesh.faces.ravel(), cut_mesh.n_vertices
    count = np.maximum(np.bincount(flat, minlength=n), 1)
    return group_sum(corners.reshape(-1, 2), flat, n) / count[:, None]
