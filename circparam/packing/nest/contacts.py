"""Contacts between outlines: the pairs of points that come near."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from circparam.core.arrays import FloatArray, IntArray, ranges
from circparam.packing.placement import Placement


@dataclass(frozen=True, eq=False)
class Outline:
    """Samples of one chart's outline, about the chart's centre in the units of the uv given.

    points: (k, 2). start, end: (k, 2) the edge each lies on. tree: of the points. hull: (h, 2) vertices of the
    convex hull, of all outline vertices where those lie on a line.
    """

    points: FloatArray
    start: FloatArray
    end: FloatArray
    tree: cKDTree
    hull: FloatArray


def sample_outline(start: FloatArray, end: FloatArray, step: float) -> Outline:
    """Samples at most ``step`` apart on every edge, edge starts among them; short edges are thinned."""
    length = np.sqrt(((end - start) ** 2).sum(1))
    count = np.maximum(np.ceil(length / step), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(start)), count)
    t = (ranges(count) / count[edge])[:, None]
    points = start[edge] * (1 - t) + end[edge] * t
    # one sample a cell of half a step is enough where edges are shorter than that
    _, first = np.unique(np.floor(points / (0.5 * step)), axis=0, return_index=True)
    first = np.sort(first)
    try:
        hull = start[ConvexHull(start).vertices]
    except (QhullError, ValueError):
        hull = start
    return Outline(
        points[first], start[edge[first]], end[edge[first]], cKDTree(points[first]), hull
    )


@dataclass(frozen=True, eq=False)
class Contacts:
    """Pairs of points that come near each other: chart i at p, chart j at q (both (k, 2), page texels)."""

    i: IntArray
    j: IntArray
    p: FloatArray
    q: FloatArray


def to_world(placement: Placement, c: int, points: FloatArray) -> FloatArray:
    """Points of chart ``c`` about its centre, (k, 2), as they lie on the page."""
    k, s = np.cos(placement.angle[c]), np.sin(placement.angle[c])
    p = points * placement.scale
    turned = np.stack([k * p[:, 0] - s * p[:, 1], s * p[:, 0] + k * p[:, 1]], 1)
    return np.asarray(turned + placement.offset[c])


def _local(placement: Placement, c: int, points: FloatArray) -> FloatArray:
    k, s = np.cos(placement.angle[c]), np.sin(placement.angle[c])
    p = (points - placement.offset[c]) / placement.scale
    return np.stack([k * p[:, 0] + s * p[:, 1], -s * p[:, 0] + k * p[:, 1]], 1)


def _nearest(outline: Outline, points: FloatArray, reach: float) -> tuple[IntArray, FloatArray]:
    """Which points (local) come within reach of an outline, and the nearest point on its edge."""
    distance, index = outline.tree.query(points, distance_upper_bound=reach)
    hit = np.flatnonzero(np.isfinite(distance))
    near = np.asarray(index)[hit]
    a, b = outline.start[near], outline.end[near]
    d = b - a
    t = ((points[hit] - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-300)
    return hit, a + np.clip(t, 0.0, 1.0)[:, None] * d


def find_contacts(placement: Placement, outlines: list[Outline], reach: float) -> Contacts:
    """All pairs of near points of all pairs of charts of one page; reach in texels.

    Every sample of a chart is paired with the nearest point on the edge of the other chart's nearest sample,
    both ways round, so a pair of charts stands in the result as (i, j) and as (j, i).
    """
    n = len(outlines)
    world = [to_world(placement, c, o.points) for c, o in enumerate(outlines)]
    low = np.array([w.min(0) for w in world]) - reach
    high = np.array([w.max(0) for w in world]) + reach
    near = (low[:, None] < high[None] - reach).all(2) & (high[:, None] - reach > low[None]).all(2)
    near &= placement.page[:, None] == placement.page[None]
    parts: list[tuple[IntArray, IntArray, FloatArray, FloatArray]] = []
    for i, j in np.argwhere(near & ~np.eye(n, dtype=bool)):
        p = world[i]
        inside = ((p >= low[j]) & (p <= high[j])).all(1)
        p = p[inside]
        if len(p) == 0:
            continue
        hit, q = _nearest(outlines[j], _local(placement, j, p), reach / placement.scale)
        if len(hit):
            k = len(hit)
            parts.append((np.full(k, i), np.full(k, j), p[hit], to_world(placement, j, q)))
    if not parts:
        none = np.zeros(0, np.int64)
        return Contacts(none, none, np.zeros((0, 2)), np.zeros((0, 2)))
    i_, j_, p_, q_ = (np.concatenate(x) for x in zip(*parts, strict=True))
    return Contacts(i_, j_, p_, q_)


def least_distance(found: Contacts) -> float:
    """Smallest distance among contacts; infinity where there are none."""
    if len(found.i) == 0:
        return float("inf")
    return float(np.sqrt(((found.p - found.q) ** 2).sum(1).min()))
