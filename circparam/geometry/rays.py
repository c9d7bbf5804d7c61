"""Where rays meet a surface first: a tree of boxes, packets of near rays, array operations over all pairs.

Rays of a bake are many, short and in order: neighbours go side by side. Rays therefore form packets. A packet
is a capsule: its mean segment and a radius that holds all its rays. Capsules go down the tree level by level,
and only the remaining pairs are tested ray by ray.
"""

from typing import TypeAlias

import numpy as np

from circparam.core.arrays import blocks, first_of_groups, group_sum, ranges, relabel, slices, unit
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray

TREE_WIDTH = 4  # children of a box, and faces of a leaf
BLOCK_PAIRS = 50_000  # pairs of ray and face in one block, which fits the cache
# side of the cells whose rays make a packet, in mean diagonals of the faces' boxes
CELL_DIAGONALS = 0.8
BLOCK_RAYS = 200_000  # rays at once
# origin (p, 3), unit direction (p, 3) and reach (p,) of lines
Lines: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
EDGE_WEIGHT = 1e-9  # barycentric: rays that meet an edge meet a face beside it, whatever is rounded


@dataclass(frozen=True, eq=False)
class Hits:
    """face: (p,) int64, −1 if a ray meets nothing. bary: (p, 3). t: (p,) place along the ray's direction."""

    face: IntArray
    bary: FloatArray
    t: FloatArray

    def take(self, rows: BoolArray) -> "Hits":
        """Some of the rays."""
        return Hits(self.face[rows], self.bary[rows], self.t[rows])


class BoxTree:
    """Boxes round runs of faces along a Morton curve, four a leaf, four boxes in the next one up."""

    def __init__(self, corners: FloatArray) -> None:
        """corners: (m, 3, 3), finite, m ≥ 1."""
        low, high = self.low, self.high = corners.min(1), corners.max(1)
        self.order = np.argsort(_morton((low + high) / 2), kind="stable")
        self.corners = corners
        self.planes = _to_barycentric(corners)
        self.levels = [_runs(low[self.order], high[self.order])]
        while len(self.levels[-1][0]) > 1:
            self.levels.append(_runs(*self.levels[-1]))

    def near(
        self, start: FloatArray, end: FloatArray, radius: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Pairs (segment, face) whose boxes come within (p,) radius of segments start (p, 3) to end (p, 3)."""
        segment = np.arange(len(start))
        node = np.zeros(len(start), np.int64)
        sizes = [len(self.order), *(len(low) for low, _ in self.levels)]
        for below, (low, high) in zip(sizes[-2::-1], reversed(self.levels), strict=True):
            keep = _meets(start[segment], end[segment], radius[segment], low[node], high[node])
            segment = np.repeat(segment[keep], TREE_WIDTH)
            node = (TREE_WIDTH * node[keep, None] + np.arange(TREE_WIDTH)).ravel()
            segment, node = segment[node < below], node[node < below]
        face = self.order[node]
        keep = _meets(
            start[segment], end[segment], radius[segment], self.low[face], self.high[face]
        )
        return segment[keep], face[keep]


def _runs(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Boxes of runs of TREE_WIDTH boxes."""
    first = np.arange(0, len(low), TREE_WIDTH)
    return np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)


def _morton(places: FloatArray) -> IntArray:
    """(m,) numbers of places (m, 3) along a curve that keeps near places near."""
    low, span = places.min(0), max(float(np.ptp(places, axis=0).max()), 1e-300)
    cell = ((places - low) / span * 0xFFFF).astype(np.int64)
    for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):  # fmt: skip
        cell = (cell | (cell << shift)) & mask
    return cell[:, 0] | (cell[:, 1] << 1) | (cell[:, 2] << 2)


def _meets(
    start: FloatArray, end: FloatArray, radius: FloatArray, low: FloatArray, high: FloatArray
) -> BoolArray:
    """Whether segments meet boxes that are widened by a radius: by slabs."""
    met = np.ones(len(start), bool)
    first, last = np.zeros(len(start)), np.ones(len(start))
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(3):  # columns at a time, which is several times faster
            begin, along = start[:, k], end[:, k] - start[:, k]
            down, up = low[:, k] - radius - begin, high[:, k] + radius - begin
            one, two = down / along, up / along
            still = along == 0  # inside the slab, or never
            met &= ~still | ((down <= 0) & (up >= 0))
            first = np.maximum(first, np.where(still, 0.0, np.minimum(one, two)))
            last = np.minimum(last, np.where(still, 1.0, np.maximum(one, two)))
    met &= first <= last
    return met


def _to_barycentric(corners: FloatArray) -> FloatArray:
    """(12, m) rows that give (v, w, height over the face) of a point; NaN for faces without area.

    The height is in units of the normal e1 × e2 (Baldwin and Weber 2016 do the same with other numbers).
    """
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = np.cross(e1, e2)
    with np.errstate(divide="ignore", invalid="ignore"):
        square = (n * n).sum(1, keepdims=True)
        rows = np.stack([np.cross(e2, n), np.cross(n, e1), n], 1) / square[:, None]
    whole = np.concatenate([rows, -np.einsum("mrk,mk->mr", rows, a)[..., None]], 2)
    return np.ascontiguousarray(whole.reshape(-1, 12).T)


def first_hits(
    tree: BoxTree,
    origin: FloatArray,
    direction: FloatArray,
    reach: FloatArray,
    nearest: bool = False,
) -> Hits:
    """Where lines meet the front of a surface first.

    origin: (p, 3). direction: (p, 3) unit. reach: (p,) how far a line goes from its origin, both ways. A ray
    comes from the far end of its direction, as light falls on a surface, and misses faces that look the other
    way. nearest: take the hit nearest to the origin, not the first.
    """
    face, bary, t = np.full(len(origin), -1), np.zeros((len(origin), 3)), np.zeros(len(origin))
    for part in slices(len(origin), BLOCK_RAYS):
        ray, met, vwt = _met_by_packets(tree, (origin[part], direction[part], reach[part]))
        # of equal hits that of the lowest face
        first = first_of_groups(ray, np.abs(vwt[:, 2]) if nearest else -vwt[:, 2], met)
        hit, (v, w) = part.start + ray[first], np.clip(vwt[first, :2], 0, 1).T
        face[hit], t[hit] = met[first], vwt[first, 2]
        bary[hit] = np.stack([np.maximum(1 - v - w, 0), v, w], 1)
    return Hits(face, bary, t)


def _met_by_packets(tree: BoxTree, lines: Lines) -> tuple[IntArray, IntArray, FloatArray]:
    """All hits of one block of rays, as ``_met`` has them."""
    packet, start, end, radius = _packets(tree, lines)
    segment, candidate = tree.near(start, end, radius)
    keep = _touches(start, end, radius, segment, tree.corners[candidate])
    segment, candidate = segment[keep], candidate[keep]
    # pairs of packet and face become pairs of ray and face
    by_packet = np.argsort(packet, kind="stable")
    size = np.bincount(packet, minlength=len(start))
    begin, count = (np.cumsum(size) - size)[segment], size[segment]
    origin, direction, reach = lines
    columns = np.concatenate([origin.T, direction.T, reach[None]])
    found = []
    for part in blocks(count, BLOCK_PAIRS):
        c = count[part]
        ray = by_packet[np.repeat(begin[part], c) + ranges(c)]
        found.append(_met(tree, columns, ray, np.repeat(candidate[part], c)))
    ray, face, vwt = (np.concatenate(part) for part in zip(*found, strict=True))
    return ray, face, vwt


def _packets(tree: BoxTree, lines: Lines) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Rays side by side that look the same way: ((p,) packet, (k, 3) start, (k, 3) end, (k,) radius)."""
    origin, direction, reach = lines
    span = tree.corners.max(1) - tree.corners.min(1)
    cell = max(CELL_DIAGONALS * float(np.linalg.norm(span, axis=1).mean()), 1e-300)
    place = np.floor((origin - origin.min(0)) / cell).astype(np.int64) % (1 << 20)
    octant = ((direction > 0) * [1, 2, 4]).sum(1)
    key = (((place[:, 0] << 20) | place[:, 1]) << 20 | place[:, 2]) << 3 | octant
    n, packet = relabel(key)
    out = direction * reach[:, None]
    size = np.bincount(packet)[:, None]
    ends = []
    radius = np.zeros(n)
    for tip in (origin + out, origin - out):
        mean = group_sum(tip, packet, n) / size
        apart = np.linalg.norm(tip - mean[packet], axis=1)
        np.maximum.at(radius, packet, apart)
        ends.append(mean)
    return packet, ends[0], ends[1], radius


def _touches(
    start: FloatArray, end: FloatArray, radius: FloatArray, segment: IntArray, corners: FloatArray
) -> BoolArray:
    """Whether a face may lie in a capsule: seen along the axis, their rectangles overlap."""
    axis = unit(end - start)
    side = unit(np.cross(axis, np.eye(3)[np.abs(axis).argmin(1)]))
    other = np.cross(axis, side)
    reach = radius[segment] * (1 + 1e-9) + 1e-12 * np.abs(corners).max(initial=0)
    keep = np.ones(len(segment), bool)
    for direction in (side, other):
        d = direction[segment]
        offset = (start * direction).sum(1)[segment]
        x, y, z = (np.einsum("pk,pk->p", corners[:, c], d) - offset for c in range(3))
        keep &= np.minimum(np.minimum(x, y), z) <= reach
        keep &= np.maximum(np.maximum(x, y), z) >= -reach
    return keep


def _met(
    tree: BoxTree, lines: FloatArray, ray: IntArray, face: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Of pairs those where the line meets the face's front: (ray, face, (k, 3) of v, w, t)."""
    plane = [column[face] for column in tree.planes]
    ox, oy, oz, dx, dy, dz, reach = (column[ray] for column in lines)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = plane[8] * dx + plane[9] * dy + plane[10] * dz
        t = -(plane[8] * ox + plane[9] * oy + plane[10] * oz + plane[11]) / along
        x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
        v = plane[0] * x + plane[1] * y + plane[2] * z + plane[3]
        w = plane[4] * x + plane[5] * y + plane[6] * z + plane[7]
        inside = (v >= -EDGE_WEIGHT) & (w >= -EDGE_WEIGHT) & (v + w <= 1 + EDGE_WEIGHT)
        inside &= (along > 0) & (np.abs(t) <= reach)
    return ray[inside], face[inside], np.stack([v, w, t], 1)[inside]
