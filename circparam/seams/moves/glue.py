"""Glue charts: single arcs, and all arcs of two charts at once."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import first_of_each, group_sum, mask_of
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.evaluate import MARGIN, Demands
from circparam.seams.options import USUAL, Search
from circparam.seams.search import Candidates, Effort, Outcome, search
from circparam.seams.segmentation.arcs import CONE, Arcs, arcs_of

MIX, RING = np.uint64(0x9E3779B97F4A7C15), np.uint64(0x5851F42D4C957F2D)
DRAFT_ROUNDS = 8  # of a draft: most charts that merge at all have done so by then
TIE = 0.2  # candidates whose scores differ by less are tried in another order by another draw


@dataclass(frozen=True)
class MergeOptions:
    """How charts are merged.

    bound, margin: see ``Demands``. cone: curvature of a vertex above which arcs end there. zip: whether the two
    sides of one chart are glued too. chart: what a chart less is worth, infinite where nothing else counts.
    count: so many charts are few enough. faces: no union has more (None: any may). work, rounds: see
    ``Effort``. search: how much is tried, and in which order near ties are, see ``Search``.
    """

    bound: float
    margin: float = MARGIN
    cone: float = CONE
    zip: bool = True
    chart: float = COST.chart
    work: float = np.inf
    faces: int | None = None
    count: int = 0
    rounds: float = np.inf
    search: Search = USUAL

    @property
    def demands(self) -> Demands:
        """What every union has to meet."""
        return Demands(self.bound, self.margin)


def merge(
    atlas: Atlas, options: MergeOptions, monitor: Monitor, fixed: BoolArray | None = None
) -> None:
    """Glue charts until no pair is left to try. fixed: (e,) bool, seams that must stay."""
    draft = options.search.draft
    rounds = min(DRAFT_ROUNDS, options.rounds) if draft else options.rounds
    # the few unions of a draft on the mesh itself do not pay for an order of the whole surface
    ordered = not draft or options.faces is None
    effort = Effort(options.work, rounds, ordered)
    search(atlas, Glue(atlas, options, fixed), options.demands, effort, monitor)


@dataclass(frozen=True, eq=False)
class Glues(Candidates):
    """Candidates for gluing: every arc, and every pair of charts with all its arcs.

    Two charts that close a flat ring overlap with one arc glued, and not with both. length: (k,) of the seam
    that goes. key: (k,) what was tried is remembered by it. pair: (arcs,) pair of each arc. cut: (e,) seams.
    """

    length: FloatArray
    key: npt.NDArray[np.uint64]
    pair: IntArray
    arcs: Arcs
    cut: BoolArray

    @property
    def n_arcs(self) -> int:
        """The first so many candidates are arcs."""
        return len(self.pair)

    @property
    def n_pairs(self) -> int:
        """The others are pairs."""
        return len(self.left) - self.n_arcs

    def seams(self, chosen: IntArray) -> BoolArray:
        """(e,) seams that are left when the chosen candidates are glued."""
        glued = mask_of(len(self.left), chosen)
        arc = glued[: self.n_arcs] | glued[self.n_arcs :][self.pair]
        out = self.cut.copy()
        out[self.arcs.edge[arc[self.arcs.arc]]] = False
        return out


class Glue:
    """Glues charts, and remembers what failed.

    A union that failed is not tried again while both charts stay as they are. fixed: (e,) bool, seams that must
    stay.
    """

    def __init__(self, atlas: Atlas, options: MergeOptions, fixed: BoolArray | None = None) -> None:
        self.options = options
        self.fixed = np.zeros(len(atlas.cut), bool) if fixed is None else fixed
        self.tried = np.zeros(0, np.uint64)

    def propose(self, atlas: Atlas) -> Glues:
        """All arcs and pairs of an atlas, scored by the length of the seam in shares of the boundary."""
        options, (n, chart) = self.options, atlas.charts()
        arcs = arcs_of(atlas, chart, options.cone)
        glues = glues_of(atlas, arcs, chart, n, options.chart)
        one = glues.left == glues.right
        may = self._untried(glues)
        if n <= options.count:
            may[:] = False
        if not options.zip:
            may &= ~one
        if options.faces is not None:
            size = np.bincount(chart)
            may &= size[glues.left] + np.where(one, 0, size[glues.right]) <= options.faces
        rim = group_sum(arcs.length, arcs.left, n) + group_sum(arcs.length, arcs.right, n)
        rim += group_sum(atlas.surface.boundary_lengths, chart[atlas.surface.boundary // 3], n)
        # zipping a chart up uses distortion that gluing another chart on may need: it comes last
        score = glues.length / np.minimum(rim[glues.left], rim[glues.right])
        score = score * _luck(glues.key, options.search.draw) - one
        return replace(glues, score=np.where(may, score, -np.inf))

    def learn(self, tried: Glues, outcome: Outcome) -> None:
        """What was tried is not tried again while both charts stay."""
        self.tried = np.union1d(self.tried, tried.key[outcome.chosen])

    def _untried(self, glues: Glues) -> BoolArray:
        """(candidates,) bool: what may be tried. Several arcs at once are, when each alone has failed."""
        arcs, first = glues.arcs, glues.n_arcs
        held = mask_of(first, arcs.arc[self.fixed[arcs.edge]])
        untried = ~np.isin(glues.key, self.tried)
        waiting = mask_of(glues.n_pairs, glues.pair[untried[:first] | held])
        several = np.bincount(glues.pair, minlength=glues.n_pairs) > 1
        several &= (glues.left != glues.right)[first:]
        alone = ((arcs.left != arcs.right) | arcs.tip) & ~held
        return np.concatenate([alone, several & ~waiting]) & untried


def glues_of(atlas: Atlas, arcs: Arcs, chart: IntArray, n: int, worth: float) -> Glues:
    """All candidates of an atlas, without scores. chart: (m,) chart of each face. worth: of a chart less."""
    pairs, pair = np.unique(arcs.left * n + arcs.right, return_inverse=True)
    pair = pair.reshape(-1)
    left, right = np.divmod(pairs, n)
    length = np.concatenate([arcs.length, group_sum(arcs.length, pair, len(pairs))])
    left = np.concatenate([arcs.left, left])
    right = np.concatenate([arcs.right, right])
    # a chart is known by its first face and its size, an arc by its first edge
    size = np.bincount(chart, minlength=n)
    first_face = first_of_each(chart, n)
    mark = np.full(len(left), len(atlas.cut) + 1)
    np.minimum.at(mark, arcs.arc, arcs.edge)
    key = hashed(first_face[left], size[left], first_face[right], size[right], mark)
    gain = length / atlas.surface.unit + np.where(left != right, worth, 0.0)
    return Glues(left, right, np.zeros(len(left)), gain, length, key, pair, arcs, atlas.cut)


def hashed(*numbers: IntArray) -> npt.NDArray[np.uint64]:
    """(k,) one number for each row of several (k,)."""
    key = np.zeros(len(numbers[0]), np.uint64)
    for part in numbers:
        key = (key ^ part.astype(np.uint64)) * MIX
        key ^= key >> np.uint64(29)
    return key


def _luck(key: npt.NDArray[np.uint64], draw: int) -> FloatArray:
    """(k,) factors of scores, 1 for the first draw and up to TIE above and below for others."""
    if draw == 0:
        return np.ones(len(key))
    mixed = (key ^ (np.full(1, draw, np.uint64) * RING)) * MIX
    mixed = (mixed ^ (mixed >> np.uint64(31))) * RING
    return 1 + TIE * ((mixed >> np.uint64(40)) / 2.0**23 - 1)
