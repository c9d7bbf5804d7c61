"""How faces hang together: half-edges paired across edges, and the vertices that the pairs make."""

from typing import NamedTuple

import numpy as np

from circparam.core.arrays import (
    edge_keys,
    first_of_runs,
    mask_of,
    next_half_edge,
    numbered,
    ranges,
    scattered,
    stable_order,
    unit,
)
from circparam.core.graph import components, matching
from circparam.core.types import BoolArray, FloatArray, IntArray

# up to so many faces at one edge all pairs are compared; above, opposite ones pair
COMPARED_FACES = 16
TURN_COST = 1.5  # how much straightness a pair must gain to join inconsistently oriented faces
AVOID_COST = 4.0  # of a pair that was tried and made two vertices the ends of two edges
REPAIR_ROUNDS = 3  # other pairs tried at edges that coincide, before such pairs are let go


class Pairs(NamedTuple):
    """Pairs of half-edges: (e, 2), whether each pair lies inside a polygon, whether its faces are
    inconsistently oriented. Also the first half-edge of every edge with more than two faces."""

    edges: IntArray
    locked: BoolArray
    against: BoolArray
    crowded: IntArray


class EdgeRuns(NamedTuple):
    """Half-edges sorted by their edge. order (h,): half-edges, ascending on each edge; head (edges,): first
    place of an edge in ``order``, edges in ascending order of their two points; size (edges,)."""

    order: IntArray
    head: IntArray
    size: IntArray

    @property
    def pairs(self) -> IntArray:
        """(p, 2) the two half-edges, i < j, of every edge that has exactly two."""
        two = self.head[self.size == 2]
        return np.stack([self.order[two], self.order[two + 1]], 1)

    @property
    def single(self) -> IntArray:
        """Half-edges of edges of one face."""
        return self.order[self.head[self.size == 1]]

    @property
    def chains(self) -> IntArray:
        """(c, 2) neighbours in the list of half-edges of each edge, whatever their number."""
        later = np.flatnonzero(~mask_of(len(self.order), self.head))
        return np.stack([self.order[later - 1], self.order[later]], 1)

    @property
    def crowded(self) -> IntArray:
        """The first half-edge of every edge of more than two faces."""
        return self.order[self.head[self.size > 2]]


def sort_by_edge(faces: IntArray, n_points: int, which: BoolArray | None = None) -> EdgeRuns:
    """The half-edges of faces (m, 3) by the two points they join, either way; which: (m,) faces to take."""
    key = edge_keys(faces.ravel(), faces[:, [1, 2, 0]].ravel(), n_points)
    h = np.arange(faces.size) if which is None else np.flatnonzero(np.repeat(which, 3))
    order = h[stable_order(key[h])]
    head = first_of_runs(key[order])
    return EdgeRuns(order, head, np.diff(np.r_[head, len(order)]))


def run_opposite(faces: IntArray, pairs: IntArray) -> BoolArray:
    """(p,) bool: the two half-edges of a pair (p, 2) on one edge run against each other."""
    start, end = faces.ravel()[pairs], faces.ravel()[next_half_edge(pairs)]
    return (start[:, 0] == end[:, 1]) & (start[:, 0] != end[:, 0])


def sides_apart(corners: FloatArray, pairs: IntArray, same_way: bool = False) -> BoolArray:
    """(p,) bool: the two half-edges of a pair (p, 2) differ in the values (m, 3, d) of corners at some end.

    same_way: both run the same way along their edge, not against each other.
    """
    flat = corners.reshape(-1, corners.shape[-1])
    i, j = pairs[:, 0], pairs[:, 1]
    start, end = (j, next_half_edge(j)) if same_way else (next_half_edge(j), j)
    return np.asarray(((flat[i] != flat[start]) | (flat[next_half_edge(i)] != flat[end])).any(1))


def shared_edges(faces: IntArray) -> IntArray:
    """(e, 2) pairs of half-edges that run against each other between the same two vertices, and no third.

    faces: (m, 3). Pairs (i, j), i < j, in ascending order of i.
    """
    pairs = sort_by_edge(faces, int(faces.max(initial=-1)) + 1).pairs
    pairs = pairs[run_opposite(faces, pairs)]
    return pairs[stable_order(pairs[:, 0])]


def pair_half_edges(
    points: FloatArray, faces: IntArray, polygons: IntArray | None, uv: FloatArray | None
) -> Pairs:
    """Pair the half-edges of faces: an edge of two faces is one pair, a crowded edge several.

    At an edge of more than two faces, half-edges inside one polygon pair first. Next come faces side by side in
    a layout, then the straightest pairs, consistently oriented before others. An odd face keeps a boundary
    there. Two faces with the same three points never pair: joined along two edges they could not lie in the
    plane. uv: (m, 3, 2) of a layout to be judged, NaN at corners without.
    """
    start = faces.ravel()
    runs = sort_by_edge(faces, len(points))
    edges = runs.pairs
    third = faces.ravel()[next_half_edge(next_half_edge(edges))]
    edges = edges[third[:, 0] != third[:, 1]]
    many = runs.size > 2
    if many.any():
        fans = _Fans.at(points, faces, polygons, uv, runs, many)
        edges = np.concatenate([edges, _apart(faces, edges, fans)])
    i, j = edges[:, 0], edges[:, 1]
    return Pairs(edges, _in_one_polygon(polygons, i, j), start[i] == start[j], runs.crowded)


def _in_one_polygon(polygons: IntArray | None, i: IntArray, j: IntArray) -> BoolArray:
    return np.zeros(len(i), bool) if polygons is None else polygons[i // 3] == polygons[j // 3]


class _Fans(NamedTuple):
    """The half-edges at crowded edges, edge after edge, and the pairs of them that may be made.

    h: half-edges. group: edge of each of them. x, y: (pairs,) indices into h that may be paired, cost: (pairs,)
    of that, against: whether their faces are inconsistently oriented, together: whether one polygon holds both.
    large: (l, 2) pairs at edges with very many faces, which are made by angle alone.
    """

    h: IntArray
    group: IntArray
    x: IntArray
    y: IntArray
    cost: FloatArray
    against: BoolArray
    together: BoolArray
    large: IntArray

    @staticmethod
    def at(
        points: FloatArray,
        faces: IntArray,
        polygons: IntArray | None,
        uv: FloatArray | None,
        runs: EdgeRuns,
        many: BoolArray,
    ) -> "_Fans":
        """The half-edges of the crowded edges among the runs (many: (edges,) bool)."""
        size = runs.size[many]
        h = runs.order[np.repeat(runs.head[many], size) + ranges(size)]
        group = np.repeat(np.arange(len(size)), size)
        start = faces.ravel()[h]
        end = faces.ravel()[next_half_edge(h)]
        low, high = np.minimum(start, end), np.maximum(start, end)
        axis = points[high] - points[low]
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        third = faces.ravel()[next_half_edge(next_half_edge(h))]
        inward = points[third] - points[low]
        inward -= (inward * axis).sum(1)[:, None] * axis
        inward = unit(inward)

        first = np.repeat(np.cumsum(size) - size, size)
        n = np.repeat(size, size)
        rank = np.arange(len(h)) - first
        small = n <= COMPARED_FACES
        later = np.where(small, n - 1 - rank, 0)
        x = np.repeat(np.arange(len(h)), later)
        y = x + 1 + ranges(later)
        differ = third[x] != third[y]
        x, y = x[differ], y[differ]
        together = _in_one_polygon(polygons, h[x], h[y])
        drawn = np.zeros(len(x), bool) if uv is None else _same_uv(faces, uv, h[x], h[y])
        side = np.cross(axis, inward[first])
        angle = np.arctan2((inward * side).sum(1), (inward * inward[first]).sum(1))
        by_angle = np.lexsort((rank, angle, group))
        half = n // 2
        lower = np.flatnonzero(~small & (rank < half))
        large = np.stack([by_angle[lower], by_angle[lower + half[lower]]], 1)
        # −1: one plane, 1: folded together; inside a polygon first, then side by side in the layout
        cost = (inward[x] * inward[y]).sum(1) - 20.0 * together - 10.0 * drawn
        return _Fans(h, group, x, y, cost, start[x] == start[y], together, large)

    def pairs(self, extra: FloatArray) -> IntArray:
        """(p, 2) indices into h, the cheapest pairs first."""
        # coplanar rivals differ by rounding only: round, so that their order is that of the file
        best = matching(-np.round(self.cost + extra, 9), self.x, self.y, len(self.h))
        return np.concatenate([np.stack([self.x[best], self.y[best]], 1), self.large])


def _same_uv(faces: IntArray, uv: FloatArray, i: IntArray, j: IntArray) -> BoolArray:
    """(p,) bool: two half-edges i, j (p,) of one edge have the same uv (m, 3, 2) at both of its ends."""
    pairs, alike = np.stack([i, j], 1), faces.ravel()[i] == faces.ravel()[j]
    return ~np.where(alike, sides_apart(uv, pairs, True), sides_apart(uv, pairs))


def _apart(faces: IntArray, others: IntArray, fans: _Fans) -> IntArray:
    """Pairs of half-edges (p, 2) at the crowded edges, such that no two edges have the same two ends.

    Two pairs at an edge may have the same vertices at both ends. The part between them then has no room in any
    map with straight edges. There, pairs are chosen by straightness alone, then otherwise; in the end such
    pairs are let go. others: the pairs at all other edges.
    """
    extra = np.where(fans.against, TURN_COST, 0.0)
    chosen = fans.pairs(extra)
    tried = np.zeros(len(fans.x), bool)
    for _ in range(REPAIR_ROUNDS):
        double = _doubled(faces, others, fans, chosen)
        if not double.any():
            break
        again = mask_of(int(fans.group.max()) + 1, fans.group[chosen[double, 0]])
        tried |= np.isin(fans.x * len(fans.h) + fans.y, _keys(fans, chosen[double]))
        extra = np.where(again[fans.group[fans.x]], AVOID_COST * tried, extra)
        chosen = fans.pairs(extra)
    else:
        inside = np.isin(_keys(fans, chosen), (fans.x * len(fans.h) + fans.y)[fans.together])
        chosen = chosen[inside | ~_doubled(faces, others, fans, chosen)]
    return np.sort(fans.h[chosen], 1)


def _keys(fans: _Fans, pairs: IntArray) -> IntArray:
    """One number for each pair (p, 2) of indices into ``fans.h``."""
    return pairs.min(1) * len(fans.h) + pairs.max(1)


def _doubled(faces: IntArray, others: IntArray, fans: _Fans, chosen: IntArray) -> BoolArray:
    """(p,) pairs chosen at crowded edges that have the same two vertices as another one there."""
    pairs = np.concatenate([others, fans.h[chosen]])
    vertex = point_corners(faces, pairs)
    i = fans.h[chosen[:, 0]]
    a, b = vertex[i], vertex[next_half_edge(i)]
    key = edge_keys(a, b, faces.size)
    which = numbered(key)[1]
    return np.bincount(which)[which] > 1


def point_corners(faces: IntArray, pairs: IntArray) -> IntArray:
    """(3m,) class of each corner: corners at one point, joined across pairs (p, 2) of half-edges of one edge.

    However their faces are wound: unlike ``corner_classes``, which joins end to start without asking.
    """
    start = faces.ravel()
    i, j = pairs[:, 0], pairs[:, 1]
    ni, nj = next_half_edge(i), next_half_edge(j)
    alike = start[i] == start[nj]
    _, label = components(
        faces.size, np.r_[i, ni], np.r_[np.where(alike, nj, j), np.where(alike, j, nj)]
    )
    return label


def boundary_half_edges(n_faces: int, edges: IntArray) -> IntArray:
    """(b,) half-edges in none of the pairs ``edges`` (e, 2), ascending."""
    inner = mask_of(3 * n_faces, edges.ravel())
    return np.flatnonzero(~inner)


def opposite_half_edges(n_faces: int, edges: IntArray) -> IntArray:
    """(3 n_faces,) the other half-edge of the pair in ``edges`` (e, 2) each half-edge is in, −1 for none."""
    return scattered(3 * n_faces, edges.ravel(), edges[:, ::-1].ravel())


def faces_across(n_faces: int, edges: IntArray) -> IntArray:
    """(m, 3) the face across each side, the face itself on the boundary."""
    h, twin = np.arange(3 * n_faces), opposite_half_edges(n_faces, edges)
    return np.where(twin < 0, h, twin).reshape(-1, 3) // 3


def corner_classes(n_faces: int, edges: IntArray) -> tuple[int, IntArray]:
    """Vertices of a cut mesh: corners joined across the given inner edges, and no others.

    n_faces: number of faces. edges: (e, 2) half-edges that are glued, running against each other.
    Returns (number of classes, (n_faces, 3) class of each corner). A vertex at which the surface is pinched
    becomes one vertex for each fan, so the result is always a manifold.
    """
    # the corner that each half-edge leaves is joined to one other at most: that which follows its other side
    i, j = np.ascontiguousarray(edges.T)
    follower = np.full(3 * n_faces, -1)
    follower[i], follower[j] = next_half_edge(j), next_half_edge(i)
    joined = np.flatnonzero(follower >= 0)
    count, labels = components(3 * n_faces, joined, follower[joined])
    return count, labels.reshape(-1, 3)
