"""What may be glued: single arcs, all arcs of two charts at once, and those with the slits inside both."""

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_max, group_sum
from circparam.core.records import dataclass
from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.state import Arcs

MIX = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True, eq=False)
class Glues:
    """Candidates for gluing: every arc, every pair of charts with all its arcs, every pair with its slits too.

    Two charts that close a flat ring overlap with one arc glued, and not with both. A tube, slit to unroll,
    goes round a disk whole. left, right: charts. key: what was tried is remembered by it. length: of the seam
    that goes. pair: (arcs,) pair of each arc.
    """

    left: IntArray
    right: IntArray
    key: npt.NDArray[np.uint64]
    length: FloatArray
    pair: IntArray
    arcs: Arcs

    @property
    def n_arcs(self) -> int:
        """The first so many candidates are arcs."""
        return len(self.pair)

    @property
    def n_pairs(self) -> int:
        """So many candidates after them are pairs, and as many again are pairs with their slits."""
        return (len(self.left) - self.n_arcs) // 2

    def glued(self, chosen: IntArray, n_edges: int) -> BoolArray:
        """(n_edges,) bool: edges that the chosen candidates glue."""
        arcs, first = self.arcs, self.n_arcs
        whole = np.zeros(self.n_pairs, bool)
        whole[(chosen[chosen >= first] - first) % max(self.n_pairs, 1)] = True
        arc = whole[self.pair]
        arc[chosen[chosen < first]] = True
        slit = chosen[chosen >= first + self.n_pairs]
        charts = np.r_[self.left[slit], self.right[slit]]
        arc |= (arcs.left == arcs.right) & np.isin(arcs.left, charts)
        out = np.zeros(n_edges, bool)
        out[arcs.edge[arc[arcs.arc]]] = True
        return out


def glues_of(atlas: Atlas, arcs: Arcs, chart: IntArray, n: int) -> Glues:
    """All candidates of an atlas. chart: (m,) chart of each face, n of them."""
    pairs, pair = np.unique(arcs.left * n + arcs.right, return_inverse=True)
    pair = pair.reshape(-1)
    left, right = np.divmod(pairs, n)
    together = group_sum(arcs.length, pair, len(pairs))
    own = arcs.left == arcs.right
    slit = group_sum(arcs.length[own], arcs.left[own], n)
    slits = np.where(left != right, slit[left] + slit[right], 0.0)
    length = np.concatenate([arcs.length, together, np.where(slits > 0, together + slits, 0.0)])
    left, right = (
        np.concatenate([arcs.left, left, left]),
        np.concatenate([arcs.right, right, right]),
    )
    # a chart is known by its first face and its size, an arc by its first edge
    size = np.bincount(chart, minlength=n)
    first_face = np.full(n, len(chart))
    np.minimum.at(first_face, chart, np.arange(len(chart)))
    mark = np.full(len(left), len(atlas.cut) + 1)
    mark[len(pair) + len(pairs) :] += 1
    np.minimum.at(mark, arcs.arc, arcs.edge)
    key = np.zeros(len(left), np.uint64)
    for part in (first_face[left], size[left], first_face[right], size[right], mark):
        key = (key ^ part.astype(np.uint64)) * MIX
        key ^= key >> np.uint64(29)
    return Glues(left, right, key, length, pair, arcs)


def allowed(glues: Glues, tried: npt.NDArray[np.uint64], fixed: BoolArray) -> BoolArray:
    """(candidates,) bool: what may be tried. tried: keys of what was. fixed: (e,) bool, seams that must stay.

    Several arcs at once are tried only when each alone has failed.
    """
    arcs, first = glues.arcs, glues.n_arcs
    held = np.zeros(first, bool)
    held[arcs.arc[fixed[arcs.edge]]] = True
    waiting = np.zeros(glues.n_pairs, bool)
    waiting[glues.pair[~np.isin(glues.key[:first], tried) | held]] = True
    several = np.bincount(glues.pair, minlength=glues.n_pairs) > 1
    several &= (glues.left != glues.right)[first : first + glues.n_pairs]
    slit = glues.length[first + glues.n_pairs :] > 0
    alone = ((arcs.left != arcs.right) | arcs.tip) & ~held
    may = np.concatenate([alone, several & ~waiting, slit & ~waiting])
    return may & ~np.isin(glues.key, tried)


def known_excess(glues: Glues, areas: FloatArray, lower_bound: FloatArray) -> FloatArray:
    """(candidates,) how far above 1 the energy of each union is at least, as failed unions tell.

    A map of a chart is one of each of its parts, so its distortion times its area is no less than that of
    a part, and arcs and charts only grow. areas: (n,) of charts. lower_bound: (e,) of the unions that failed
    along each edge, energy times area.
    """
    arcs, n = glues.arcs, glues.n_pairs
    of_arc = group_max(lower_bound[arcs.edge], arcs.arc, glues.n_arcs)
    of_pair = group_max(of_arc, glues.pair, n)
    union = areas[glues.left] + np.where(glues.left == glues.right, 0.0, areas[glues.right])
    return np.concatenate([of_arc, of_pair, of_pair]) / union


def perimeters(atlas: Atlas, arcs: Arcs, chart: IntArray, n: int) -> FloatArray:
    """(n,) length of the boundary of every chart. chart: (m,) chart of each face."""
    rim = group_sum(arcs.length, arcs.left, n) + group_sum(arcs.length, arcs.right, n)
    return rim + group_sum(atlas.boundary_lengths, chart[atlas.surface.boundary // 3], n)
