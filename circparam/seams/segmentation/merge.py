"""Merge charts: glue one arc of a pair of neighbours, lay the union out, keep it if it is good.

Every round glues at most one arc of every chart and lays all unions out in one block system, so a round costs
about one relaxation of the surface however many charts there are.
"""

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.graph import matching
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.cost import COST
from circparam.seams.evaluate import MARGIN, Demands, Moves, Trial, try_moves
from circparam.seams.options import USUAL, Search
from circparam.seams.segmentation.glues import (
    MIX,
    Glues,
    allowed,
    glues_of,
    known_excess,
    perimeters,
)
from circparam.seams.segmentation.state import CONE, arcs_of
from circparam.solvers.pattern import eliminate_as, elimination_ranks

RING = np.uint64(0x5851F42D4C957F2D)
SHARE = 0.5  # of the search for charts that merging is
DRAFT_ROUNDS = 8  # of a draft: most charts that merge at all have done so by then
TIE = 0.2  # candidates whose scores differ by less are tried in another order by another draw


@dataclass(frozen=True)
class MergeOptions:
    """How charts are merged.

    bound, margin: see ``Demands``. cone: curvature of a vertex above which arcs end there. zip: whether the two
    sides of one chart are glued too. cheaper: a union has to lower ``AtlasCost``, its distortion included; else
    any union below the bound will do. work: how many faces all trials may have together. faces:
    no union has more (None: any may). rounds: at most so many. search: how much is tried, and in which order
    near ties are, see ``Search``.
    """

    bound: float
    margin: float = MARGIN
    cone: float = CONE
    zip: bool = True
    cheaper: bool = False
    work: float = np.inf
    faces: int | None = None
    rounds: int = 1 << 32
    search: Search = USUAL

    @property
    def demands(self) -> Demands:
        """What every union has to meet."""
        return Demands(self.bound, self.margin)


class Merger:
    """Merges the charts of an atlas in rounds and remembers what was tried."""

    def __init__(
        self,
        atlas: Atlas,
        options: MergeOptions,
        fixed: BoolArray | None = None,
        worker: Worker | None = None,
    ) -> None:
        self.atlas, self.options = atlas, options
        self.worker = Worker(1) if worker is None else worker
        # (e,) bool: seams that must stay
        self.fixed = np.zeros(len(atlas.cut), bool) if fixed is None else fixed
        self.tried = np.zeros(0, np.uint64)
        self.lower_bound = np.zeros(
            len(atlas.cut)
        )  # (e,) energy times area of what failed along it
        self.work = options.work  # faces that trials may still have

    def run(self, monitor: Monitor) -> None:
        """Merge until no pair is left to try."""
        monitor.keep(self.atlas)
        draft = self.options.search.draft
        rounds = min(DRAFT_ROUNDS, self.options.rounds) if draft else self.options.rounds
        for turn in range(rounds):
            if monitor.expired or self.work < 0 or not self.round(monitor):
                break
            monitor.keep(self.atlas)
            monitor.update(SHARE * turn / (turn + DRAFT_ROUNDS))

    def round(self, monitor: Monitor) -> bool:
        """One round; False when there was nothing to try."""
        atlas = self.atlas
        n, chart = atlas.charts()
        arcs = arcs_of(atlas, chart, self.options.cone)
        if len(arcs.left) == 0:
            return False
        glues = glues_of(atlas, arcs, chart, n)
        may = allowed(glues, self.tried, self.fixed)
        if not self.options.zip:
            may &= glues.left != glues.right
        if self.options.faces is not None:
            size = np.bincount(chart)
            other = np.where(glues.left == glues.right, 0, size[glues.right])
            may &= size[glues.left] + other <= self.options.faces
        areas = group_sum(atlas.surface.areas, chart, n)
        may &= 1 + known_excess(glues, areas, self.lower_bound) <= self.options.bound
        open_glues = np.flatnonzero(may)
        if len(open_glues) == 0:
            return False
        rim = perimeters(atlas, arcs, chart, n)
        # zipping a chart up uses distortion that gluing another chart on may need: it comes last
        score = glues.length / np.minimum(rim[glues.left], rim[glues.right])
        score = score * _luck(glues.key, self.options.search.draw) - (glues.left == glues.right)
        left, right = glues.left[open_glues], glues.right[open_glues]
        chosen = open_glues[matching(score[open_glues], left, right, n)]
        self.tried = np.union1d(self.tried, glues.key[chosen])
        self._try(glues, chosen, chart, n, monitor)
        return True

    def _try(
        self, glues: Glues, chosen: IntArray, chart: IntArray, n: int, monitor: Monitor
    ) -> None:
        """Lay out the unions of the chosen candidates and keep the good ones."""
        atlas = self.atlas
        while True:
            cut = atlas.cut & ~glues.glued(chosen, len(atlas.cut))
            union = np.full(n, -1)
            union[glues.left[chosen]] = union[glues.right[chosen]] = np.arange(len(chosen))
            label = union[chart]
            cut_mesh, fid = atlas.surface.part_cut_mesh(cut, label >= 0, label)
            disks = ~not_disks(cut_mesh)
            if disks.all():
                break
            chosen = chosen[disks]
            if len(chosen) == 0:
                return
        few = self.options.search.draft and self.options.faces is not None
        if not few:  # no union has to look for an order of elimination of its own
            ranks, vertices = elimination_ranks(atlas.surface), atlas.surface.corner_vertex[fid]
            eliminate_as(cut_mesh, ranks, vertices)
        self.work -= len(cut_mesh.faces)
        moving = chart[fid] != glues.left[chosen][cut_mesh.chart]
        moves = Moves.gluing(cut_mesh, atlas.corners[fid], moving)
        trial = try_moves(moves, self.options.demands, self.worker, monitor)
        self._remember(glues, chosen, (trial.floor - 1) * cut_mesh.chart_areas)
        good = trial.good(self.options.bound)
        if self.options.cheaper:
            good &= self._gain(glues, chosen) > self._loss(moves, trial)
        kept = good[cut_mesh.chart]
        atlas.corners[fid[kept]] = trial.uv[cut_mesh.faces[kept]]
        atlas.cut &= ~glues.glued(chosen[good], len(atlas.cut))

    def _gain(self, glues: Glues, chosen: IntArray) -> FloatArray:
        """(chosen,) how much less seams and charts cost with each union."""
        one_less = COST.chart * (glues.left[chosen] != glues.right[chosen])
        gain: FloatArray = glues.length[chosen] / self.atlas.surface.unit + one_less
        return gain

    def _loss(self, moves: Moves, trial: Trial) -> FloatArray:
        """(chosen,) how much more the distortion costs with each union."""
        cut_mesh = moves.cut_mesh
        before = group_sum(moves.energies * cut_mesh.areas, cut_mesh.chart, cut_mesh.n_charts)
        with np.errstate(invalid="ignore"):
            more = trial.energy * cut_mesh.chart_areas - before
        loss: FloatArray = COST.distortion * more / self.atlas.surface.unit**2
        return loss

    def _remember(self, glues: Glues, chosen: IntArray, excess: FloatArray) -> None:
        """Keep (energy − 1) · area of the unions that failed, on the edges of their arcs.

        Where all arcs of a pair were glued nothing is known of each alone.
        """
        alone = chosen < glues.n_arcs
        of_arc = np.zeros(glues.n_arcs)
        of_arc[chosen[alone]] = excess[alone]
        edge, arc = glues.arcs.edge, glues.arcs.arc
        self.lower_bound[edge] = np.maximum(self.lower_bound[edge], of_arc[arc])


def _luck(key: npt.NDArray[np.uint64], draw: int) -> FloatArray:
    """(k,) factors of scores, 1 for the first draw and up to TIE above and below for others."""
    if draw == 0:
        return np.ones(len(key))
    mixed = (key ^ (np.full(1, draw, np.uint64) * RING)) * MIX
    mixed = (mixed ^ (mixed >> np.uint64(31))) * RING
    return 1 + TIE * ((mixed >> np.uint64(40)) / 2.0**23 - 1)
