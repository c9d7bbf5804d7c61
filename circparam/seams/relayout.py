"""Lay charts out anew after their seams have moved, from the layout they had."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.arrays import BoolArray, FloatArray, IntArray, first_of_runs, group_sum
from circparam.injectivity import self_overlapping
from circparam.mesh import Patches
from circparam.solve.convex import embed_convex
from circparam.seams.cutting import Cutting, not_disks
from circparam.seams.segment import DualGraph, make_disks
from circparam.seams.shorten import Proposal, propose, space_gradients, spread, targets_from
from circparam.solve.newton import RelaxOptions, relax
from circparam.solve.poisson import from_jacobians

UNTANGLE = 12


@dataclass(frozen=True, eq=False)
class Laid:
    """A layout of all charts. energy: (n,); overlapping: (n,) bool."""

    patches: Patches
    uv: FloatArray
    energy: FloatArray
    overlapping: BoolArray

    def bad(self, bound: float) -> BoolArray:
        """(n,) charts above the bound, flipped, or overlapping themselves."""
        return ~(self.energy <= bound) | self.overlapping


def lay_out_fresh(cutting: Cutting, which: BoolArray | None, options: RelaxOptions) -> Laid:
    """Embed charts on circles and relax them; ``which`` ((n,) bool): the others keep their layout."""
    patches = cutting.patches()
    uv = cutting.gather(patches)
    chosen = np.ones(patches.n_charts, bool) if which is None else which
    if chosen.any():
        sub, vid, fid = patches.subset(chosen)
        start, _ = embed_convex(sub, "mean-value")
        relaxed = relax(sub, start, options)
        uv[vid] = relaxed.uv
        cutting.corners[fid] = relaxed.uv[sub.faces]
    return judge(patches, uv)


def judge(patches: Patches, uv: FloatArray, margin: float = 0.0) -> Laid:
    """Energies and overlaps of a layout."""
    energy = relax(patches, uv, RelaxOptions(max_iterations=0)).energy
    overlapping = ~np.isfinite(energy)
    fine = ~overlapping
    if fine.any():
        sub, vid, _ = patches.subset(fine)
        overlapping[fine] = self_overlapping(sub, uv[vid], margin=margin)
    return Laid(patches, uv, energy, overlapping)


def main_parts(chart: IntArray, before: IntArray, areas: FloatArray) -> BoolArray:
    """(m,) bool: the face was in that earlier chart from which its chart has most of its area."""
    width = int(before.max()) + 1
    pairs, inverse = np.unique(chart * width + before, return_inverse=True)
    inverse = inverse.reshape(-1)
    area = group_sum(areas, inverse, len(pairs))
    now = pairs // width
    order = np.lexsort((-area, now))
    main = np.zeros(len(pairs), bool)
    main[order[first_of_runs(now[order])]] = True
    result: BoolArray = main[inverse]
    return result


def lay_out_again(cutting: Cutting, before: IntArray, options: RelaxOptions) -> Laid:
    """Lay all charts out from the Jacobians they had. before: (m,) charts for which ``corners`` is the layout.

    Faces that came from another chart take the Jacobian of their nearest neighbour, turned to their plane.
    """
    patches = cutting.patches()
    known = main_parts(patches.chart, before, patches.areas)
    gradients, _ = spread(cutting, space_gradients(cutting), known)
    uv, fine = from_jacobians(patches, targets_from(cutting, gradients), UNTANGLE)
    if not fine.all():
        sub, vid, _ = patches.subset(~fine)
        uv[vid] = embed_convex(sub, "mean-value")[0]
    relaxed = relax(patches, uv, options)
    cutting.scatter(patches, relaxed.uv)
    return judge(patches, relaxed.uv)


def straighten(
    cutting: Cutting,
    graph: DualGraph,
    bound: float,
    options: RelaxOptions,
    rings: int = 3,
    pinned: BoolArray | None = None,
) -> Laid:
    """Shorten the seams where the charts beside them stay good; the others keep the seams they had.

    A chart may end worse than it began only below the bound. Never leaves a chart worse off than that: in the
    end nothing moves.
    """
    start_cut, start_corners = cutting.cut.copy(), cutting.corners.copy()
    _, before = cutting.charts()
    proposal = propose(cutting, rings, pinned)
    take = np.ones(proposal.n, bool)
    for _ in range(6):
        cutting.cut = proposal.cut(take)
        cutting.corners = start_corners.copy()
        if bool(not_disks(cutting.patches()).any()):
            make_disks(cutting, graph)
        laid = lay_out_again(cutting, before, options)
        bad = laid.bad(bound)
        if not bad.any():
            return laid
        blamed = _chains_beside(cutting, proposal, laid.patches.chart, bad, take)
        if not blamed.any():
            break
        take &= ~blamed
    cutting.cut, cutting.corners = start_cut, start_corners
    patches = cutting.patches()
    return judge(patches, cutting.gather(patches))


def _chains_beside(
    cutting: Cutting, proposal: Proposal, chart: IntArray, bad: BoolArray, take: BoolArray
) -> BoolArray:
    """(n,) chains that were moved and touch a bad chart, on their old path or their new one."""
    e = cutting.surface.edges
    touches = bad[chart[e[:, 0] // 3]] | bad[chart[e[:, 1] // 3]]
    out = np.zeros(proposal.n + 1, bool)
    out[proposal.new[touches]] = True
    out[proposal.old[touches]] = True
    result: BoolArray = out[:-1] & take
    return result
