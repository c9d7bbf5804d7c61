"""What may be glued: single arcs and all arcs of a pair of charts; the unions of many of them side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    group_count,
    group_max,
    group_sum,
    ranges,
    stable_order,
)
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import corner_classes
from circparam.seams.segmentation.state import Arcs
from circparam.seams.segmentation.unions import Unions
from circparam.solvers.pattern import eliminate_as


@dataclass(frozen=True, eq=False)
class Glues:
    """Candidates for gluing: every arc, then every pair of neighbouring charts with all its arcs.

    left, right: charts. key: what was tried is remembered by it. score: the best are tried first. may: bool.
    useless: bool, known to fail, so that there is no need to lay the union out.
    pair: (arcs,) pair of each arc.
    """

    left: IntArray
    right: IntArray
    key: npt.NDArray[np.uint64]
    score: FloatArray
    may: BoolArray
    useless: BoolArray
    pair: IntArray
    rings: int = 1 << 62  # from this candidate on they glue both charts' slits as well

    def glued(self, arcs: Arcs, chosen: IntArray, n_edges: int) -> BoolArray:
        """(n_edges,) bool: edges that the chosen candidates glue."""
        n = len(arcs.left)
        arc = np.zeros(n, bool)
        arc[chosen[chosen < n]] = True
        several = chosen[(chosen >= n) & (chosen < self.rings)] - n
        closed = chosen[chosen >= self.rings]
        arc |= np.isin(self.pair, np.concatenate([several, closed - self.rings]))
        charts = np.concatenate([self.left[closed], self.right[closed]])
        arc |= (arcs.left == arcs.right) & np.isin(arcs.left, charts)
        out = np.zeros(n_edges, bool)
        out[arcs.edge[arc[arcs.arc]]] = True
        return out

    def edges(self, arcs: Arcs, chosen: IntArray) -> tuple[IntArray, IntArray]:
        """(edge, place in ``chosen``) of all edges that each chosen candidate glues (none with slits)."""
        n = len(arcs.left)
        alone = chosen < n
        place, arc = np.flatnonzero(alone), chosen[alone]
        if not alone.all():
            of, several = members(self.pair, chosen[~alone] - n)
            place = np.concatenate([place, np.flatnonzero(~alone)[of]])
            arc = np.concatenate([arc, several])
        of, entry = members(arcs.arc, arc)
        return arcs.edge[entry], place[of]


def members(groups: IntArray, asked: IntArray) -> tuple[IntArray, IntArray]:
    """(place in ``asked``, member) of all members of each group that is asked for; groups: (n,) labels."""
    order = stable_order(groups)
    most = max(int(groups.max(initial=-1)), int(asked.max(initial=-1)))  # groups may be empty
    count = group_count(groups, most + 1)
    number = count[asked]
    first = (np.cumsum(count) - count)[asked]
    return np.repeat(np.arange(len(asked)), number), order[
        np.repeat(first, number) + ranges(number)
    ]


def rings_of(arcs: Arcs, pairs: IntArray, n: int, length: FloatArray) -> FloatArray:
    """(pairs,) length of all arcs of two charts and of the slits inside each: a tube, slit to unroll, goes
    round a disk whole. 0 where there is no slit.

    pairs: numbers left · n + right, length: of all arcs of each.
    """
    own = arcs.left == arcs.right
    slit = group_sum(arcs.length[own], arcs.left[own], n)
    left, right = pairs // n, pairs % n
    both = slit[left] + slit[right]
    return np.where((left != right) & (both > 0), length + both, 0.0)


def known_excess(
    atlas: Atlas,
    arcs: Arcs,
    chart: IntArray,
    lower_bound: FloatArray,
    candidates: tuple[IntArray, IntArray, IntArray],
) -> FloatArray:
    """(candidates,) how far above 1 the energy of each union is at least, as failed unions tell.

    A map of a chart is one of each of its parts, so its distortion times its area is no less than that of
    a part, and arcs and charts only grow. lower_bound: (e,) of the unions that failed along each edge, energy
    times area. candidates: left, right and pair, as ``Glues`` has them.
    """
    left, right, pair = candidates
    area = group_sum(atlas.surface.areas, chart, len(np.bincount(chart)))
    union = np.where(left == right, area[left], area[left] + area[right])
    of_arc = group_max(lower_bound[arcs.edge], arcs.arc, len(arcs.left))
    several = group_max(of_arc, pair, int(pair.max()) + 1)
    result: FloatArray = np.concatenate([of_arc, several, several])[: len(left)] / union
    return result


def perimeters(atlas: Atlas, arcs: Arcs, chart: IntArray, n: int) -> FloatArray:
    """(n,) length of the boundary of every chart. chart: (m,) chart of each face."""
    rim = group_sum(arcs.length, arcs.left, n) + group_sum(arcs.length, arcs.right, n)
    return rim + group_sum(atlas.boundary_lengths, chart[atlas.surface.boundary // 3], n)


def side_by_side(
    atlas: Atlas, arcs: Arcs, glues: Glues, chosen: IntArray, ranks: IntArray
) -> Unions:
    """The unions of the chosen candidates (of two charts each), all in one cut mesh; a chart may be in several.

    ranks: order of elimination of the vertices of the surface.
    """
    surface = atlas.surface
    n, chart = atlas.charts()
    side = np.stack([glues.left[chosen], glues.right[chosen]], 1).ravel()
    of_side, fid = members(chart, side)
    size = group_count(chart, n)
    rank = np.empty(len(chart), np.int64)  # of a face in its chart
    rank[stable_order(chart)] = ranges(size)
    base = np.cumsum(size[side]) - size[side]
    # a half-edge of the surface in one side of a union
    inner = surface.edges[~atlas.cut]
    at, entry = members(chart[inner[:, 0] // 3], side)
    e = inner[entry]
    edges = 3 * (base[at, None] + rank[e // 3]) + e % 3
    edge, union = glues.edges(arcs, chosen)
    e = surface.edges[edge]
    at = 2 * union[:, None] + (chart[e // 3] != side[2 * union, None])
    glued = 3 * (base[at] + rank[e // 3]) + e % 3
    edges = np.concatenate([edges, glued])
    _, faces = corner_classes(len(fid), edges)
    cut_mesh = CutMesh(faces, surface.rest_triangles[fid], of_side // 2, edges)
    eliminate_as(cut_mesh, ranks, surface.corner_vertex[fid])
    return Unions(cut_mesh, atlas.corners[fid], of_side % 2 == 1)
