"""Two charts moved onto each other as they are: whether their boundaries cross."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import (
    FloatArray,
    IntArray,
    cross2,
    edge_keys,
    group_count,
    group_sum,
    next_half_edge,
    sorted_distinct,
)
from circparam.geometry.intersect import properly_cross
from circparam.geometry.segment_grid import Candidates
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.glues import Glues, members
from circparam.seams.segmentation.state import Arcs


def crossings_as_they_are(
    atlas: Atlas, arcs: Arcs, glues: Glues, chosen: IntArray, chart: IntArray
) -> IntArray:
    """(k,) pairs of boundary segments, one of each chart, that cross where the right chart of each candidate is
    turned and moved, and nothing else, so that the edges that are glued fit best.

    chosen: (k,) candidates of two charts. chart: (m,) of each face. Edges that are glued do not count.
    """
    surface, flat = atlas.surface, atlas.corners.reshape(-1, 2)
    k = len(chosen)
    edge, place = glues.edges(arcs, chosen)
    p, q = surface.edges[edge].T
    swap = chart[p // 3] != glues.left[chosen][place]
    p, q = np.where(swap, q, p), np.where(swap, p, q)
    turn, mine, theirs = _fit(flat, p, q, place, k)
    side = np.stack([glues.left[chosen], glues.right[chosen]], 1).ravel()
    rim = np.concatenate([surface.edges[atlas.cut].ravel(), surface.boundary])
    of, entry = members(chart[rim // 3], side)
    h, union, right = rim[entry], of // 2, of % 2 == 1
    width = 3 * len(chart)
    glued = np.isin(union * width + h, np.concatenate([place * width + p, place * width + q]))
    h, union, right = h[~glued], union[~glued], right[~glued]
    start, end = flat[h], flat[next_half_edge(h)]
    for x in (start, end):
        x[right] = _moved(x[right], turn, mine, theirs, union[right])
    met = [np.zeros(0, np.int64)]
    for i, j in Candidates(start, end, union, np.zeros(len(h))):
        ok = right[i] != right[j]
        i, j = i[ok], j[ok]
        ok = properly_cross(start[i], end[i], start[j], end[j])
        met.append(edge_keys(i[ok], j[ok], len(h)))
    # two segments may meet in several cells of the grid
    pairs = sorted_distinct(np.concatenate(met))
    return group_count(union[pairs % len(h)], k)


def _fit(
    flat: FloatArray, p: IntArray, q: IntArray, place: IntArray, k: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """((k, 2) cosine and sine that turn half-edges q onto p, means of both (k, 2)), of each candidate."""
    ep, eq = flat[next_half_edge(p)] - flat[p], flat[q] - flat[next_half_edge(q)]
    turn = np.stack([group_sum((ep * eq).sum(1), place, k), group_sum(cross2(eq, ep), place, k)], 1)
    turn /= np.maximum(np.hypot(turn[:, 0], turn[:, 1]), 1e-300)[:, None]
    count = np.maximum(group_count(place, k), 1)[:, None]
    middle = [
        np.stack([group_sum(m[:, d], place, k) for d in range(2)], 1) / count
        for m in ((flat[h] + flat[next_half_edge(h)]) / 2 for h in (p, q))
    ]
    return turn, middle[0], middle[1]


def _moved(
    x: FloatArray, turn: FloatArray, mine: FloatArray, theirs: FloatArray, union: IntArray
) -> FloatArray:
    """Places (b, 2) of the right charts of some candidates, where they come to lie beside the left ones."""
    d, (c, s) = x - theirs[union], turn[union].T
    return np.stack([c * d[:, 0] - s * d[:, 1], s * d[:, 0] + c * d[:, 1]], 1) + mine[union]
