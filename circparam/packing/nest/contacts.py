"""Contacts between outlines: the pairs of points that come near, of all charts at once."""

import numpy as np

from circparam.core.arrays import dot2, first_of_runs, norms2, ranges, stable_order
from circparam.core.compiled import kd_tree
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.geometry.intersect import properly_cross
from circparam.packing.outlines import Shapes
from circparam.packing.placement import Placement

# Share of a step: one sample in such a square is enough for edges shorter than a step. Narrow tips keep
# samples, straight edges need few.
THINNED_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Outlines:
    """Samples of the outlines of all charts, each about its chart's centre in the units of the uv given.

    points: (k, 2). start, end: (k, 2) the edge each lies on. chart: (k,) ascending. step: between samples of an
    edge, at most.
    """

    points: FloatArray
    start: FloatArray
    end: FloatArray
    chart: IntArray
    step: float


def sample_outlines(shapes: Shapes, step: float) -> Outlines:
    """Samples at most ``step`` apart on every edge, edge starts among them; short edges are thinned."""
    start, end = shapes.points[shapes.start], shapes.points[shapes.end]
    length = norms2(end - start)
    count = np.maximum(np.ceil(length / step), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(start)), count)
    t = (ranges(count) / count[edge])[:, None]
    points = start[edge] * (1 - t) + end[edge] * t
    chart = shapes.owner[shapes.start][edge]
    x, y = (np.floor(axis / (THINNED_SHARE * step)).astype(np.int64) for axis in points.T)
    x, y = x - x.min(initial=0), y - y.min(initial=0)
    key = (chart * (int(y.max(initial=0)) + 1) + y) * (int(x.max(initial=0)) + 1) + x
    order = stable_order(key)
    first = np.sort(order[first_of_runs(key[order])])
    return Outlines(points[first], start[edge[first]], end[edge[first]], chart[first], step)


@dataclass(frozen=True, eq=False)
class Contacts:
    """Pairs of points that come near each other: chart i at p, chart j at q (both (k, 2), page texels).

    crossing: whether outlines of two charts cross somewhere.
    """

    i: IntArray
    j: IntArray
    p: FloatArray
    q: FloatArray
    crossing: bool = False


def to_world(placement: Placement, chart: IntArray, points: FloatArray) -> FloatArray:
    """Points (k, 2) about the centres of their charts (k,), as they lie on their page."""
    c, s = np.cos(placement.angle)[chart], np.sin(placement.angle)[chart]
    x, y = (points * placement.scale).T
    return np.stack([c * x - s * y, s * x + c * y], 1) + placement.offset[chart]


def find_contacts(
    placement: Placement, outlines: Outlines, reach: float, side: float = 0.0
) -> Contacts:
    """Near points of all pairs of charts of one page, the nearest of each square; all lengths in texels.

    Samples of two charts within ``reach`` are paired. Of all pairs of two charts with middles in one square of
    ``side``, the nearest counts alone. 0 keeps all. One of the two points is a sample, the other the nearest
    one on the edge of the other sample; i < j.
    """
    places = (outlines.points, outlines.start, outlines.end)
    world, start, end = (to_world(placement, outlines.chart, x) for x in places)
    # each page so far to the right that no two are in reach of each other
    page = placement.page[outlines.chart] * (float(np.ptp(world[:, 0])) + 2 * reach)
    tiled = np.stack([world[:, 0] + page, world[:, 1]], 1)
    some = _near_others(tiled, outlines.chart, reach)
    tree = kd_tree(tiled[some], balanced_tree=False, compact_nodes=False)
    pairs = tree.query_pairs(reach, output_type="ndarray")
    # a < b in every pair, and samples are sorted by chart: i < j
    a, b = some[pairs[:, 0]], some[pairs[:, 1]]
    apart = np.flatnonzero(outlines.chart[a] != outlines.chart[b])
    a, b = a[apart], b[apart]
    distance = _squared(world[a], world[b])
    # where two edges cross, samples of both are near
    near = np.flatnonzero(distance <= (outlines.step * placement.scale) ** 2)
    crossed = properly_cross(*(x[sample[near]] for sample in (a, b) for x in (start, end)))
    kept = _nearest_of_squares(outlines.chart, world, a, b, distance, side)
    a, b = a[kept], b[kept]
    at_i, at_j = world[a], world[b]
    on_i, on_j = _on_edge(start[a], end[a], at_j), _on_edge(start[b], end[b], at_i)
    closer = (_squared(at_i, on_j) <= _squared(on_i, at_j))[:, None]
    p, q = np.where(closer, at_i, on_i), np.where(closer, on_j, at_j)
    return Contacts(outlines.chart[a], outlines.chart[b], p, q, bool(crossed.any()))


def _squared(p: FloatArray, q: FloatArray) -> FloatArray:
    """(k,) squared distances of points (k, 2)."""
    d = p - q
    return dot2(d, d)


def _on_edge(start: FloatArray, end: FloatArray, point: FloatArray) -> FloatArray:
    """The nearest points to points (k, 2) on edges from start (k, 2) to end."""
    d = end - start
    t = dot2(point - start, d) / np.maximum(dot2(d, d), 1e-300)
    return np.asarray(start + np.clip(t, 0.0, 1.0)[:, None] * d)


def _near_others(points: FloatArray, chart: IntArray, reach: float) -> IntArray:
    """Which points (k, 2) may have one of another chart in reach: charts (k,) ascending.

    Points fall into squares of at least the reach; those stay in whose square or the eight round it there is
    another chart. Most points of large charts need no look-up in the tree.
    """
    axes = points[:, 0], points[:, 1]
    area = float(np.ptp(axes[0])) * float(np.ptp(axes[1]))
    side = max(reach, np.sqrt(area / len(points)))  # no more squares than points
    x, y = (np.floor((axis - axis.min()) / side).astype(np.int64) for axis in axes)
    first = np.full((int(y.max()) + 1, int(x.max()) + 1), int(chart[-1]) + 1)
    last = np.full(first.shape, -1)
    at = y * first.shape[1] + x
    last.ravel()[at] = chart  # the last of several that are set in one place stays
    backwards = np.arange(len(at) - 1, -1, -1)
    first.ravel()[at[backwards]] = chart[backwards]
    several = _round_it(first, np.minimum) != _round_it(last, np.maximum)
    return np.flatnonzero(several[y, x])


def _round_it(squares: IntArray, extreme: np.ufunc) -> IntArray:
    """The least (or largest, as ``extreme`` says) number in each square and the eight round it."""
    for _ in range(2):  # along one axis, then along the other
        out = squares.copy()
        extreme(out[1:], squares[:-1], out=out[1:])
        extreme(out[:-1], squares[1:], out=out[:-1])
        squares = out.T
    return squares


def _nearest_of_squares(
    chart: IntArray, world: FloatArray, a: IntArray, b: IntArray, distance: FloatArray, side: float
) -> IntArray:
    """Which pairs of samples are the nearest of their two charts in their square, the first of equals."""
    if side <= 0 or len(a) == 0:
        return np.arange(len(a))
    x, y = np.floor((world[a] + world[b]) / (2 * side)).astype(np.int64).T
    x, y = x - x.min(), y - y.min()
    n = int(chart[-1]) + 1
    key = ((chart[a] * n + chart[b]) * (int(x.max()) + 1) + x) * (int(y.max()) + 1) + y
    order = np.argsort(key)
    head = first_of_runs(key[order])
    least = np.minimum.reduceat(distance[order], head)
    among = np.repeat(least, np.diff(np.r_[head, len(order)])) == distance[order]
    return np.sort(np.minimum.reduceat(np.where(among, order, len(order)), head))
