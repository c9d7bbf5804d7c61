"""Hold every chart to the bound: open, split or map anew those that exceed it, flip or overlap themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    group_count,
    group_max,
    group_min,
    group_sum,
)
from circparam.core.graph import nearest, undirected
from circparam.core.monitor import Monitor
from circparam.geometry.overlap import crossings
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.segmentation.grow import DualGraph, dual_graph, make_disks, split_charts
from circparam.seams.segmentation.layout import ChartLayouts, judge
from circparam.seams.segmentation.overlap_cut import split_layers
from circparam.seams.segmentation.shorten import edge_costs, propose
from circparam.seams.segmentation.slits import SLIT_REACH, slit_charts
from circparam.solvers.dirichlet import energy, jacobians
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.objective import chart_energies
from circparam.solvers.preconditioner import SMALL_CHART
from circparam.solvers.region import cut_out, grow
from circparam.solvers.separate import push_apart
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.untangle import untangle

FINAL = RelaxOptions(tolerance=1e-4, max_iterations=60)
SLITS = 3  # times that a chart may be slit before it is split
ROUNDS = 40
LAYER_FACES = 100  # smaller charts that overlap are halved
FRAGMENT = 4  # cells up to which a chart that is bad is taken apart at once
UNSTICK_FACES = 20_000  # larger charts are pushed apart once, not again after each cut
NARROW = 0.5  # share of the faces below which bad charts are worked on alone
HOT, HOT_RINGS = (
    3.0,
    3,
)  # energy of a face, and rings round it, that are relaxed before the chart is
COOLING = RelaxOptions(tolerance=1e-3, max_iterations=25)
GAP = 0.0005  # share of the root of a chart's area by which parts that touched are pushed apart


def enforce(
    atlas: Atlas,
    graph: DualGraph,
    layouts: ChartLayouts,
    bound: float,
    options: RelaxOptions,
    monitor: Monitor,
) -> None:
    """Cut the charts that are bad until none is: below the bound, without flips, not overlapping themselves.

    layouts: what ``atlas`` has; afterwards the layout is in its corners. A chart that misses the bound by
    little is slit from its boundary to where it is distorted most; others are split in two. Single cells cannot
    be split, so the work ends; what is left then is for the caller to judge. Where good charts hold most of
    the faces, the work goes on with the others alone.
    """
    atlas.scatter(layouts.cut_mesh, layouts.uv)
    slits = np.zeros(len(atlas.surface.faces), np.int64)  # of the chart of each face
    whole, faces = atlas, np.ones(len(slits), bool)
    for turn in range(ROUNDS):
        small = np.bincount(layouts.cut_mesh.chart) <= UNSTICK_FACES
        small &= np.bincount(layouts.cut_mesh.chart) >= LAYER_FACES
        pushed = small | (turn == 0)
        layouts = unstick(atlas, layouts, bound, monitor, pushed)
        bad = layouts.bad(bound) & (_cells(graph, layouts.cut_mesh.chart) > 1)
        if not bad.any() or monitor.expired:
            break
        inside = bad[layouts.cut_mesh.chart]
        if inside.mean() < NARROW:
            whole.put(faces, atlas)
            faces[faces] = inside
            atlas, slits = whole.part(faces), slits[inside]
            graph = dual_graph(atlas.surface, atlas.flat)
            cut_mesh = atlas.cut_mesh()
            layouts = judge(cut_mesh, atlas.gather(cut_mesh))
            bad, pushed = np.ones(cut_mesh.n_charts, bool), pushed[bad]
        before = atlas.cut.copy()
        found = _Bad(graph, layouts, bad, pushed, bound)
        cut, slits = _cut_open(atlas, found, slits, monitor)
        if np.array_equal(before, atlas.cut) and not cut.any():
            break
        layouts = _map_again(atlas, layouts, bad, cut, bound, options, monitor)
    if atlas is not whole:
        whole.put(faces, atlas)


@dataclass(frozen=True, eq=False)
class _Bad:
    """What a round found.

    bad: (n,) bool, charts to cut. pushed: (n,) bool, charts that could not be separated by pushing.
    """

    graph: DualGraph
    layouts: ChartLayouts
    bad: BoolArray
    pushed: BoolArray
    bound: float


def _cut_open(
    atlas: Atlas, found: _Bad, slits: IntArray, monitor: Monitor
) -> tuple[BoolArray, IntArray]:
    """Slit bad charts, or split them. slits: (m,) how often the chart of each face was slit.

    Returns (n,) bool: charts whose pieces may keep their layout; and slits, counted on.
    """
    layouts, bad = found.layouts, found.bad
    chart = layouts.cut_mesh.chart
    near = layouts.energy <= 1 + (found.bound - 1) * SLIT_REACH
    first = np.zeros(len(bad), np.int64)
    np.maximum.at(first, chart, slits)
    slit = bad & ~layouts.overlapping & near & (first < SLITS)
    if slit.any():
        slit = slit_charts(atlas, layouts, slit)
        slits = slits + slit[chart]
    split = bad & ~slit
    cut = np.zeros(len(bad), bool)
    if split.any():
        cut = _split(atlas, found.graph, layouts, split, found.pushed, found.bound, monitor)
    make_disks(atlas, found.graph)
    return cut, slits


def unstick(
    atlas: Atlas, layouts: ChartLayouts, bound: float, monitor: Monitor, which: BoolArray
) -> ChartLayouts:
    """Push parts of charts ((n,) bool) that lie on each other apart, where the bound leaves room for it."""
    folded = which & layouts.overlapping & (layouts.energy <= bound)
    if not folded.any():
        return layouts
    sub, vid, fid = layouts.cut_mesh.subset(folded)
    part, fine = push_apart(sub, layouts.uv[vid], GAP, bound, monitor)
    uv = layouts.uv.copy()
    kept = fine[sub.vertex_chart]
    uv[vid[kept]] = part[kept]
    atlas.corners[fid] = uv[vid][sub.faces]
    return judge(layouts.cut_mesh, uv)


def _cells(graph: DualGraph, chart: IntArray) -> IntArray:
    """(n,) number of cells of each chart."""
    pairs = np.unique(chart * graph.n + graph.cell)
    return group_count(pairs // graph.n, int(chart.max()) + 1)


def _split(
    atlas: Atlas,
    graph: DualGraph,
    layouts: ChartLayouts,
    which: BoolArray,
    pushed: BoolArray,
    bound: float,
    monitor: Monitor,
) -> BoolArray:
    """Split charts in two, overlapping ones between the parts that overlap; then shorten the new seams.

    Returns (n,) bool: charts that were only cut, or pushed apart, so that their pieces may keep their layout.
    """
    before = atlas.cut.copy()
    chart = layouts.cut_mesh.chart
    apart = sound = np.zeros(len(which), bool)
    folded = which & layouts.overlapping & np.isfinite(layouts.energy)
    if folded.any():
        large = folded & (np.bincount(chart) >= LAYER_FACES)
        if large.any():
            sound = split_layers(atlas, graph, layouts, large, edge_costs(atlas))
        left = large & ~sound & ~pushed
        if left.any():
            # what overlaps by less than a face is not worth a seam where it can be pushed apart
            sound |= left & ~unstick(atlas, layouts, bound, monitor, left).overlapping
        apart = sound.copy()
        if (folded & ~sound).any():
            apart |= _split_overlaps(atlas, graph, layouts, folded & ~sound)
    rest = which & ~apart
    crumbs = rest & (_cells(graph, chart) <= FRAGMENT)
    atlas.cut |= crumbs[chart[atlas.surface.edges[:, 0] // 3]] & (graph.tail != graph.head)
    rest &= ~crumbs
    if rest.any():
        split_charts(atlas, graph, chart, rest)
    proposal = propose(atlas, 3, before)
    atlas.cut = proposal.cut(np.ones(proposal.n, bool))
    return sound


def _split_overlaps(
    atlas: Atlas, graph: DualGraph, layouts: ChartLayouts, which: BoolArray
) -> BoolArray:
    """Split charts half way between two faces that overlap; returns the charts that were split."""
    pairs = crossings(layouts.uv, layouts.cut_mesh)
    chart = layouts.cut_mesh.chart
    pairs = pairs[which[chart[pairs[:, 0] // 3]]]
    done = np.zeros(len(which), bool)
    if len(pairs) == 0:
        return done
    of = chart[pairs[:, 0] // 3]
    apart = np.linalg.norm(
        atlas.surface.points[atlas.surface.faces[pairs[:, 0] // 3, 0]]
        - atlas.surface.points[atlas.surface.faces[pairs[:, 1] // 3, 0]],
        axis=1,
    )
    order = np.lexsort((np.arange(len(pairs)), -apart, of))
    chosen = pairs[order[first_of_runs(of[order])]]
    seeds = graph.cell[chosen // 3]
    differ = seeds[:, 0] != seeds[:, 1]
    chosen, seeds = chosen[differ], seeds[differ]
    if len(seeds) == 0:
        return done
    done[chart[chosen[:, 0] // 3]] = True
    use = ~atlas.cut & done[chart[atlas.surface.edges[:, 0] // 3]]
    links = undirected(graph.n, graph.tail[use], graph.head[use], graph.step[use])
    _, _, source = nearest(links, seeds.ravel())
    first_side = np.zeros(graph.n, bool)
    first_side[seeds[:, 0]] = True
    side = first_side[np.where(source >= 0, source, 0)]
    atlas.cut |= use & (side[graph.tail] != side[graph.head])
    return done


def _map_again(
    atlas: Atlas,
    layouts: ChartLayouts,
    changed: BoolArray,
    cut: BoolArray,
    bound: float,
    options: RelaxOptions,
    monitor: Monitor,
) -> ChartLayouts:
    """Lay out the pieces of changed charts: from the layout they had, or anew where that has flips.

    cut: charts whose pieces keep their layout as it is, where that is within the bound.
    """
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    todo = np.zeros(cut_mesh.n_charts, bool)
    todo[cut_mesh.chart[(changed & ~cut)[layouts.cut_mesh.chart]]] = True
    energy = chart_energies(cut_mesh, uv)
    over = ~(energy <= bound)
    todo[cut_mesh.chart[over[cut_mesh.chart] & changed[layouts.cut_mesh.chart]]] = True
    if todo.any():
        sub, vid, fid = cut_mesh.subset(todo)
        part = lay_out_sound(sub, uv[vid], options, monitor)
        uv[vid] = part
        atlas.corners[fid] = part[sub.faces]
    return judge(cut_mesh, uv)


def lay_out_sound(
    cut_mesh: CutMesh, uv: FloatArray, options: RelaxOptions, monitor: Monitor
) -> FloatArray:
    """Relax a layout; charts with flipped faces are untangled, or else embedded anew, first."""
    alone = np.flatnonzero((np.bincount(cut_mesh.chart) == 1)[cut_mesh.chart])
    if len(alone):  # a single face lies as it is
        uv = uv.copy()
        uv[cut_mesh.faces[alone]] = cut_mesh.rest_triangles[alone]
    bad = ~np.isfinite(chart_energies(cut_mesh, uv))
    wild = bad & _wild(cut_mesh, uv)
    bad &= ~wild
    if wild.any():
        uv = uv.copy()
        sub, vid, _ = cut_mesh.subset(wild)
        uv[vid] = tutte_embedding(sub, "mean-value")[0]
    if bad.any():
        uv = uv.copy()
        sub, vid, _ = cut_mesh.subset(bad)
        near = options.local is not None
        part, report = untangle(sub, uv[vid], monitor=monitor, near=near)
        uv[vid] = part
        left = report.after > 0
        if left.any():
            rest, inner, _ = sub.subset(left)
            uv[vid[inner]] = tutte_embedding(rest, "mean-value")[0]
    if options.local is not None:
        uv = _cooled(cut_mesh, uv)
    return relax(cut_mesh, uv, options, monitor).uv


def _cooled(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """The layout relaxed near faces that are distorted out of all proportion, the rest held.

    A Newton step widens a nearly collapsed face by a third; all other faces need not wait for it.
    """
    jacobian = jacobians(cut_mesh.gradients.transpose(1, 2, 0), uv.T[:, cut_mesh.faces.T])
    hot = ~(energy(jacobian) <= HOT)
    if not hot.any():
        return uv
    held = np.zeros(cut_mesh.n_vertices, bool)
    part, source, fixed = cut_out(cut_mesh, grow(cut_mesh, hot, HOT_RINGS), held)
    out = uv.copy()
    out[source[~fixed]] = relax(part, uv[source], replace(COOLING, fixed=fixed)).uv[~fixed]
    return out


def _wild(cut_mesh: CutMesh, uv: FloatArray) -> BoolArray:
    """(n,) bool: the layout of the chart is far too large for it, or no numbers at all."""
    n = cut_mesh.n_charts
    low = np.stack([group_min(uv[:, d], cut_mesh.vertex_chart, n) for d in range(2)], 1)
    high = np.stack([group_max(uv[:, d], cut_mesh.vertex_chart, n) for d in range(2)], 1)
    with np.errstate(invalid="ignore"):
        size = (high - low).max(1)
    rim = group_sum(cut_mesh.edge_lengths.sum(1), cut_mesh.chart, n)
    result: BoolArray = ~(size <= 10 * rim)
    return result


def relaxed_layouts(atlas: Atlas, options: RelaxOptions, monitor: Monitor) -> ChartLayouts:
    """Relax the layout of all charts, after mending its flips; small charts are always relaxed to the end."""
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    small = group_count(cut_mesh.vertex_chart, cut_mesh.n_charts) <= SMALL_CHART
    if options.local is None:
        small[:] = False
    for which, asked in ((small, FINAL), (~small, options)):
        if which.any():
            sub, vid, _ = cut_mesh.subset(which)
            uv[vid] = lay_out_sound(sub, uv[vid], asked, monitor)
    atlas.scatter(cut_mesh, uv)
    return judge(cut_mesh, uv)


def below(atlas: Atlas, layouts: ChartLayouts, bound: float, monitor: Monitor) -> ChartLayouts:
    """Relax the charts above the bound on, to below it: what was relaxed for a few steps may get there."""
    over = (layouts.energy > bound) & np.isfinite(layouts.energy)
    if not over.any():
        return layouts
    sub, vid, fid = layouts.cut_mesh.subset(over)
    uv = layouts.uv.copy()
    uv[vid] = relax(sub, uv[vid], replace(FINAL, bound=bound, give_up=bound), monitor).uv
    atlas.corners[fid] = uv[vid][sub.faces]
    return judge(layouts.cut_mesh, uv)
