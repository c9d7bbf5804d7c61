"""Shorten the seams of an atlas chain by chain, as far as every chart stays good."""

from __future__ import annotations

import dataclasses

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.graph import matching
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.segmentation.layout import ChartLayouts, judge, lay_out_again
from circparam.seams.segmentation.shorten import Proposal, propose
from circparam.seams.segmentation.state import LaidOut
from circparam.solvers.newton import RelaxOptions

ROUNDS = 8  # of single chains that are tried again where all at once spoil a chart
BARREN = 1  # rounds in a row for charts that are bad as they are
WORTH_IT = 1e-3  # of the length of all seams: chains that gain less are not tried again


def shorten_seams(
    atlas: Atlas,
    bound: float,
    options: RelaxOptions,
    rings: int = 3,
    pinned: BoolArray | None = None,
    margin: float = 0.0,
) -> ChartLayouts:
    """Shorten the seams as far as every chart stays good; chains that would spoil one keep their old path.

    All chains are tried at once first, and those beside bad charts taken back until none is bad. These are
    tried again in rounds of the largest gains, at most one chain a chart. Charts that a step does not touch
    keep the layout they have. Where a chart that no chain helps is bad as soon as it is relaxed, all stays:
    once a round has found nothing chains beside such charts are tried before others, in so few rounds.
    """
    proposal = propose(atlas, rings, pinned)
    work = _Shortening(atlas, proposal, bound, dataclasses.replace(options, give_up=bound), margin)
    left, right, gain = _chain_sides(atlas, proposal, work.start.chart)
    seams = float(atlas.surface.priced_lengths[atlas.cut].sum())
    take = gain > 0
    spoilt = work.attempt(take)
    fragile = bool(spoilt.any())
    while spoilt.any():
        take &= ~spoilt
        spoilt = work.attempt(take)
    work.keep(take)
    open_chains = np.flatnonzero(~take & (gain > WORTH_IT * seams))
    barren = 0
    for _ in range(ROUNDS):
        if len(open_chains) == 0 or (fragile and work.frail(work.beyond_help(open_chains))):
            break
        among = open_chains
        if fragile and barren:
            urgent = work.weak(work.untouched())
            if urgent.any():
                if barren > BARREN:
                    break
                among = open_chains[urgent[left[open_chains]] | urgent[right[open_chains]]]
        pick = matching(gain[among], left[among], right[among], work.start.n_charts)
        chosen = among[pick]
        trial = take.copy()
        trial[chosen] = True
        spoilt = work.attempt(trial)
        take[chosen[~spoilt[chosen]]] = True
        barren = barren + 1 if spoilt[chosen].all() else 0
        open_chains = np.setdiff1d(open_chains, chosen)
        work.keep(take)
    # charts whose parts were pushed apart fall on each other again as soon as they are relaxed: what they
    # gain by shorter seams here is lost where they are cut up on the mesh itself
    if fragile and work.frail(work.untouched()):
        take[:] = False
        work.attempt(take)
    cut_mesh = atlas.cut_mesh()
    return judge(cut_mesh, atlas.gather(cut_mesh))


class _Shortening:
    """Lays the charts out that a choice of chains changes, and remembers those that it has laid out."""

    def __init__(
        self, atlas: Atlas, proposal: Proposal, bound: float, options: RelaxOptions, margin: float
    ) -> None:
        self.atlas, self.proposal = atlas, proposal
        self.bound, self.options, self.margin = bound, options, margin
        n, chart = atlas.charts()
        # what is bad before any seam moves is no fault of a chain
        self.start = LaidOut(atlas.cut.copy(), chart, atlas.corners.copy(), np.zeros(n, bool))
        self.kept = self.last = self.start
        # of charts laid out again as they were: 1 good, −1 bad, 0 not known yet
        self._health = np.zeros(n, np.int64)

    def attempt(self, take: BoolArray) -> BoolArray:
        """Move the chains ``take`` ((k,) bool) alone; (k,) bool: those of them that lie beside bad charts."""
        atlas, edges = self.atlas, self.atlas.surface.edges
        atlas.cut = self.proposal.cut(take)
        n, chart = atlas.charts()
        atlas.corners = self.start.corners.copy()
        bad, known = np.zeros(n, bool), np.zeros(n, bool)
        for state in (self.last, self.kept, self.start):
            same = state.same(atlas.cut, chart, n, edges) & ~known
            faces = same[chart]
            atlas.corners[faces] = state.corners[faces]
            bad[chart[faces]] = state.bad[state.chart[faces]]
            known |= same
        if not known.all():
            bad[~known] = self._laid_out(~known[chart])
        self.last = LaidOut(atlas.cut, chart, atlas.corners, bad)
        return self._beside(bad, take)

    def keep(self, take: BoolArray) -> None:
        """Take over what the last attempt and those before have of these chains."""
        self.attempt(take)
        self.kept = self.last

    def weak(self, which: BoolArray) -> BoolArray:
        """(n,) bool: those of some charts ((n,) bool) that are bad when laid out again as they were."""
        start, asked = self.start, which & (self._health == 0)
        if asked.any():
            faces = asked[start.chart]
            was = Atlas(self.atlas.surface, start.cut, start.corners, self.atlas.prices).part(faces)
            before = (np.cumsum(asked) - 1)[start.chart[faces]]
            bad = lay_out_again(was, before, self.options, self.margin).bad(self.bound)
            self._health[asked] = np.where(bad, -1, 1)
        result: BoolArray = which & (self._health < 0)
        return result

    def frail(self, which: BoolArray) -> bool:
        """Whether some of those charts ((n,) bool) are bad when they are laid out again as they were."""
        return bool(self.weak(which).any())

    def beyond_help(self, chains: IntArray) -> BoolArray:
        """(n,) bool: untouched charts that none of these chains lies beside, on its old path or its new one."""
        proposal, start = self.proposal, self.start
        choice = np.zeros(proposal.n + 1, bool)  # the last entry stands for −1
        choice[chains] = True
        out = self.untouched()
        beside = self.atlas.surface.edges[choice[proposal.old] | choice[proposal.new]] // 3
        out[start.chart[beside]] = False
        return out

    def untouched(self) -> BoolArray:
        """(n,) bool: charts that the last attempt left as they were at first."""
        last, edges = self.last, self.atlas.surface.edges
        same = self.start.same(last.cut, last.chart, last.n_charts, edges)
        out = np.zeros(self.start.n_charts, bool)
        out[self.start.chart[same[last.chart]]] = True
        return out

    def _laid_out(self, faces: BoolArray) -> BoolArray:
        """Lay the charts of those faces out; bool for each of them, in their order: it is bad."""
        part = self.atlas.part(faces)
        _, chart = part.charts()
        bad = not_disks(part.cut_mesh())
        if not bad.all():
            able = ~bad[chart]
            good = part.part(able)
            before = np.unique(self.start.chart[faces][able], return_inverse=True)[1].reshape(-1)
            laid = lay_out_again(good, before, self.options, self.margin)
            bad[~bad] = laid.bad(self.bound)
            part.put(able, good)
        self.atlas.put(faces, part)
        return bad

    def _beside(self, bad: BoolArray, take: BoolArray) -> BoolArray:
        """(k,) chains that were moved and touch a bad chart, on their old path or their new one."""
        left, right = self.last.chart[self.atlas.surface.edges // 3].T
        return self.proposal.beside(bad[left] | bad[right]) & take


def _chain_sides(
    atlas: Atlas, proposal: Proposal, chart: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """The charts on both sides of every chain, and how much shorter its new path is."""
    e = atlas.surface.edges
    on = np.flatnonzero(proposal.old >= 0)
    chain = proposal.old[on]
    left, right = np.zeros(proposal.n, np.int64), np.zeros(proposal.n, np.int64)
    left[chain], right[chain] = chart[e[on, 0] // 3], chart[e[on, 1] // 3]
    old, new = proposal.costs(atlas.surface.priced_lengths)
    return left, right, old - new
