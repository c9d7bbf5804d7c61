"""How faces hang together: half-edges paired across edges, and sides chosen so that neighbours agree.

What ``repair`` and ``describe`` share. Half-edge 3f + k runs from corner k to corner k + 1 of face f.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sps
import scipy.sparse.csgraph as csgraph

from circparam.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    next_half_edge,
    ranges,
)

FAN_LIMIT = 16  # up to so many faces at one edge all pairs are compared; above, opposite ones pair
TURN_COST = 1.5  # how much straightness a pair must gain to join faces wound against each other
AVOID_COST = 4.0  # of a pair that was tried and made two vertices the ends of two edges
REPAIRINGS = 3  # other pairs tried at edges that coincide, before such pairs are let go


class Pairs(NamedTuple):
    """Half-edges that belong together: (e, 2), whether each pair lies inside a polygon, whether its faces are
    wound against each other; and the first half-edge of every edge with more than two faces."""

    edges: IntArray
    locked: BoolArray
    against: BoolArray
    crowded: IntArray


def pair_half_edges(points: FloatArray, faces: IntArray, polygons: IntArray | None) -> Pairs:
    """Pair the half-edges of faces: an edge of two faces is one pair, a crowded edge several.

    At an edge of more than two faces those inside one polygon pair first, then the straightest pairs,
    wound alike rather than against each other; an odd face keeps a border there. Two faces with the same three
    points never pair: joined along two edges they could not lie in the plane.
    """
    start = faces.ravel()
    end = faces[:, [1, 2, 0]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    key = low * len(points) + high
    order = np.argsort(key, kind="stable")
    head = first_of_runs(key[order])
    count = np.diff(np.r_[head, len(order)])
    two = head[count == 2]
    edges = np.stack([order[two], order[two + 1]], 1)
    third = faces.ravel()[next_half_edge(next_half_edge(edges))]
    edges = edges[third[:, 0] != third[:, 1]]
    many = count > 2
    if many.any():
        fans = _Fans.at(points, faces, polygons, order, head[many], count[many])
        edges = np.concatenate([edges, _apart(faces, edges, fans)])
    i, j = edges[:, 0], edges[:, 1]
    locked = np.zeros(len(edges), bool)
    if polygons is not None:
        locked = polygons[i // 3] == polygons[j // 3]
    return Pairs(edges, locked, start[i] == start[j], order[head[many]])


class _Fans(NamedTuple):
    """The half-edges at crowded edges, edge after edge, and the pairs of them that may be made.

    h: half-edges. group: edge of each of them. x, y: (pairs,) indices into h that may be paired, straight:
    (pairs,) −1 (one plane) .. 1 (folded together), against: whether their faces are wound against each
    other, together: whether they lie in one polygon. large: (l, 2) pairs at edges with very many faces, which
    are made by angle alone.
    """

    h: IntArray
    group: IntArray
    x: IntArray
    y: IntArray
    straight: FloatArray
    against: BoolArray
    together: BoolArray
    large: IntArray

    @staticmethod
    def at(
        points: FloatArray,
        faces: IntArray,
        polygons: IntArray | None,
        order: IntArray,
        head: IntArray,
        size: IntArray,
    ) -> _Fans:
        """``order[head[g] : head[g] + size[g]]`` are the half-edges of crowded edge g."""
        h = order[np.repeat(head, size) + ranges(size)]
        group = np.repeat(np.arange(len(head)), size)
        start = faces.ravel()[h]
        end = faces.ravel()[next_half_edge(h)]
        low, high = np.minimum(start, end), np.maximum(start, end)
        axis = points[high] - points[low]
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        third = faces.ravel()[next_half_edge(next_half_edge(h))]
        inward = points[third] - points[low]
        inward -= (inward * axis).sum(1)[:, None] * axis
        inward /= np.maximum(np.linalg.norm(inward, axis=1), 1e-300)[:, None]

        first = np.repeat(np.cumsum(size) - size, size)
        n = np.repeat(size, size)
        rank = np.arange(len(h)) - first
        small = n <= FAN_LIMIT
        later = np.where(small, n - 1 - rank, 0)
        x = np.repeat(np.arange(len(h)), later)
        y = x + 1 + ranges(later)
        differ = third[x] != third[y]
        x, y = x[differ], y[differ]
        together = np.zeros(len(x), bool)
        if polygons is not None:
            together = polygons[h[x] // 3] == polygons[h[y] // 3]
        large = np.zeros((0, 2), np.int64)
        if not small.all():
            side = np.cross(axis, inward[first])
            angle = np.arctan2((inward * side).sum(1), (inward * inward[first]).sum(1))
            by_angle = np.lexsort((rank, angle, group))
            half = n // 2
            lower = np.flatnonzero(~small & (rank < half))
            large = np.stack([by_angle[lower], by_angle[lower + half[lower]]], 1)
        straight = (inward[x] * inward[y]).sum(1)
        return _Fans(h, group, x, y, straight, start[x] == start[y], together, large)

    def pairs(self, extra: FloatArray) -> IntArray:
        """(p, 2) indices into h: pairs inside a polygon first, then the cheapest ones, ``extra`` added."""
        # coplanar rivals differ by rounding only: round, so that their order is that of the file
        cost = np.round(self.straight - 10.0 * self.together + extra, 9)
        return np.concatenate([_greedy(cost, self.x, self.y, len(self.h)), self.large])


def _apart(faces: IntArray, others: IntArray, fans: _Fans) -> IntArray:
    """Pairs of half-edges (p, 2) at the crowded edges, such that no two edges have the same two ends.

    Where two pairs at an edge have the same vertices at both ends, what hangs between them has no room in any
    map with straight edges. There, pairs are chosen by straightness alone, then otherwise; in the end such
    pairs are let go. others: the pairs at all other edges.
    """
    extra = np.where(fans.against, TURN_COST, 0.0)
    chosen = fans.pairs(extra)
    tried = np.zeros(len(fans.x), bool)
    for _ in range(REPAIRINGS):
        double = _doubled(faces, others, fans, chosen)
        if not double.any():
            break
        again = np.zeros(int(fans.group.max()) + 1, bool)
        again[fans.group[chosen[double, 0]]] = True
        tried |= np.isin(fans.x * len(fans.h) + fans.y, _keys(fans, chosen[double]))
        extra = np.where(again[fans.group[fans.x]], AVOID_COST * tried, extra)
        chosen = fans.pairs(extra)
    else:
        inside = np.isin(_keys(fans, chosen), (fans.x * len(fans.h) + fans.y)[fans.together])
        chosen = chosen[inside | ~_doubled(faces, others, fans, chosen)]
    return np.sort(fans.h[chosen], 1)


def _keys(fans: _Fans, pairs: IntArray) -> IntArray:
    """One number for each pair (p, 2) of indices into ``fans.h``."""
    result: IntArray = pairs.min(1) * len(fans.h) + pairs.max(1)
    return result


def _doubled(faces: IntArray, others: IntArray, fans: _Fans, chosen: IntArray) -> BoolArray:
    """(p,) pairs chosen at crowded edges that have the same two vertices as another one there."""
    pairs = np.concatenate([others, fans.h[chosen]])
    vertex = _vertices(faces, pairs)
    i = fans.h[chosen[:, 0]]
    a, b = vertex[i], vertex[next_half_edge(i)]
    key = np.minimum(a, b) * faces.size + np.maximum(a, b)
    _, which, count = np.unique(key, return_inverse=True, return_counts=True)
    result: BoolArray = count[which.reshape(-1)] > 1
    return result


def _vertices(faces: IntArray, pairs: IntArray) -> IntArray:
    """(3m,) vertex of each corner: corners at one point, joined across pairs however their faces are wound."""
    start = faces.ravel()
    i, j = pairs[:, 0], pairs[:, 1]
    ni, nj = next_half_edge(i), next_half_edge(j)
    alike = start[i] == start[nj]
    _, label = _components(
        faces.size, np.r_[i, ni], np.r_[np.where(alike, nj, j), np.where(alike, j, nj)]
    )
    return label


def _greedy(cost: FloatArray, x: IntArray, y: IntArray, n: int) -> IntArray:
    """Disjoint pairs among candidates, cheapest first: rounds that take all locally best ones at once."""
    rank = np.empty(len(cost), np.int64)
    rank[np.lexsort((y, x, cost))] = np.arange(len(cost))
    taken: list[IntArray] = []
    while len(rank):
        best = np.full(n, len(cost))
        np.minimum.at(best, x, rank)
        np.minimum.at(best, y, rank)
        win = (best[x] == rank) & (best[y] == rank)
        taken.append(np.stack([x[win], y[win]], 1))
        done = np.zeros(n, bool)
        done[x[win]] = True
        done[y[win]] = True
        left = ~done[x] & ~done[y]
        x, y, rank = x[left], y[left], rank[left]
    return np.concatenate(taken) if taken else np.zeros((0, 2), np.int64)


class Sides(NamedTuple):
    """Sides of faces: turned (m,) where the winding is reversed, keep (e,) pairs whose faces now agree,
    component (m,) label, and the number of components with one side only (cut where keep is False)."""

    turned: BoolArray
    keep: BoolArray
    component: IntArray
    one_sided: int


def orient(n_faces: int, areas: FloatArray, pairs: Pairs) -> Sides:
    """Wind faces alike across the pairs; each component keeps the winding of the larger part of its area.

    Components come from the double cover (every face twice, once for each side): where both copies of a face
    hang together the component has one side only. It is then wound along a breadth-first tree over whole
    polygons, and the pairs that still disagree are let go.
    """
    i, j = pairs.edges[:, 0] // 3, pairs.edges[:, 1] // 3
    keep = np.ones(len(i), bool)
    if not pairs.against.any():
        _, component = _components(n_faces, i, j)
        return Sides(np.zeros(n_faces, bool), keep, component, 0)
    component, turned, two_sided = double_cover(n_faces, i, j, pairs.against)
    one_sided = int(component.max()) + 1 - int(np.count_nonzero(two_sided))
    if one_sided:
        faces = ~two_sided[component]
        local = np.cumsum(faces) - 1
        e = faces[i]
        turned[faces] = _along_tree(
            int(faces.sum()), local[i[e]], local[j[e]], pairs.against[e], pairs.locked[e]
        )
        keep = pairs.against == (turned[i] ^ turned[j])
    balance = np.bincount(component, np.where(turned, -areas, areas))
    return Sides(turned ^ (balance < 0)[component], keep, component, one_sided)


def double_cover(
    n: int, i: IntArray, j: IntArray, flip: BoolArray
) -> tuple[IntArray, BoolArray, BoolArray]:
    """Signs of nodes such that signs differ across the pairs (i, j) exactly where ``flip`` is set.

    Returns ((n,) component, (n,) bool sign, (components,) bool whether such signs exist). The first node of
    every component has sign False.
    """
    _, cover = _components(
        2 * n, np.r_[i, i + n], np.r_[np.where(flip, j + n, j), np.where(flip, j, j + n)]
    )
    here, there = cover[:n], cover[n:]
    label, component = np.unique(np.minimum(here, there), return_inverse=True)
    component = component.reshape(-1).astype(np.int64)
    two_sided = np.ones(len(label), bool)
    two_sided[component[here == there]] = False
    sign = here > there
    first = np.full(len(label), n)
    np.minimum.at(first, component, np.arange(n))
    return component, sign ^ sign[first][component], two_sided


def _components(n: int, i: IntArray, j: IntArray) -> tuple[int, IntArray]:
    graph = sps.coo_matrix((np.ones(len(i), bool), (i, j)), shape=(n, n))
    count, labels = csgraph.connected_components(graph, directed=False)
    return int(count), labels.astype(np.int64)


def _along_tree(n: int, i: IntArray, j: IntArray, flip: BoolArray, locked: BoolArray) -> BoolArray:
    """Signs along a breadth-first tree whose nodes are whole polygons (faces joined by locked pairs)."""
    node, inside, flat = double_cover(n, i[locked], j[locked], flip[locked])
    if (
        not flat.all()
    ):  # a polygon that is itself one-sided: its inner edges are edges like all others
        locked = locked & flat[node[i]]
        node, inside, _ = double_cover(n, i[locked], j[locked], flip[locked])
    count = int(node.max()) + 1
    a, b = node[i], node[j]
    step = flip ^ inside[i] ^ inside[j]
    across = a != b
    a, b, step = a[across], b[across], step[across]
    _, component = _components(count, a, b)
    roots = np.full(int(component.max()) + 1, count)
    np.minimum.at(roots, component, np.arange(count))
    graph = sps.coo_matrix(
        (
            np.ones(len(a) + len(roots), bool),
            (np.r_[a, np.full(len(roots), count)], np.r_[b, roots]),
        ),
        shape=(count + 1, count + 1),
    )
    _, parent = csgraph.breadth_first_order(graph.tocsr(), count, directed=False)
    child = np.flatnonzero((parent[:count] >= 0) & (parent[:count] < count))
    key = np.minimum(a, b) * count + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    up = parent[child].astype(np.int64)
    wanted = np.minimum(child, up) * count + np.maximum(child, up)
    edge = order[np.searchsorted(key[order], wanted)]
    _, sign, _ = double_cover(count, a[edge], b[edge], step[edge])
    result: BoolArray = sign[node] ^ inside
    return result
