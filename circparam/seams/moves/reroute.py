"""Reroute seams: pieces of chains take the cheapest path inside a band round them."""

import numpy as np

from circparam.core.arrays import group_count, group_sum
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.seams.evaluate import Demands
from circparam.seams.hard.regions import level_edges
from circparam.seams.prices import edge_costs
from circparam.seams.search import WORK_PER_FACE, Candidates, Effort, Outcome, search
from circparam.seams.segmentation.paths import Bands, bands, chains_of, route

PIECE_EDGES = 20  # of a piece that moves
PIECE_SHIFTS = 3  # each with other ends of the pieces


def move_seams(atlas: Atlas, demands: Demands, monitor: Monitor) -> None:
    """Move pieces of seams to cheaper places, as far as every chart stays a good one.

    The number of charts stays, and no piece moves whose charts would not meet the demands.
    """
    for step in range(PIECE_SHIFTS):
        if monitor.expired:
            return
        proposal = propose(atlas, pieces=(PIECE_EDGES, step * PIECE_EDGES // PIECE_SHIFTS))
        effort = Effort(work=WORK_PER_FACE * len(atlas.surface.faces) / PIECE_SHIFTS)
        search(atlas, Reroute(atlas, proposal), demands, effort, monitor)


def shorten(atlas: Atlas, rings: int, pinned: BoolArray | None = None) -> None:
    """Make all chains of seams shortest paths, whatever their charts become. pinned: see ``propose``."""
    proposal = propose(atlas, rings, pinned)
    atlas.cut = proposal.cut(np.ones(proposal.n, bool))


def lead_round_flats(atlas: Atlas) -> None:
    """Lead pieces of seams round the flats that they cross, by the edges beside them."""
    inside = np.where(level_edges(atlas.surface), atlas.surface.edge_lengths, 0.0)
    if inside[atlas.cut].any():
        proposal = propose(atlas, rings=1, pieces=(PIECE_EDGES, 0))
        old, new = proposal.costs(inside)
        atlas.cut = proposal.cut(new < old)


@dataclass(frozen=True, eq=False)
class Reroutes(Candidates):
    """Groups of pieces that lie between the same two charts, as ``Candidates`` has moves.

    cut: (e,) seams. proposal: where the pieces go. group: (pieces,) group of each, −1 for none.
    """

    cut: BoolArray
    proposal: "Proposal"
    group: IntArray

    def seams(self, chosen: IntArray) -> BoolArray:
        """(e,) seams when the pieces of some groups have moved."""
        take = np.r_[np.isin(self.group, chosen), False]  # the last entry stands for −1
        return (self.cut & ~take[self.proposal.old]) | take[self.proposal.new]


class Reroute:
    """Moves pieces of chains, all those between two charts at first, and half of a group that failed.

    Bands of pieces are disjoint, so pieces move in any order.
    """

    def __init__(self, atlas: Atlas, proposal: "Proposal") -> None:
        old, new = proposal.costs(edge_costs(atlas))
        self.proposal, self.gain = proposal, old - new
        self.sides, self.faces = atlas.surface.sides.T, len(atlas.surface.faces)
        on = np.flatnonzero(proposal.old >= 0)
        self.edge = np.zeros(proposal.n, np.int64)  # one edge of each piece
        self.edge[proposal.old[on]] = on
        left, right = self._beside(atlas)
        _, pair = np.unique(left * (1 + right.max(initial=0)) + right, return_inverse=True)
        # (pieces,) group of each: pieces of a group move together, those of group −1 never
        self.group = np.where(self.gain > 0, pair.reshape(-1), -1)

    def propose(self, atlas: Atlas) -> Reroutes:
        """The groups, scored by what they gain for each face that is laid out."""
        on = np.flatnonzero(self.group >= 0)
        _, group = np.unique(self.group[on], return_inverse=True)
        self.group[on] = group = group.reshape(-1)
        count = int(group.max(initial=-1)) + 1
        gain = group_sum(self.gain[on], group, count)
        first = on[np.unique(group, return_index=True)[1]]  # a piece of each group
        left, right = (side[first] for side in self._beside(atlas))
        n, chart = atlas.charts()
        size = group_count(chart, n)
        score = gain / (size[left] + np.where(left == right, 0, size[right]))
        unit = atlas.surface.unit
        return Reroutes(
            left, right, score, gain / unit, atlas.cut, self.proposal, self.group.copy()
        )

    def learn(self, tried: Reroutes, outcome: Outcome) -> None:
        """Pieces that moved are done. A group that failed is halved: pieces beside faces that were stretched
        most are tried apart from the others. One piece that failed stays."""
        chosen, made = outcome.chosen, outcome.made
        self.group[np.isin(self.group, chosen[made])] = -1
        failed = np.isin(self.group, chosen[~made])
        if not failed.any():
            return
        rank = np.lexsort((self._stretch(outcome), self.group))
        rank = rank[failed[rank]]
        of = self.group[rank]
        size = np.bincount(of)[of]
        place = np.arange(len(of)) - np.searchsorted(of, of)  # in its group
        later = place >= (size + 1) // 2
        self.group[rank[later]] += 1 + int(self.group.max())
        self.group[rank[size == 1]] = -1

    def _stretch(self, outcome: Outcome) -> FloatArray:
        """(pieces,) mean stretch of the faces beside the old and the new path of each piece."""
        here = outcome.stretch(self.faces)[self.sides].sum(1)
        total, count = np.zeros(self.proposal.n), np.zeros(self.proposal.n)
        for path in (self.proposal.old, self.proposal.new):
            on = np.flatnonzero(path >= 0)
            total += group_sum(here[on], path[on], self.proposal.n)
            count += group_count(path[on], self.proposal.n)
        return total / np.maximum(count, 1)

    def _beside(self, atlas: Atlas) -> tuple[IntArray, IntArray]:
        """((pieces,), (pieces,)) charts on both sides, the lower number first."""
        sides = np.sort(atlas.charts()[1][self.sides[self.edge]], axis=1)
        return sides[:, 0], sides[:, 1]


@dataclass(frozen=True, eq=False)
class Proposal:
    """Shorter seams, chain by chain, so that single chains can be taken or left.

    old, new: (e,) chain whose path follows the edge before and after, −1 for none. kept: (e,) bool, seams that
    are in no chain. n: number of chains.
    """

    old: IntArray
    new: IntArray
    kept: BoolArray
    n: int

    def cut(self, take: BoolArray) -> BoolArray:
        """(e,) seams when the chains ``take`` ((n,) bool) move and the others stay."""
        take = np.r_[take, False]  # the last entry stands for −1
        stay = np.r_[~take[:-1], False]
        return self.kept | take[self.new] | stay[self.old]

    def costs(self, cost: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) what the old and the new path of every chain cost; cost: (e,) of each edge."""
        now, then = (np.flatnonzero(path >= 0) for path in (self.old, self.new))
        return (
            group_sum(cost[now], self.old[now], self.n),
            group_sum(cost[then], self.new[then], self.n),
        )


def propose(
    atlas: Atlas,
    rings: int = 2,
    pinned: BoolArray | None = None,
    pieces: tuple[int, int] | None = None,
) -> Proposal:
    """Shorten all seams inside bands of ``rings`` edges; junctions and ends on boundaries stay.

    pinned: (e,) bool, seams that stay as they are (sharp edges, seams the user asked for). pieces: (k, i),
    chains end at their i-th vertex as well, and at every k-th after it. The bands are
    disjoint, so any choice of moved and unmoved chains is free of crossings.
    """
    n_edges = len(atlas.cut)
    kept = np.zeros(n_edges, bool) if pinned is None else pinned & atlas.cut
    move = np.flatnonzero(atlas.cut & ~kept)
    old, new = np.full(n_edges, -1), np.full(n_edges, -1)
    if len(move) == 0:
        return Proposal(old, new, kept, 0)
    a, b = atlas.ends
    n = atlas.n_vertices
    stop = atlas.on_boundary.copy()
    stop[a[kept]] = stop[b[kept]] = True
    chains = chains_of(a[move], b[move], n, stop)
    if pieces is not None:
        stop[chains.vertex[chains.position % pieces[0] == pieces[1]]] = True
        chains = chains_of(a[move], b[move], n, stop)
    owner, value = bands(atlas.ends, n, chains, stop, rings)
    of_vertex = np.full(n, -1)
    of_vertex[chains.vertex] = chains.chain
    old[move] = np.maximum(of_vertex[a[move]], of_vertex[b[move]])
    # a chain of one edge between two junctions has no vertex of its own and cannot get shorter; a path along
    # that edge would undo a ring of three round a neck
    kept = kept.copy()
    kept[move[old[move] < 0]] = True
    cost = edge_costs(atlas)
    usable = np.flatnonzero(np.isfinite(cost) & ~kept)
    where = Bands((a[usable], b[usable]), cost[usable], owner, value)
    routes = route(where, chains.start, chains.end, chains.size)
    new[usable[routes.edges]] = routes.chain
    failed = np.isin(old, routes.failed) & (old >= 0)
    new[failed] = old[failed]
    new[kept] = -1
    return Proposal(old, new, kept, len(chains.start))
