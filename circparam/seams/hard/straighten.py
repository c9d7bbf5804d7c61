"""Move seams of a finished atlas to cheaper paths: what changes sides is laid beside its new neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    group_min,
    group_sum,
    sorted_distinct,
)
from circparam.core.graph import components
from circparam.core.monitor import Monitor
from circparam.geometry.distortion import face_stretch
from circparam.geometry.gradient_transfer import targets_beside
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.seams.segmentation.layout import ChartLayouts, judge
from circparam.seams.segmentation.shorten import propose
from circparam.seams.segmentation.weigh import Limits, share_over
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.poisson import from_jacobians

RINGS = 2  # edges that a seam moves at most
EASED, MET = 3.0, 0.98  # of the excess of the bound over 1: what is relaxed, and how far
EASE = RelaxOptions(tolerance=1e-4, max_iterations=12)
TRIES = 8  # rounds of moves; from the second on at most one beside a chart
UNTANGLE = 4  # rounds of laying faces that moved beside their neighbours
WORK, FREE = 1.5, 10_000  # faces of all tries: times those of the surface, and so many more
BACK = 3  # times that moves beside charts that they spoil are taken back
MOVES = 8  # times that single faces are handed over
AGAIN = 1e-3  # of the cost of all seams: what a move must gain to be tried a second time
WORTH = 0.01  # of the dearest edge of a face, below which it stays


def straighten(atlas: Atlas, limits: Limits, monitor: Monitor) -> None:
    """Move seams to cheaper paths near them, as the prices of the atlas say. Deterministic.

    Nothing is relaxed: faces between the old path and the new one are laid out beside their new neighbours, as
    they were bent before. A move stays where its charts are disks below the bound that do not overlap, and
    the share of the surface that is stretched too much stays within what is allowed. Charts are neither lost
    nor made.
    """
    if not atlas.cut.any() or monitor.expired:
        return
    cut, unit, gain = _flats_in_one(atlas)
    _adopt(atlas, cut, unit, gain, limits, monitor)
    proposal = propose(atlas, RINGS)
    old, new = proposal.costs(atlas.lengths)
    gain = old - new
    chain = np.maximum(proposal.old, proposal.new)
    _adopt(atlas, proposal.cut(gain > 0), chain, gain, limits, monitor)
    cut = _handed_over(atlas)
    changed = np.flatnonzero(atlas.cut != cut)
    if len(changed) == 0:
        return
    node = np.unique(np.stack(atlas.ends)[:, changed], return_inverse=True)[1].reshape(2, -1)
    count, of_node = components(int(node.max()) + 1, node[0], node[1])
    unit = np.full(len(cut), -1)
    unit[changed] = of_node[node[0]]
    gain = np.where(cut[changed], -1, 1) * atlas.lengths[changed]
    _adopt(atlas, cut, unit, group_sum(gain, unit[changed], count), limits, monitor)


def _adopt(
    atlas: Atlas,
    cut: BoolArray,
    unit: IntArray,
    gain: FloatArray,
    limits: Limits,
    monitor: Monitor,
) -> None:
    """Take new seams over where the charts beside them stay good.

    unit: (e,) edges of one number move together or stay. gain: (units,) what that is worth. All are tried at
    once; those beside charts that are spoilt are tried again, the best ones first, at most one beside a chart.
    """
    changed = np.flatnonzero(atlas.cut != cut)
    unit = unit[changed]
    total = atlas.lengths[atlas.cut].sum()
    faces = atlas.surface.edges[changed] // 3
    sides = atlas.charts()[1][faces]
    left = np.unique(unit)
    work = WORK * len(atlas.corners) + FREE
    for turn in range(TRIES):
        if len(left) == 0 or work < 0 or monitor.expired:
            break
        pick = left
        if turn:
            here = np.isin(unit, left)
            pick = _one_a_chart(unit[here], sides[here], gain)
        moving = np.isin(unit, pick)
        good, size = _tried(atlas, changed[moving], unit[moving], limits)
        work -= size
        left = np.setdiff1d(left, pick if turn else good)
        left = left[gain[left] > AGAIN * total]


def _tried(atlas: Atlas, changed: IntArray, unit: IntArray, limits: Limits) -> tuple[IntArray, int]:
    """Move units on the charts that they touch alone. changed: their edges.

    Returns (those that were moved, the number of faces of those charts).
    """
    n, chart = atlas.charts()
    touched = np.zeros(n, bool)
    touched[chart[atlas.surface.edges[changed] // 3]] = True
    here = touched[chart]
    part = atlas.part(here)
    inside = np.cumsum(here[atlas.surface.edges // 3].all(1)) - 1
    before, uv = atlas.open()
    far = before.areas * (face_stretch(before, uv) > limits.most)
    total = before.areas.sum()
    most = max(far.sum(), limits.allowed * total) - far[~here].sum()
    limits = replace(limits, allowed=float(most / before.areas[here].sum()))
    moved = _attempt(part, inside[changed], unit, np.unique(unit), limits)
    if len(moved):
        atlas.put(here, part)
    return moved, len(part.corners)


def _one_a_chart(unit: IntArray, sides: IntArray, gain: FloatArray) -> IntArray:
    """Units no two of which lie beside one chart, the best first. sides: (k, 2) charts of their edges."""
    order = np.lexsort((np.arange(len(gain)), -gain))
    rank = np.empty(len(gain), np.int64)
    rank[order] = np.arange(len(gain))
    least = group_min(np.repeat(rank[unit], 2), sides.ravel(), int(sides.max()) + 1)
    behind = (least[sides] < rank[unit][:, None]).any(1)
    return np.setdiff1d(unit, unit[behind])


def _attempt(
    atlas: Atlas, changed: IntArray, unit: IntArray, pick: IntArray, limits: Limits
) -> IntArray:
    """Move some units (``pick``) and take those back that spoil a chart; returns those that were moved."""
    cut, corners = atlas.cut, atlas.corners
    _, chart = atlas.charts()
    for _ in range(BACK):
        on = np.isin(unit, pick)
        atlas.cut, atlas.corners = cut.copy(), corners.copy()
        atlas.cut[changed[on]] ^= True
        bad = _laid_again(atlas, cut, chart, limits)
        if not bad.any():
            return pick
        touches = bad[atlas.surface.edges[changed[on]] // 3].any(1)
        # on either side, as charts were before too
        spoilt = np.isin(chart[atlas.surface.edges[changed[on]] // 3], np.unique(chart[bad])).any(1)
        pick = np.setdiff1d(pick, unit[on][touches | spoilt])
        if len(pick) == 0:
            break
    atlas.cut, atlas.corners = cut, corners
    return pick[:0]


def _laid_again(atlas: Atlas, old_cut: BoolArray, chart: IntArray, limits: Limits) -> BoolArray:
    """Lay out what moved; (m,) bool, faces of charts that are no good then. chart: (m,) as they were."""
    surface = atlas.surface
    moved = _moved(atlas, old_cut, chart)
    cut_mesh = atlas.cut_mesh()
    bad = _torn(cut_mesh, chart, moved)
    if bad.any():
        return bad[cut_mesh.chart]
    which = np.zeros(cut_mesh.n_charts, bool)
    which[cut_mesh.chart[surface.edges[atlas.cut != old_cut] // 3].ravel()] = True
    sub, _, fid = cut_mesh.subset(which)
    stays = np.zeros(sub.n_vertices, bool)
    stays[sub.faces[~moved[fid]].ravel()] = True
    uv = np.zeros((sub.n_vertices, 2))
    uv[sub.faces[~moved[fid]].ravel()] = atlas.corners[fid[~moved[fid]]].reshape(-1, 2)
    held = np.flatnonzero(stays)
    if len(held) < len(stays):
        targets = targets_beside(atlas, moved)[:, :, fid]
        uv, _ = from_jacobians(sub, targets, UNTANGLE, held=(held, uv[held]))
    uv, energies = _eased(sub, uv, limits.bound, atlas)
    atlas.corners[fid] = uv[sub.faces]
    bad[which] = energies.bad(limits.bound)
    if not bad.any():
        _, whole = atlas.open()
        stretch = face_stretch(cut_mesh, whole)
        if share_over(cut_mesh, stretch, limits.most).sum() > limits.allowed:
            far = which[cut_mesh.chart] & (stretch > limits.most)
            # where it is none of what moved, it is what was eased beside it
            bad[cut_mesh.chart[far & moved if (far & moved).any() else far]] = True
    return bad[cut_mesh.chart]


def _eased(
    cut_mesh: CutMesh, uv: FloatArray, bound: float, atlas: Atlas
) -> tuple[FloatArray, ChartLayouts]:
    """Relax charts that miss the bound by little until they meet it; those of hard surfaces stay."""
    layouts = judge(cut_mesh, uv)
    near = ~(layouts.energy <= bound) & (layouts.energy <= 1 + EASED * (bound - 1))
    near &= ~layouts.overlapping
    if atlas.prices is None or atlas.prices.sharp.any() or not near.any():
        return uv, layouts
    sub, vid, _ = cut_mesh.subset(near)
    uv[vid] = relax(sub, uv[vid], replace(EASE, bound=1 + MET * (bound - 1))).uv
    return uv, judge(cut_mesh, uv)


def _moved(atlas: Atlas, old_cut: BoolArray, chart: IntArray) -> BoolArray:
    """(m,) bool: faces between old and new paths. Of every chart the largest piece left by both stays."""
    surface = atlas.surface
    n, piece = surface.charts(atlas.cut | old_cut)
    area = group_sum(surface.areas, piece, n)
    of = np.zeros(n, np.int64)
    of[piece] = chart
    order = np.lexsort((np.arange(n), -area, of))
    stays = np.zeros(n, bool)
    stays[order[first_of_runs(of[order])]] = True
    result: BoolArray = ~stays[piece]
    return result


def _torn(cut_mesh: CutMesh, chart: IntArray, moved: BoolArray) -> BoolArray:
    """(n,) bool: charts that are no disks, or do not hold what stayed of just one former chart."""
    bad = not_disks(cut_mesh)
    n = int(chart.max()) + 1
    now, was = np.divmod(sorted_distinct(cut_mesh.chart[~moved] * n + chart[~moved]), n)
    bad |= np.bincount(now, minlength=cut_mesh.n_charts) != 1
    bad[now[np.bincount(was, minlength=n)[was] > 1]] = True
    return bad


def _flats_in_one(atlas: Atlas) -> tuple[BoolArray, IntArray, FloatArray]:
    """((e,) seams when each flat is in the chart that has most of it, (e,) flat beside, (flats,) gain of that).

    Only flats that gain by it change: a seam round part of one is longer than the one across it was.
    """
    surface, flat = atlas.surface, atlas.flat
    m, fi, fj = len(surface.faces), surface.edges[:, 0] // 3, surface.edges[:, 1] // 3
    if flat is None or not (atlas.cut & flat).any():
        return atlas.cut, np.zeros(len(atlas.cut), np.int64), np.zeros(1)
    n, label = components(m, fi[flat], fj[flat])
    _, chart = atlas.charts()
    most = _main_of(label, chart, surface.areas)[label]
    moved = most != chart
    after = np.where(moved[fi] | moved[fj], most[fi] != most[fj], atlas.cut)
    # an edge beside two flats that change is counted for both: that errs to either side
    change = np.where(after, 0.0, atlas.lengths) - np.where(atlas.cut, 0.0, atlas.lengths)
    change[after == atlas.cut] = 0.0
    gain = group_sum(np.where(moved[fi], change, 0.0), label[fi], n)
    other = moved[fj] & ~(moved[fi] & (label[fi] == label[fj]))
    gain += group_sum(np.where(other, change, 0.0), label[fj], n)
    good = gain > 0
    most = np.where(good[label], most, chart)
    moved = most != chart
    after = np.where(moved[fi] | moved[fj], most[fi] != most[fj], atlas.cut)
    return after & ~surface.locked, np.where(moved[fi], label[fi], label[fj]), gain


def _main_of(label: IntArray, chart: IntArray, areas: FloatArray) -> IntArray:
    """(labels,) the chart that has most of the area of each label."""
    width = int(chart.max()) + 1
    pairs, inverse = np.unique(label * width + chart, return_inverse=True)
    area = group_sum(areas, inverse.reshape(-1), len(pairs))
    of = pairs // width
    order = np.lexsort((np.arange(len(pairs)), -area, of))
    return np.asarray(pairs[order[first_of_runs(of[order])]] % width)


def _handed_over(atlas: Atlas) -> BoolArray:
    """(e,) seams after faces beside them went to the chart beyond, one by one, where that is cheaper.

    What ends in a junction cannot move otherwise. No two faces that move in one round touch.
    """
    surface = atlas.surface
    m, e = len(surface.faces), surface.edges
    cut, chart = atlas.cut.copy(), atlas.charts()[1].copy()
    beyond, number = np.full(3 * m, -1), np.full(3 * m, -1)
    beyond[e[:, 0]], beyond[e[:, 1]] = e[:, 1] // 3, e[:, 0] // 3
    number[e[:, 0]] = number[e[:, 1]] = np.arange(len(e))
    for _ in range(MOVES):
        half = e[cut].ravel()
        half = half[chart[half // 3] != chart[beyond[half]]]
        face, to = half // 3, chart[beyond[half]]
        around = 3 * face[:, None] + np.arange(3)
        inner = number[around] >= 0
        cost = np.where(inner, atlas.costs[number[around]], 0.0)
        beside = np.where(inner, chart[beyond[around]], -1)
        before = cut[number[around]] & inner
        after = (beside != to[:, None]) & inner
        slit = (before & (beside == chart[face][:, None])).any(1)
        gain = np.where(before, cost, 0.0).sum(1) - np.where(after, cost, 0.0).sum(1)
        pick = np.flatnonzero((gain > WORTH * cost.max(1)) & ~slit)
        if len(pick) == 0:
            break
        pick = pick[_apart(surface.corner_vertex[face[pick]], gain[pick])]
        cut[number[around[pick]][inner[pick]]] = after[pick][inner[pick]]
        chart[face[pick]] = to[pick]
    return cut


def _apart(corners: IntArray, gain: FloatArray) -> IntArray:
    """Faces with no corner in common, the largest gains first. corners: (k, 3)."""
    order = np.lexsort((np.arange(len(gain)), -gain))
    rank = np.empty(len(gain), np.int64)
    rank[order] = np.arange(len(gain))
    least = group_min(np.repeat(rank, 3), corners.ravel(), int(corners.max()) + 1)
    return np.flatnonzero((least[corners] == rank[:, None]).all(1))
