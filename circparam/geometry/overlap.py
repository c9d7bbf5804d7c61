"""Whether a layout is one to one: exact signs of faces, charts that overlap themselves or each other.

A chart with positive faces is one to one exactly under two conditions: the faces wind once round every inner
vertex, and no two parts of its boundary meet. (A boundary without self-intersection winds round every point at
most once. With inner vertices wound once the turning numbers of the loops sum to 2πχ. Exactly one loop then
runs counter-clockwise, and every point has at most one preimage.) So only boundaries are compared, never faces.

Meeting is decided exactly. Two boundaries meet if the *insides* beside them meet. They meet in a proper
crossing, or in a touch (a shared point, pieces of one line) with surface on the same side. Charts side by side
along a common line or point touch and do not overlap, as the two sides of a cut through a plane.
"""

from functools import cached_property

import numpy as np

from circparam.core.arrays import cross_areas, first_of_groups, group_count, mask_of, ranges
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.boundary import BoundarySegments, boundary_in, turned_loops
from circparam.geometry.intersect import distinct_pairs, meeting, nearby, winding_pairs
from circparam.geometry.predicates import SignArray, orientation
from circparam.mesh.cut_mesh import CutMesh

MOST_ALIKE_PAIRS = 5_000_000  # pairs of charts, above which not all of those alike are listed
HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)  # odd: the golden ratio of 64 bits


def signs(uv: FloatArray, faces: IntArray) -> SignArray:
    """(m,) int8 exact sign of the signed area of each face: 1 counter-clockwise, 0 flat, −1 clockwise.

    uv: (k, 2) finite float64. faces: (m, 3). Exact for the numbers as they are (Shewchuk 1997).
    """
    return orientation(uv[faces[:, 0]], uv[faces[:, 1]], uv[faces[:, 2]])


@dataclass(frozen=True, eq=False)
class Overlaps:
    """The overlaps of a layout.

    self_overlapping: (n,) bool for each chart. crossings: (p, 2) half-edges of one chart's boundary that meet
    another one of the same chart's. pairs: (q, 2) charts a < b that overlap each other, found when first asked
    for. Exact, but for stacks of hundreds of charts: there every chart in a stack is found with some other,
    not with every other.
    """

    self_overlapping: BoolArray
    crossings: IntArray
    _boundary: BoundarySegments
    _cut_mesh: CutMesh
    _uv: FloatArray

    @cached_property
    def pairs(self) -> IntArray:
        """(q, 2) int64 pairs of charts that overlap each other, in ascending order."""
        n = len(self.self_overlapping)
        boundary, chart = self._boundary, self._cut_mesh.chart
        first = same_boundary(boundary)
        alone = first == np.arange(n)
        i, j, _ = meeting(boundary, between=True, among=alone)
        # a point inside each chart: the centre of its largest face
        corners = self._uv[self._cut_mesh.faces]
        face = first_of_groups(chart, -np.abs(cross_areas(corners)))
        face = face[alone[chart[face]]]
        inside, outside = winding_pairs(boundary, chart[face], corners[face].mean(1))
        a = np.r_[boundary.chart[i], inside]
        b = np.r_[boundary.chart[j], first[outside]]
        pairs = distinct_pairs(a, b, n)
        return pairs if alone.all() else _with_alike(pairs, first)

    def near(self, margin: float, which: BoolArray, chamfers: bool = False) -> IntArray:
        """(n,) number of pairs of boundary edges that are too near each other, in some charts ((n,) bool).

        margin: share of the root of the chart's area in the layout. Two parts of its boundary nearer than this
        are too near, except neighbours, parts less than 8 such distances apart along the boundary. chamfers:
        see ``nearby``.
        """
        i, _ = nearby(self._boundary, margin * self._boundary.size, which, chamfers)
        return group_count(self._boundary.chart[i], len(self.self_overlapping))


def _with_alike(pairs: IntArray, first: IntArray) -> IntArray:
    """Pairs of all charts, from those of the first of each class of charts alike; first: (n,).

    Of very many, each chart is paired with the first of its class only.
    """
    n = len(first)
    count = group_count(first, n)
    order, begin = np.argsort(first, kind="stable"), np.cumsum(count) - count
    own = np.flatnonzero(count > 1)
    a, b = np.r_[pairs[:, 0], own], np.r_[pairs[:, 1], own]
    number = count[a] * count[b]
    if number.sum() > MOST_ALIKE_PAIRS:
        later = np.flatnonzero(first != np.arange(n))
        a, b = np.r_[pairs[:, 0], first[later]], np.r_[pairs[:, 1], later]
    else:
        k, at = np.repeat(np.arange(len(a)), number), ranges(number)
        across = count[b][k]
        a, b = order[begin[a][k] + at // across], order[begin[b][k] + at % across]
    return distinct_pairs(a[a != b], b[a != b], n)


def same_boundary(boundary: BoundarySegments) -> IntArray:
    """(n,) the first chart with the same boundary, segment by segment; its own number if it has no boundary or
    no area.

    Faces that show one patch of a palette lie on one another by the thousand. Two boundaries are the same
    if sums of 64 bits of their segments are, which do not depend on the order of these.
    """
    n = len(boundary.size)
    word = (np.concatenate([boundary.start, boundary.end], 1) + 0.0).view(np.uint64)
    code = np.zeros(len(word), np.uint64)
    for k in range(4):
        code = (code ^ word[:, k]) * HASH_FACTOR
        code ^= code >> np.uint64(32)
    total = np.zeros(n, np.uint64)
    np.add.at(total, boundary.chart, code * HASH_FACTOR)
    out = np.arange(n)
    # a closed chart lies in the plane as a double layer; only rounding gives it an area
    solid = np.flatnonzero((boundary.size > 0) & mask_of(n, boundary.chart))
    _, at, label = np.unique(total[solid], return_index=True, return_inverse=True)
    out[solid] = solid[at][label.reshape(-1)]
    return out


def overlaps(cut_mesh: CutMesh, uv: FloatArray) -> Overlaps:
    """Charts that overlap themselves, or each other (``.pairs``). uv: (n_vertices, 2), finite.

    Flipped faces are not counted here (see ``signs``); a chart that is mirrored as a whole is no overlap.
    """
    boundary = boundary_in(cut_mesh, uv)
    i, j, undecided = meeting(boundary, between=False)
    found = wound_wrongly(cut_mesh, uv, boundary)
    found[boundary.chart[i]] = True
    found[undecided] = True
    crossed = np.stack([boundary.half_edge[i], boundary.half_edge[j]], 1)
    return Overlaps(found, crossed, boundary, cut_mesh, uv)


def self_overlapping(cut_mesh: CutMesh, uv: FloatArray) -> BoolArray:
    """(n_charts,) bool, charts that overlap themselves. uv: (n_vertices, 2)."""
    return overlaps(cut_mesh, uv).self_overlapping


def crossings(uv: FloatArray, cut_mesh: CutMesh, among: BoolArray | None = None) -> IntArray:
    """(p, 2) pairs of boundary half-edges of one chart that meet, in ascending order.

    uv: (n_vertices, 2). among: (n,) charts that are looked at, None for all.
    """
    boundary = boundary_in(cut_mesh, uv)
    i, j, _ = meeting(boundary, between=False, among=among)
    return distinct_pairs(boundary.half_edge[i], boundary.half_edge[j], 3 * len(cut_mesh.faces))


def wound_wrongly(cut_mesh: CutMesh, uv: FloatArray, boundary: BoundarySegments) -> BoolArray:
    """(n_charts,) charts with a loop folded out, or with an inner vertex that is wound twice.

    Their boundary need not meet itself. boundary: that of the layout (n_vertices, 2).
    """
    found = mask_of(cut_mesh.n_charts, boundary.chart[turned_loops(boundary)])
    found[cut_mesh.vertex_chart[wound_twice(cut_mesh, uv)]] = True
    return found


def wound_twice(cut_mesh: CutMesh, uv: FloatArray) -> BoolArray:
    """(n_vertices,) bool: inner vertices that their faces wind round more than once.

    Counted exactly: a corner passes the direction of the positive x axis where it begins below and ends above.
    """
    faces = cut_mesh.faces
    y = uv[:, 1][faces]
    below_next = y[:, [1, 2, 0]] < y
    below_previous = y[:, [2, 0, 1]] < y
    sign = signs(uv, faces)[:, None]
    up, down = below_next > below_previous, below_previous > below_next
    passes = (up & (sign > 0)).view(np.int8) - (down & (sign < 0)).view(np.int8)
    turns = np.bincount(faces.ravel(), passes.ravel(), len(uv))
    return (np.abs(turns) > 1) & ~cut_mesh.on_boundary
