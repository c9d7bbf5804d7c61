"""Where boundaries of charts meet, come near, or lie inside one another."""

import numpy as np

from circparam.core.arrays import (
    cross2,
    edge_keys,
    found_in,
    group_boxes,
    norms2,
    ranges,
    sorted_distinct,
    stable_order,
)
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.boundary import BoundarySegments
from circparam.geometry.predicates import orientation
from circparam.geometry.segment_grid import Candidates

CHUNK_TESTS = 2_000_000  # points x segments looked at together
SHORT, PIECE = 0.25, 0.5  # segments below so many reaches are looked at in pieces about so long
CHAMFER_MARGINS = 1.5  # margins: so little boundary between two long segments does not part them
# parts of a boundary closer than 8 margins along it are not compared for nearness
NEIGHBOUR_MARGINS = 8


def meeting(
    boundary: BoundarySegments, between: bool, among: BoolArray | None = None
) -> tuple[IntArray, IntArray, IntArray]:
    """Pairs of segments beside which the insides of charts meet.

    between: compare different charts, at least one pair of segments for each two that meet; else parts of one
    chart. among: (n,) charts that are looked at, None for all. Returns (i, j, charts so crowded with segments
    that not every pair was looked at: empty but for degenerate layouts).
    """
    n = len(boundary.size)
    known = np.zeros(0, np.int64)  # pairs of charts that meet for sure, as ascending keys
    looked_at = np.ones(n, bool) if among is None else among
    live = np.flatnonzero(_moves(boundary) & looked_at[boundary.chart])
    group = np.zeros(len(live), np.int64) if between else boundary.chart[live]
    candidates = Candidates(boundary.start[live], boundary.end[live], group, np.zeros(len(live)))
    found = [np.zeros((0, 2), np.int64)]
    for i, j in candidates:
        i, j = live[i], live[j]
        if not between:
            ok = (boundary.following[i] != j) & (boundary.before[i] != j)
            found.append(_meet(boundary, i[ok], j[ok]))
            continue
        a, b = boundary.chart[i], boundary.chart[j]
        ok = (a != b) & (found_in(known, edge_keys(a, b, n)) < 0)
        met = _meet(boundary, i[ok], j[ok])
        found.append(met)
        a, b = boundary.chart[met].T
        known = sorted_distinct(np.concatenate([known, edge_keys(a, b, n)]))
    met = np.concatenate(found)
    pairs = distinct_pairs(met[:, 0], met[:, 1], len(boundary.start))
    crowded = np.zeros(0, np.int64) if between else candidates.crowded
    return pairs[:, 0], pairs[:, 1], crowded


def _moves(boundary: BoundarySegments) -> BoolArray:
    """(b,) bool: the segment is no single point."""
    s, e = boundary.start, boundary.end
    return (s[:, 0] != e[:, 0]) | (s[:, 1] != e[:, 1])


def _meet(boundary: BoundarySegments, i: IntArray, j: IntArray) -> IntArray:
    """The pairs (k, 2) among the candidates (i, j) whose insides meet."""
    s, e = boundary.start, boundary.end
    o1, o2 = orientation(s[i], e[i], s[j]), orientation(s[i], e[i], e[j])
    ok = o1 * o2 <= 0
    i, j, o1, o2 = i[ok], j[ok], o1[ok], o2[ok]
    o3, o4 = orientation(s[j], e[j], s[i]), orientation(s[j], e[j], e[i])
    proper = (o1 * o2 < 0) & (o3 * o4 < 0)
    found = [np.stack([i[proper], j[proper]], 1)]
    touch = ~proper & (o3 * o4 <= 0)
    if touch.any():
        i, j = i[touch], j[touch]
        # each end of one segment that lies on the other: a vertex is named by the segment that begins there
        for a, b, at_start, at_end in ((i, j, o1, o2), (j, i, o3, o4)):
            for sign, place, vertex in (
                (at_start[touch], s[b], b),
                (at_end[touch], e[b], boundary.following[b]),
            ):
                low, high = np.minimum(s[a], e[a]), np.maximum(s[a], e[a])
                on = (sign == 0) & (low <= place).all(1) & (place <= high).all(1)
                found.append(_touching(boundary, a[on], b[on], vertex[on]))
    return np.concatenate(found)


def _touching(boundary: BoundarySegments, a: IntArray, b: IntArray, vertex: IntArray) -> IntArray:
    """Pairs (a, b) whose insides meet where a vertex of b lies on segment a."""
    place = boundary.start[vertex]
    first = (place == boundary.start[a]).all(1)
    last = (place == boundary.end[a]).all(1)
    other = np.where(first, a, boundary.following[a])
    ends = first | last
    # ends that follow each other (a fold of no width) are no two parts of the boundary
    apart = (
        (other != vertex)
        & (boundary.following[other] != vertex)
        & (boundary.before[other] != vertex)
    )
    met = np.zeros(len(a), bool)
    k = np.flatnonzero(ends & apart)
    met[k] = wedges_meet(boundary, other[k], vertex[k])
    k = np.flatnonzero(~ends & (a != vertex) & (a != boundary.before[vertex]))
    met[k] = wedge_left_of(boundary, vertex[k], a[k])
    return np.stack([a[met], b[met]], 1)


def wedge_left_of(boundary: BoundarySegments, vertex: IntArray, segment: IntArray) -> BoolArray:
    """Whether the inside at a vertex reaches to the left of a segment that the vertex lies on.

    The inside at a vertex is the wedge counter-clockwise from the segment that leaves it to the one that
    arrives.
    """
    place, s, e = boundary.start[vertex], boundary.start[segment], boundary.end[segment]
    leaves, arrives = boundary.end[vertex], boundary.start[boundary.before[vertex]]
    side_out, side_in = orientation(s, e, leaves), orientation(s, e, arrives)
    turn = orientation(place, leaves, arrives)
    forward_out = side_out == 0
    forward_out &= _same_direction(leaves - place, e - s)
    back_in = (side_in == 0) & ~_same_direction(arrives - place, e - s)
    back_out = (side_out == 0) & ~forward_out
    reaches = (side_out > 0) | (side_in > 0) | forward_out
    reaches |= back_in & (back_out | (side_out < 0))
    reaches |= (side_out < 0) & (side_in < 0) & (turn <= 0)
    return reaches


def wedges_meet(boundary: BoundarySegments, a: IntArray, b: IntArray) -> BoolArray:
    """Whether the insides at two boundary vertices in the same place share more than that point."""
    place = boundary.start[a]
    out_a, in_a = boundary.end[a], boundary.start[boundary.before[a]]
    out_b, in_b = boundary.end[b], boundary.start[boundary.before[b]]
    return _within(place, out_a, in_a, out_b) | _within(place, out_b, in_b, out_a)


def _within(o: FloatArray, first: FloatArray, last: FloatArray, x: FloatArray) -> BoolArray:
    """Whether direction x lies in the arc from first (included) counter-clockwise to last (excluded).

    Directions are points seen from o. Equal first and last mean the full turn.
    """
    first_x, x_last = orientation(o, first, x), orientation(o, x, last)
    span = orientation(o, first, last)
    same = (span == 0) & _same_direction(last - o, first - o)
    flat = (span == 0) & ~same
    at_first = (first_x == 0) & _same_direction(x - o, first - o)
    convex = (span > 0) & (first_x > 0) & (x_last > 0)
    # a reflex arc holds the directions outside the convex arc from last to first
    reflex = (span < 0) & ~((x_last <= 0) & (first_x <= 0))
    return at_first | same | convex | (flat & (first_x > 0)) | reflex


def _same_direction(v: FloatArray, w: FloatArray) -> BoolArray:
    """Whether parallel vectors point the same way; the signs of differences of floats are exact."""
    return (np.sign(v) == np.sign(w)).all(1)


def nearby(
    boundary: BoundarySegments, distance: FloatArray, charts: BoolArray, chamfers: bool = False
) -> tuple[IntArray, IntArray]:
    """Pairs of segments of one chart nearer than distance (n,), for some charts (n,) bool.

    Parts of one loop that are less than 8 distances apart along it are neighbours and left out. chamfers: so
    are long segments with so little boundary between them that they cannot but be near.
    """
    live = np.flatnonzero(charts[boundary.chart] & _moves(boundary))
    if len(live) == 0:
        return live, live
    reach = distance[boundary.chart]
    loop, position, total = boundary.along
    first, count, member = _pieces(boundary, live, reach)
    last = member[first + count - 1]
    of = member[first]
    start, end, chart = boundary.start[of], boundary.end[last], boundary.chart[of]
    # no point of a piece of several segments is further from its chord than that
    sag = np.where(count > 1, (PIECE + SHORT) / 2 * reach[of], 0.0)
    found = [np.zeros((0, 2), np.int64)]
    for k, m in Candidates(start, end, chart, reach[of] + 2 * sag):
        slack = sag[k] + sag[m]
        close = segment_distance(start[k], end[k], start[m], end[m])
        step = np.abs(position[of[k]] - position[of[m]])
        step = np.minimum(step, total[of[k]] - step) + 2 * slack
        beside = (loop[of[k]] == loop[of[m]]) & (step < NEIGHBOUR_MARGINS * reach[of[k]])
        keep = (close < reach[of[k]] + slack) & ~beside
        k, m = k[keep], m[keep]
        # segments i of pieces k with segments j of pieces m, all with all
        number = count[k] * count[m]
        pair, at = np.repeat(np.arange(len(k)), number), ranges(number)
        i = member[first[k][pair] + at // count[m][pair]]
        j = member[first[m][pair] + at % count[m][pair]]
        apart = np.abs(position[i] - position[j])
        apart = np.minimum(apart, total[i] - apart)
        far = (loop[i] != loop[j]) | (apart > NEIGHBOUR_MARGINS * reach[i])
        far &= (boundary.following[i] != j) & (boundary.before[i] != j)
        if chamfers:
            length = norms2(boundary.end - boundary.start)
            forward = np.mod(position[j] - position[i], total[i]) - length[i]
            backward = np.mod(position[i] - position[j], total[i]) - length[j]
            far &= (loop[i] != loop[j]) | (
                np.minimum(forward, backward) > CHAMFER_MARGINS * reach[i]
            )
        i, j = i[far], j[far]
        close = segment_distance(
            boundary.start[i], boundary.end[i], boundary.start[j], boundary.end[j]
        )
        near = close < reach[i]
        i, j = i[near], j[near]
        found.append(np.stack([i, j], 1))
    met = np.concatenate(found)
    pairs = distinct_pairs(met[:, 0], met[:, 1], len(boundary.start))
    return pairs[:, 0], pairs[:, 1]


def distinct_pairs(a: IntArray, b: IntArray, n: int) -> IntArray:
    """(p, 2) unordered pairs of numbers below n, each once, the lower number first, in ascending order."""
    return np.stack(np.divmod(sorted_distinct(edge_keys(a, b, n)), max(n, 1)), 1)


def _pieces(
    boundary: BoundarySegments, live: IntArray, reach: FloatArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Consecutive short segments as pieces about PIECE reaches long; every longer segment is one by itself.

    Returns (first, number) of each piece in ``member``, the segments in order along the boundary.
    """
    loop, position, _ = boundary.along
    member = live[np.lexsort((position[live], loop[live]))]
    length = norms2(boundary.end[member] - boundary.start[member])
    short = length < SHORT * reach[member]
    step = np.floor(position[member] / np.maximum(PIECE * reach[member], 1e-300))
    joined = short[1:] & short[:-1] & (step[1:] == step[:-1])
    joined &= boundary.following[member[:-1]] == member[1:]
    first = np.flatnonzero(np.concatenate([[True], ~joined]))
    return first, np.diff(np.concatenate([first, [len(member)]])), member


def properly_cross(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> BoolArray:
    """(n,) bool: segments ab and cd cross, no end of one on the other: by plain signs, not exact ones."""
    first = cross2(b - a, c - a) * cross2(b - a, d - a) < 0
    return first & (cross2(d - c, a - c) * cross2(d - c, b - c) < 0)


def segment_distance(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """(n,) distance between segments ab and cd that do not cross."""

    def to_segment(p: FloatArray, e: FloatArray, square: FloatArray, x: FloatArray) -> FloatArray:
        t = x - p
        t *= e
        share = np.clip((t[:, 0] + t[:, 1]) / square, 0.0, 1.0)
        return norms2(p + share[:, None] * e - x)

    def squares(e: FloatArray) -> FloatArray:
        return np.maximum(e[:, 0] * e[:, 0] + e[:, 1] * e[:, 1], 1e-300)

    ab, cd = b - a, d - c
    of_ab, of_cd = squares(ab), squares(cd)
    return np.minimum(
        np.minimum(to_segment(a, ab, of_ab, c), to_segment(a, ab, of_ab, d)),
        np.minimum(to_segment(c, cd, of_cd, a), to_segment(c, cd, of_cd, b)),
    )


def winding_pairs(
    boundary: BoundarySegments, chart: IntArray, points: FloatArray
) -> tuple[IntArray, IntArray]:
    """(inside, outside) charts: a point of the first has a winding number about the boundary of the second.

    chart: (k,) chart of each of the points (k, 2).
    """
    # points in the bounding box of each chart's boundary
    n = len(boundary.size)
    low, high = group_boxes(boundary.start, boundary.chart, n)
    order = np.argsort(points[:, 1], kind="stable")
    y = points[order, 1]
    first = np.searchsorted(y, low[:, 1])
    number = np.maximum(np.searchsorted(y, high[:, 1], side="right") - first, 0)
    pairs = [(np.zeros(0, np.int64), np.zeros(0, np.int64))]
    for part in np.array_split(np.arange(n), 1 + int(number.sum()) // CHUNK_TESTS):
        other = np.repeat(part, number[part])
        k = order[np.repeat(first[part], number[part]) + ranges(number[part])]
        x = points[k, 0]
        inside = (x >= low[other, 0]) & (x <= high[other, 0])
        pairs.append((k[inside], other[inside]))
    k, other = (np.concatenate(some) for some in zip(*pairs, strict=True))
    among = other != chart[k]
    k, other = k[among], other[among]
    inside = windings(boundary, points[k], other) != 0
    return chart[k[inside]], other[inside]


def windings(boundary: BoundarySegments, points: FloatArray, chart: IntArray) -> IntArray:
    """(k,) winding number of the boundary of its chart ((k,) int) about each point (k, 2).

    A ray to the right of every point is crossed with the segments of that chart in its strip of y.
    """
    s, e = boundary.start, boundary.end
    out = np.zeros(len(points), np.int64)
    if len(s) == 0 or len(points) == 0:
        return out
    low, high = np.minimum(s[:, 1], e[:, 1]), np.maximum(s[:, 1], e[:, 1])
    origin = float(low.min())
    width = max(float((high - low).mean()), float(high.max() - origin) / (4 * len(s)), 1e-300)
    floors = int((high.max() - origin) / width) + 2  # strips of each chart
    first = ((low - origin) / width).astype(np.int64)
    count = ((high - origin) / width).astype(np.int64) - first + 1
    strip = np.repeat(floors * boundary.chart + first, count) + ranges(count)
    order = stable_order(strip)
    segment = np.repeat(np.arange(len(s)), count)[order]
    strip = strip[order]
    level = np.clip(np.floor((points[:, 1] - origin) / width), -1, floors).astype(np.int64)
    mine = np.where((level >= 0) & (level < floors), floors * chart + level, -1)
    begin = np.searchsorted(strip, mine)
    number = np.searchsorted(strip, mine, side="right") - begin
    for part in np.array_split(np.arange(len(points)), 1 + int(number.sum()) // CHUNK_TESTS):
        k = np.repeat(part, number[part])
        j = segment[np.repeat(begin[part], number[part]) + ranges(number[part])]
        y = points[k, 1]
        up = (s[j, 1] <= y) & (y < e[j, 1])
        down = (e[j, 1] <= y) & (y < s[j, 1])
        ok = (up | down) & (np.maximum(s[j, 0], e[j, 0]) >= points[k, 0])
        k, j, up = k[ok], j[ok], up[ok]
        side = orientation(s[j], e[j], points[k])
        np.add.at(out, k, np.where(up, side > 0, 0) - np.where(~up, side < 0, 0))
    return out
