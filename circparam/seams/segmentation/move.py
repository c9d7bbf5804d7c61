"""Move seams to where they cost less: pieces of every chain, a few edges long, one small step after another."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, first_of_runs, group_sum
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.workers import Worker
from circparam.geometry.distortion import face_stretch
from circparam.geometry.gradient_transfer import space_gradients, spread, targets_from
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.evaluate import Demands, Moves, try_moves
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.shorten import Proposal, propose
from circparam.seams.segmentation.state import LaidOut, main_parts

RINGS, PIECE_EDGES = 3, 20  # of the band round a piece that moves, and how long a piece is
STEPS = 3  # each with other ends of the pieces
TRIES = 6  # of one step


@dataclass(frozen=True, eq=False)
class _Trial:
    """The atlas with some pieces moved. bad: (n,) charts of it that are not as good as they must be. stretch:
    (m,) of each face, 1 where nothing was laid out."""

    atlas: Atlas
    chart: IntArray
    bad: BoolArray
    stretch: FloatArray


def move_seams(atlas: Atlas, demands: Demands, monitor: Monitor) -> None:
    """Move pieces of seams to cheaper places, as far as every chart stays a good one.

    The number of charts stays, and no piece moves whose charts would not meet the demands.
    """
    for step in range(STEPS):
        if monitor.expired:
            return
        first = step * PIECE_EDGES // STEPS
        proposal = propose(atlas, RINGS, pieces=(PIECE_EDGES, first))
        old, new = proposal.costs(edge_costs(atlas))
        best = _most_moved(atlas, proposal, new < old, demands, monitor)
        if best is not None:
            atlas.cut, atlas.corners = best.cut, best.corners


def _most_moved(
    atlas: Atlas,
    proposal: Proposal,
    wanted: BoolArray,
    demands: Demands,
    monitor: Monitor,
) -> Atlas | None:
    """The atlas with as many of the pieces moved as a few trials find; None where that is none.

    Pieces beside a chart that got bad are halved: those beside faces that are stretched least are tried at
    once, the others later.
    """
    best, taken, queue = None, np.zeros_like(wanted), [wanted]
    seen: list[_Trial] = []
    for _ in range(TRIES):
        while queue and not queue[-1].any():
            queue.pop()
        if not queue:
            break
        group = queue.pop()
        trial = _moved(atlas, proposal, taken | group, demands, monitor, seen)
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
    demands: Demands,
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
        _lay_out(trial, touched, before, demands, monitor)
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
    demands: Demands,
    monitor: Monitor,
) -> None:
    """Lay some charts ((n,) bool) of a trial out and say which are bad. before: (m,) charts they had.

    Faces that came from another chart take the Jacobian of their nearest neighbour, turned to their plane.
    """
    faces, number = which[trial.chart], np.flatnonzero(which)
    part = trial.atlas.part(faces)
    cut_mesh = part.cut_mesh()
    known = main_parts(cut_mesh.chart, before[faces], cut_mesh.areas)
    gradients, _ = spread(part, space_gradients(part), known)
    moves = Moves(cut_mesh, part.corners, ~known, targets_from(part, gradients))
    tried = try_moves(moves, demands, Worker(1), monitor)
    part.scatter(cut_mesh, tried.uv)
    trial.atlas.put(faces, part)
    trial.bad[number[~tried.good(demands.bound)]] = True
    trial.stretch[faces] = face_stretch(cut_mesh, tried.uv)
