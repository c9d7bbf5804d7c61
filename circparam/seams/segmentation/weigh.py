"""Weights in the energy on the few faces that a layout stretches or shrinks too much."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import group_count, group_sum, mask_of
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray
from circparam.core.workers import in_processes
from circparam.geometry.closest import centres, within
from circparam.geometry.distortion import face_stretch, stretch_and_distortion
from circparam.geometry.overlap import self_overlapping
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.accuracy import AIMED, FINAL
from circparam.seams.segmentation.layout import chart_parts, pushed_apart
from circparam.solvers.newton import relax
from circparam.solvers.region import cut_out

TAIL_SHARE = 1e-3  # share of the surface on which the stretch may be larger
ROUNDS = 8  # of weighing, most charts need three; and of splits
PATIENCE = 3  # rounds without headway after which a chart is left
STEP = replace(FINAL, max_iterations=2)
MOVED_REACH = 0.5  # share of the root of a chart's area that moves round such faces at first


@dataclass(frozen=True)
class Limits:
    """bound: distortion that no chart below it comes above. most: stretch that only the share ``allowed`` of
    the surface may exceed. near: share of the root of a chart's area that moves round such faces at first.
    local: iterations of a step, where what moves is only a few rings wide, and charts too large for a round too
    many (None: charts move as a whole as long as they do not lie on themselves then). cuts_off: parts that
    weights do not mend are cut off, and charts are split only if a user asked. asked: whether a user asked for
    this stretch; then seams are added whatever they cost.
    """

    bound: float
    most: float
    allowed: float = AIMED * TAIL_SHARE
    near: float = MOVED_REACH
    local: int | None = None
    cuts_off: bool = False
    asked: bool = False

    @property
    def enough(self) -> float:
        """The share from which on no seam is added: of a surface whose level was held all that may be."""
        return self.allowed if self.local is None else self.allowed / AIMED

    def without(self, over: float, whole: CutMesh, part: CutMesh) -> "Limits":
        """For a part of the surface, where the other parts use so much of the share."""
        left = max(self.allowed - over, 0.0)
        return replace(self, allowed=left * float(whole.areas.sum() / part.areas.sum()))


def with_tails(over: FloatArray, limits: Limits) -> BoolArray:
    """(n,) bool: charts with most of the tail; the others keep theirs, which is half of what is allowed."""
    order = np.argsort(over, kind="stable")
    return ~mask_of(len(over), order[np.cumsum(over[order]) <= limits.allowed / 2])


def share_over(cut_mesh: CutMesh, stretch: FloatArray, most: float) -> FloatArray:
    """(n,) area of each chart that is stretched more than ``most`` times, over that of the surface."""
    area = group_sum(cut_mesh.areas * (stretch > most), cut_mesh.chart, cut_mesh.n_charts)
    return area / cut_mesh.areas.sum()


def relax_weighted(
    cut_mesh: CutMesh, uv: FloatArray, limits: Limits, monitor: Monitor
) -> tuple[FloatArray, BoolArray]:
    """Relax charts with more weight, round by round, on faces that are stretched or shrunk about too much.

    Returns ((nv, 2) the best layout of each chart: neither folded, overlapping nor above the bound (or what it
    was before, where that is higher); (n,) bool: charts that got better).
    """
    chart, most = cut_mesh.chart, limits.most
    stretch, distortion = stretch_and_distortion(cut_mesh, uv)
    limit = np.maximum(distortion, limits.bound)
    start = share_over(cut_mesh, stretch, most)
    best, folded = _Best(uv, start), _Best(uv, start)
    at, weight = uv, np.ones(len(chart))
    idle = np.where(start > 0, 0, PATIENCE)
    whole, last = np.full(cut_mesh.n_charts, limits.local is None), np.inf
    for turn in range(ROUNDS):
        active = idle < PATIENCE
        over = best.over if limits.local is None else np.minimum(best.over, folded.over)
        missing = over.sum() - limits.allowed
        if not active.any() or missing <= 0 or monitor.expired:
            break
        slow = turn > PATIENCE and (last - missing) * (ROUNDS - turn) < missing
        if limits.local is not None and slow:  # what the others do not reach is cut off
            break
        last, before = missing, distortion
        heavier = weight * np.maximum(stretch / (1 + AIMED * (most - 1)), 1.0) ** 2
        weight = np.where(active[chart], heavier, weight)
        near = limits.near * (1 + turn / 2) * np.sqrt(cut_mesh.chart_areas)
        reach = np.where(active, np.where(whole, np.inf, near), 0.0)
        at = _relaxed_beside(cut_mesh, at, weight, reach, limits.local, monitor)
        stretch, distortion = stretch_and_distortion(cut_mesh, at)
        over = share_over(cut_mesh, stretch, most)
        good = active & (over < best.over) & (distortion <= limit)
        coiled = good & _overlapping(cut_mesh, at, good)
        best = best.taken(cut_mesh, at, over, good & ~coiled)
        # what lies on itself when it moves as a whole is tried again near those faces alone
        again = coiled & whole
        nearer = good & ~again & (over < folded.over)
        folded = folded.taken(cut_mesh, at, over, nearer)
        headway = (good & ~coiled) | again
        if limits.local is not None:  # what a chart lies on is pushed apart at the end
            headway |= nearer
        idle = np.where(headway, 0, idle + 1)
        if limits.local is not None:  # more weight would raise it further
            idle[distortion > np.maximum(limit, before)] = PATIENCE
        idle[best.over == 0] = PATIENCE
        if again.any():
            at = np.where(again[cut_mesh.vertex_chart][:, None], best.uv, at)
            stretch = np.where(again[chart], face_stretch(cut_mesh, best.uv), stretch)
            weight = np.where(again[chart], 1.0, weight)
            whole &= ~again
    if best.over.sum() > limits.allowed:
        best = _pushed_apart(cut_mesh, best, folded, limits, monitor)
    return best.uv, best.over < start


@dataclass(frozen=True, eq=False)
class _Best:
    """The best layout of each chart so far: uv (nv, 2), over (n,) as ``share_over`` has it."""

    uv: FloatArray
    over: FloatArray

    def taken(
        self, cut_mesh: CutMesh, uv: FloatArray, over: FloatArray, better: BoolArray
    ) -> "_Best":
        """With another layout of some charts ((n,) bool)."""
        keep = better[cut_mesh.vertex_chart][:, None]
        return _Best(np.where(keep, uv, self.uv), np.where(better, over, self.over))


def _pushed_apart(
    cut_mesh: CutMesh, best: _Best, folded: _Best, limits: Limits, monitor: Monitor
) -> _Best:
    """The best layouts, with those that lie on themselves where these can be pushed apart and are better."""
    coiled = folded.over < best.over
    if not coiled.any():
        return best
    sub, vid, _ = cut_mesh.subset(coiled)
    at = folded.uv.copy()
    at[vid], apart = pushed_apart(sub, at[vid], limits.bound, monitor)
    over = share_over(cut_mesh, face_stretch(cut_mesh, at), limits.most)
    coiled[coiled] = apart
    return best.taken(cut_mesh, at, over, coiled & (over < best.over))


def _overlapping(cut_mesh: CutMesh, uv: FloatArray, which: BoolArray) -> BoolArray:
    """(n,) bool: the chart is one of those asked for and overlaps itself."""
    out = which.copy()
    if which.any():
        sub, vid, _ = cut_mesh.subset(which)
        out[which] = self_overlapping(sub, uv[vid])
    return out


def _relaxed_beside(
    cut_mesh: CutMesh,
    uv: FloatArray,
    weight: FloatArray,
    reach: FloatArray,
    local: int | None,
    monitor: Monitor,
) -> FloatArray:
    """As ``relaxed_near``; charts that nothing moves are left out, the others are shared out in parts."""
    sub, vid, fid = cut_mesh.subset(reach > 0)
    tasks = []
    parts = chart_parts(sub)
    for of_part, part, v, f in parts:
        tasks.append((part, uv[vid[v]], weight[fid[f]], reach[reach > 0][of_part], local))
    out = uv.copy()
    done = in_processes(relaxed_near, tasks, monitor)
    for (_, _, v, _), moved in zip(parts, done, strict=True):
        out[vid[v]] = moved
    return out


def relaxed_near(
    cut_mesh: CutMesh,
    uv: FloatArray,
    weight: FloatArray,
    reach: FloatArray,
    local: int | None,
    monitor: Monitor,
) -> FloatArray:
    """Relax the faces within reach ((n,) by charts) of those that weigh more than 1; the rest stays.

    local: as ``RelaxOptions`` has it. monitor: not asked, since two steps are soon done.
    """
    heavy = (weight > 1) & (reach > 0)[cut_mesh.chart]
    if not heavy.any():
        return uv
    middle = centres(uv, cut_mesh.faces)
    places = middle[heavy], cut_mesh.chart[heavy]
    region = within((middle, cut_mesh.chart), places, reach)
    hold = np.zeros(len(uv), bool)
    # one vertex of a chart that moves as a whole
    whole = group_count(cut_mesh.chart[~region], cut_mesh.n_charts) == 0
    first = np.unique(cut_mesh.chart, return_index=True)[1][whole]
    hold[cut_mesh.faces[first, 0]] = True
    still = hold.copy()
    still[cut_mesh.faces[~region]] = True
    region &= ~still[cut_mesh.faces].all(1)
    part, source, fixed = cut_out(cut_mesh, region, hold)
    if len(part.faces) == 0:
        return uv
    heavier = weight[region]
    mean = group_sum(part.areas * heavier, part.chart, part.n_charts) / part.chart_areas
    options = replace(STEP, fixed=fixed, weight=heavier / mean[part.chart], local=local)
    out = uv.copy()
    out[source[~fixed]] = relax(part, uv[source], options).uv[~fixed]
    return out
