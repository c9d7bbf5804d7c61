"""Move seams to where they cost less: pieces of every chain, a few edges long, one small step after another."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, first_of_runs, group_sum
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.layout import lay_out_again
from circparam.seams.segmentation.shorten import Proposal, propose
from circparam.seams.segmentation.state import LaidOut
from circparam.solvers.newton import RelaxOptions
from circparam.solvers.separate import push_apart

# rings of the bands, edges of a piece, and where the first piece of a chain ends: each step has other ends
STEPS = ((3, 20, 0), (3, 20, 10), (2, 12, 6))
TRIES = 6  # of one step
LEAST = 1e-3  # of what a piece costs: it stays where no more than that is won
ENOUGH = 0.8  # of the excess of the bound over 1: charts are not relaxed further for a trial
RELAX = RelaxOptions(tolerance=1e-3, max_iterations=8)


@dataclass(frozen=True, eq=False)
class _Trial:
    """The atlas with some pieces moved. bad: (n,) charts of it that are not as good as they must be. stretch:
    (m,) of each face, 1 where nothing was laid out."""

    atlas: Atlas
    chart: IntArray
    bad: BoolArray
    stretch: FloatArray


def move_seams(atlas: Atlas, bound: float, margin: float, monitor: Monitor) -> None:
    """Move pieces of seams to cheaper places, as far as every chart stays a good one.

    The number of charts stays, and no piece moves that would bring its charts above the bound, let them overlap
    themselves or come closer to that than ``margin`` (share of the root of a chart's area).
    """
    for rings, size, first in STEPS:
        if monitor.expired:
            return
        proposal = propose(atlas, rings, pieces=(size, first))
        old, new = proposal.costs(edge_costs(atlas))
        best = _most_moved(atlas, proposal, old - new > LEAST * old, (bound, margin), monitor)
        if best is not None:
            atlas.cut, atlas.corners = best.cut, best.corners


def _most_moved(
    atlas: Atlas,
    proposal: Proposal,
    wanted: BoolArray,
    limits: tuple[float, float],
    monitor: Monitor,
) -> Atlas | None:
    """The atlas with as many of the pieces moved as a few trials find; None where that is none.

    Pieces beside a chart that got bad are halved: those beside faces that are stretched least are tried at
    once, the others later. limits: the bound and the margin.
    """
    best, taken, queue = None, np.zeros_like(wanted), [wanted]
    seen: list[_Trial] = []
    for _ in range(TRIES):
        while queue and not queue[-1].any():
            queue.pop()
        if not queue:
            break
        group = queue.pop()
        trial = _moved(atlas, proposal, taken | group, limits, monitor, seen)
        if not trial.bad.any():
            best, taken = trial.atlas, taken | group
            continue
        left, right = trial.chart[trial.atlas.surface.edges // 3].T
        side = trial.bad[left] | trial.bad[right]
        beside = proposal.beside(side) & group
        suspect = _upper_half(_stretch_along(proposal, trial), beside)
        if beside.sum() > 1:
            queue.append(suspect)
        if (group & ~suspect).any():
            queue.append(group & ~suspect)
    return best


def _stretch_along(proposal: Proposal, trial: _Trial) -> FloatArray:
    """(n,) mean stretch of the faces beside each piece, along its old path and its new one."""
    e = trial.atlas.surface.edges // 3
    here = trial.stretch[e].sum(1)
    total, count = np.zeros(proposal.n), np.zeros(proposal.n)
    for path in (proposal.old, proposal.new):
        on = np.flatnonzero(path >= 0)
        total += group_sum(here[on], path[on], proposal.n)
        count += np.bincount(path[on], minlength=proposal.n)
    result: FloatArray = total / np.maximum(count, 1)
    return result


def _upper_half(rank: FloatArray, which: BoolArray) -> BoolArray:
    """(n,) bool: of those, the half that ranks highest, at least one."""
    number = np.flatnonzero(which)
    order = number[np.argsort(-rank[number], kind="stable")]
    out = np.zeros(len(which), bool)
    out[order[: (len(order) + 1) // 2]] = True
    return out


def _torn(chart: IntArray, before: IntArray) -> BoolArray:
    """(n,) bool: the chart is a smaller part of what was one chart before."""
    width = int(before.max()) + 1
    pairs, size = np.unique(chart * width + before, return_counts=True)
    now, was = np.divmod(pairs, width)
    order = np.lexsort((-size, now))
    main = order[first_of_runs(now[order])]  # what most of each chart was
    order = main[np.lexsort((-size[main], was[main]))]
    bad = np.ones(int(chart.max()) + 1, bool)
    bad[now[order[first_of_runs(was[order])]]] = False
    return bad


def _moved(
    atlas: Atlas,
    proposal: Proposal,
    take: BoolArray,
    limits: tuple[float, float],
    monitor: Monitor,
    seen: list[_Trial],
) -> _Trial:
    """Lay out the charts whose seams move; the others keep their layout.

    seen: earlier trials; a chart that one of them has laid out is as it was there. This one is added.
    """
    _, before = atlas.charts()
    moved = Atlas(atlas.surface, proposal.cut(take), atlas.corners, atlas.prices)
    n, chart = moved.charts()
    trial = _Trial(moved, chart, _torn(chart, before), np.ones(len(chart)))
    touched = np.zeros(n, bool)
    touched[chart[atlas.surface.edges[moved.cut != atlas.cut] // 3]] = True
    number = np.flatnonzero(touched)
    trial.bad[number[not_disks(moved.part(touched[chart]).cut_mesh())]] = True
    if trial.bad.any():  # no need to lay anything out
        return trial
    touched &= ~_known(trial, touched, seen)
    if touched.any():
        _lay_out(trial, touched, before, limits, monitor)
    seen.append(trial)
    return trial


def _known(trial: _Trial, touched: BoolArray, seen: list[_Trial]) -> BoolArray:
    """(n,) bool: touched charts of a trial that earlier ones have laid out; it takes over what they know."""
    out = np.zeros_like(touched)
    for one in reversed(seen):
        laid = LaidOut(one.atlas.cut, one.chart, one.atlas.corners, one.bad)
        edges = trial.atlas.surface.edges
        same = laid.same(trial.atlas.cut, trial.chart, len(touched), edges) & touched & ~out
        faces = same[trial.chart]
        trial.atlas.corners[faces] = one.atlas.corners[faces]
        trial.stretch[faces] = one.stretch[faces]
        trial.bad[trial.chart[faces]] = one.bad[one.chart[faces]]
        out |= same
    return out


def _lay_out(
    trial: _Trial,
    which: BoolArray,
    before: IntArray,
    limits: tuple[float, float],
    monitor: Monitor,
) -> None:
    """Lay some charts ((n,) bool) of a trial out and say which are bad. before: (m,) charts they had."""
    bound, margin = limits
    faces, number = which[trial.chart], np.flatnonzero(which)
    part = trial.atlas.part(faces)
    enough = replace(RELAX, bound=1 + ENOUGH * (bound - 1), give_up=bound)
    layouts = lay_out_again(part, before[faces], enough, margin)
    wrong = layouts.bad(bound)
    near = layouts.overlapping & (layouts.energy <= bound)
    if near.any():
        sub, vid, fid = layouts.cut_mesh.subset(near)
        pushed, fine = push_apart(sub, layouts.uv[vid], margin, bound, monitor)
        kept = fine[sub.chart]
        part.corners[fid[kept]] = pushed[sub.faces[kept]]
        wrong[np.flatnonzero(near)[fine]] = False
    trial.atlas.put(faces, part)
    trial.bad[number[wrong]] = True
    trial.stretch[faces] = face_stretch(layouts.cut_mesh, layouts.uv)
