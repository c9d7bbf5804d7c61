"""What may be glued: single arcs and all arcs of a pair of charts; the unions of many of them side by side."""

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    group_max,
    group_sum,
)
from circparam.core.records import dataclass
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.state import Arcs


@dataclass(frozen=True, eq=False)
class Glues:
    """Candidates for gluing: every arc, then every pair of neighbouring charts with all its arcs.

    left, right: charts. key: what was tried is remembered by it. score: the best are tried first. may: bool.
    pair: (arcs,) pair of each arc.
    """

    left: IntArray
    right: IntArray
    key: npt.NDArray[np.uint64]
    score: FloatArray
    may: BoolArray
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
