"""Lay charts out anew after their seams have moved, from the layout they had."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.core.graph import matching
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker, in_parts
from circparam.geometry.gradient_transfer import space_gradients, spread, targets_from
from circparam.geometry.overlap import self_overlapping
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.seams.segmentation.grow import DualGraph, make_disks
from circparam.seams.segmentation.shorten import Proposal, propose
from circparam.seams.segmentation.state import main_parts
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.objective import chart_energies
from circparam.solvers.poisson import from_jacobians
from circparam.solvers.tutte.embed import tutte_embedding

UNTANGLE = 12
ROUNDS = 8  # of single chains that are shortened where all at once spoil a chart


@dataclass(frozen=True, eq=False)
class ChartLayouts:
    """A layout of all charts. energy: (n,); overlapping: (n,) bool."""

    cut_mesh: CutMesh
    uv: FloatArray
    energy: FloatArray
    overlapping: BoolArray

    def bad(self, bound: float) -> BoolArray:
        """(n,) charts above the bound, flipped, or overlapping themselves."""
        return ~(self.energy <= bound) | self.overlapping


def lay_out_fresh(
    atlas: Atlas,
    which: BoolArray | None,
    options: RelaxOptions,
    worker: Worker | None = None,
    monitor: Monitor | None = None,
) -> ChartLayouts:
    """Embed charts on circles and relax them; ``which`` ((n,) bool): the others keep their layout.

    worker: does parts of many charts.
    """
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    chosen = np.ones(cut_mesh.n_charts, bool) if which is None else which
    if chosen.any():
        sub, vid, fid = cut_mesh.subset(chosen)
        if worker is None:
            part = embed_and_relax(sub, options, None)
        else:
            part = np.zeros((sub.n_vertices, 2))
            parts = chart_parts(sub)
            tasks = [(part_mesh, options) for _, part_mesh, _, _ in parts]
            done = worker.map(embed_and_relax, tasks, monitor or Monitor())
            for (_, _, of_part, _), result in zip(parts, done, strict=True):
                part[of_part] = result
        uv[vid] = part
        atlas.corners[fid] = part[sub.faces]
    return judge(cut_mesh, uv)


def chart_parts(cut_mesh: CutMesh) -> list[tuple[BoolArray, CutMesh, IntArray, IntArray]]:
    """CutMesh as ``in_parts`` has them: [((n,) charts, cut mesh of those, vertices, faces)]."""
    out = []
    for faces in in_parts(cut_mesh.chart):
        part = np.zeros(cut_mesh.n_charts, bool)
        part[cut_mesh.chart[faces]] = True
        out.append((part, *cut_mesh.subset(part)))
    return out


def embed_and_relax(
    cut_mesh: CutMesh, options: RelaxOptions, monitor: Monitor | None
) -> FloatArray:
    """(nv, 2) mean-value map of every chart onto a circle, relaxed."""
    start, _ = tutte_embedding(cut_mesh, "mean-value")
    return relax(cut_mesh, start, options).uv


def judge(cut_mesh: CutMesh, uv: FloatArray, margin: float = 0.0) -> ChartLayouts:
    """Energies and overlaps of a layout."""
    energy = chart_energies(cut_mesh, uv)
    overlapping = ~np.isfinite(energy)
    fine = ~overlapping
    if fine.any():
        sub, vid, _ = cut_mesh.subset(fine)
        overlapping[fine] = self_overlapping(sub, uv[vid], margin=margin)
    return ChartLayouts(cut_mesh, uv, energy, overlapping)


def lay_out_again(
    atlas: Atlas, before: IntArray, options: RelaxOptions, margin: float = 0.0
) -> ChartLayouts:
    """Lay all charts out from the Jacobians they had. before: (m,) charts for which ``corners`` is the layout.

    Faces that came from another chart take the Jacobian of their nearest neighbour, turned to their plane.
    """
    cut_mesh = atlas.cut_mesh()
    known = main_parts(cut_mesh.chart, before, cut_mesh.areas)
    gradients, _ = spread(atlas, space_gradients(atlas), known)
    uv, fine = from_jacobians(cut_mesh, targets_from(atlas, gradients), UNTANGLE)
    if not fine.all():
        sub, vid, _ = cut_mesh.subset(~fine)
        uv[vid] = tutte_embedding(sub, "mean-value")[0]
    relaxed = relax(cut_mesh, uv, options)
    atlas.scatter(cut_mesh, relaxed.uv)
    return judge(cut_mesh, relaxed.uv, margin)


def shorten_seams(
    atlas: Atlas,
    graph: DualGraph,
    bound: float,
    options: RelaxOptions,
    rings: int = 3,
    pinned: BoolArray | None = None,
    margin: float = 0.0,
) -> ChartLayouts:
    """Shorten the seams as far as every chart stays good; chains that would spoil one keep their old path.

    All chains are tried at once first. Where that spoils a chart, they are tried again in rounds of the largest
    gains, at most one chain a chart, and each stays only if its charts are good.
    """
    options = dataclasses.replace(options, give_up=bound)
    start_cut, start_corners = atlas.cut.copy(), atlas.corners.copy()
    _, before = atlas.charts()
    proposal = propose(atlas, rings, pinned)

    def attempt(take: BoolArray) -> ChartLayouts:
        atlas.cut = proposal.cut(take)
        atlas.corners = start_corners.copy()
        if not_disks(atlas.cut_mesh()).any():
            make_disks(atlas, graph)
        return lay_out_again(atlas, before, options, margin)

    left, right, gain = _chain_sides(atlas, proposal, before)
    take = gain > 0
    layouts = attempt(take)
    if not layouts.bad(bound).any():
        return layouts
    open_chains = np.flatnonzero(gain > 1e-3 * atlas.surface.priced_lengths[start_cut].sum())
    take[:] = False
    n = int(before.max()) + 1
    for _ in range(ROUNDS):
        if len(open_chains) == 0:
            break
        pick = matching(gain[open_chains], left[open_chains], right[open_chains], n)
        chosen = open_chains[pick]
        trial = take.copy()
        trial[chosen] = True
        layouts = attempt(trial)
        spoilt = chains_beside(atlas, proposal, layouts.cut_mesh.chart, layouts.bad(bound), trial)
        take[chosen[~spoilt[chosen]]] = True
        open_chains = np.setdiff1d(open_chains, chosen)
    layouts = attempt(take)
    if not layouts.bad(bound).any():
        return layouts
    atlas.cut, atlas.corners = start_cut, start_corners
    cut_mesh = atlas.cut_mesh()
    return judge(cut_mesh, atlas.gather(cut_mesh))


def _chain_sides(
    atlas: Atlas, proposal: Proposal, chart: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """The charts on both sides of every chain, and how much shorter its new path is."""
    e = atlas.surface.edges
    length = atlas.surface.priced_lengths
    on = np.flatnonzero(proposal.old >= 0)
    chain = proposal.old[on]
    left, right = np.zeros(proposal.n, np.int64), np.zeros(proposal.n, np.int64)
    left[chain], right[chain] = chart[e[on, 0] // 3], chart[e[on, 1] // 3]
    now = np.flatnonzero(proposal.new >= 0)
    gain = group_sum(length[on], chain, proposal.n) - group_sum(
        length[now], proposal.new[now], proposal.n
    )
    return left, right, gain


def chains_beside(
    atlas: Atlas, proposal: Proposal, chart: IntArray, bad: BoolArray, take: BoolArray
) -> BoolArray:
    """(n,) chains that were moved and touch a bad chart, on their old path or their new one."""
    e = atlas.surface.edges
    touches = bad[chart[e[:, 0] // 3]] | bad[chart[e[:, 1] // 3]]
    out = np.zeros(proposal.n + 1, bool)
    out[proposal.new[touches]] = True
    out[proposal.old[touches]] = True
    result: BoolArray = out[:-1] & take
    return result
