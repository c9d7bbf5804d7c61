"""Hold every chart to the bound: open, split or map anew those that exceed it, flip or overlap themselves."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    IntArray,
    group_count,
    sorted_distinct,
)
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import FINAL
from circparam.seams.moves.reroute import shorten
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.grow import DualGraph, dual_graph, make_disks, split_charts
from circparam.seams.segmentation.layout import (
    GAP,
    ChartLayouts,
    judge,
    lay_out_sound,
    pushed_apart,
)
from circparam.seams.segmentation.overlap_cut import split_layers, split_overlaps
from circparam.seams.segmentation.slits import slit_charts
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.objective import chart_energies
from circparam.solvers.preconditioner import SMALL_CHART

NARROW = 0.5  # share of the faces below which bad charts are worked on alone


def enforce(
    atlas: Atlas,
    graph: DualGraph,
    layouts: ChartLayouts,
    bound: float,
    options: RelaxOptions,
    monitor: Monitor,
) -> None:
    """Cut the charts that are bad until none is: below the bound, without flips, not overlapping themselves.

    layouts: what ``atlas`` has; afterwards the layout is in its corners. A chart above the bound is slit
    once from its boundary to where it is distorted most, then split in two. Parts that lie on
    each other are pushed apart, but cut apart at once where options stop at a bound. Single cells cannot
    be split, so the work ends; what is left then is for the caller to judge. Where good charts hold most of
    the faces, the work goes on with the others alone.
    """
    atlas.scatter(layouts.cut_mesh, layouts.uv)
    slit = np.zeros(len(atlas.surface.faces), bool)  # faces of charts that were slit
    whole, faces = atlas, np.ones(len(slit), bool)
    clear, last = np.zeros(len(slit), bool), atlas.corners
    # halves of halves are single cells after so many rounds as their number has digits; a slit and a push come
    # before each
    for _ in range(3 * int(graph.n).bit_length()):
        if options.bound is None:
            every = np.ones(layouts.cut_mesh.n_charts, bool)
            layouts = unstick(atlas, layouts, bound, monitor, every)
        bad = layouts.bad(bound) & (_cells(graph, layouts.cut_mesh.chart) > 1)
        if not bad.any() or monitor.expired:
            break
        inside = bad[layouts.cut_mesh.chart]
        if inside.mean() < NARROW:
            whole.put(faces, atlas)
            faces[faces] = inside
            atlas, slit = whole.part(faces), slit[inside]
            clear, last = clear[inside], last[inside]
            graph = dual_graph(atlas.surface, atlas.flat)
            cut_mesh = atlas.cut_mesh()
            layouts = judge(cut_mesh, atlas.gather(cut_mesh))
            bad = np.ones(cut_mesh.n_charts, bool)
        before = atlas.cut.copy()
        moved = group_count(layouts.cut_mesh.chart[(atlas.corners != last).any((1, 2))], len(bad))
        clear &= moved[layouts.cut_mesh.chart] == 0
        last = atlas.corners.copy()
        found = _Bad(graph, layouts, bad, options.bound is None, bound, clear)
        cut, slit = _cut_open(atlas, found, slit, monitor)
        if np.array_equal(before, atlas.cut) and not cut.any():
            break
        layouts = _map_again(atlas, layouts, bad, cut, bound, options, monitor)
    if atlas is not whole:
        whole.put(faces, atlas)


@dataclass(frozen=True, eq=False)
class _Bad:
    """What a round found.

    bad: (n,) bool, charts to cut. pushed: whether those that overlap could not be pushed apart. clear: (m,)
    bool, faces known to lie on no other, which grow in number with what is looked at.
    """

    graph: DualGraph
    layouts: ChartLayouts
    bad: BoolArray
    pushed: bool
    bound: float
    clear: BoolArray


def _cut_open(
    atlas: Atlas, found: _Bad, before: BoolArray, monitor: Monitor
) -> tuple[BoolArray, BoolArray]:
    """Slit bad charts, or split them. before: (m,) bool, the chart of the face was slit.

    Returns (n,) bool: charts whose pieces may keep their layout; (m,) bool as ``before``.
    """
    layouts, bad = found.layouts, found.bad
    chart = layouts.cut_mesh.chart
    slit = bad & ~layouts.overlapping & (group_count(chart[before], len(bad)) == 0)
    if slit.any():
        slit = slit_charts(atlas, layouts, slit)
    split = bad & ~slit
    cut = _split(atlas, found, split, monitor) if split.any() else np.zeros(len(bad), bool)
    make_disks(atlas, found.graph)
    return cut, before | slit[chart]


def unstick(
    atlas: Atlas, layouts: ChartLayouts, bound: float, monitor: Monitor, which: BoolArray
) -> ChartLayouts:
    """Push parts of charts ((n,) bool) that lie on each other apart, where the bound leaves room for it."""
    folded = which & layouts.overlapping & (layouts.energy <= bound)
    if not folded.any():
        return layouts
    sub, vid, fid = layouts.cut_mesh.subset(folded)
    part, fine = pushed_apart(sub, layouts.uv[vid], GAP, bound, monitor)
    uv = layouts.uv.copy()
    kept = fine[sub.vertex_chart]
    uv[vid[kept]] = part[kept]
    atlas.corners[fid] = uv[vid][sub.faces]
    return judge(layouts.cut_mesh, uv)


def _cells(graph: DualGraph, chart: IntArray) -> IntArray:
    """(n,) number of cells of each chart."""
    pairs = sorted_distinct(chart * graph.n + graph.cell)
    return group_count(pairs // graph.n, int(chart.max()) + 1)


def _split(atlas: Atlas, found: _Bad, which: BoolArray, monitor: Monitor) -> BoolArray:
    """Split charts in two, overlapping ones between the parts that overlap; then shorten the new seams.

    Returns (n,) bool: charts that were only cut, or pushed apart, so that their pieces may keep their layout.
    """
    graph, layouts, pushed, bound = found.graph, found.layouts, found.pushed, found.bound
    before = atlas.cut.copy()
    chart = layouts.cut_mesh.chart
    apart = sound = np.zeros(len(which), bool)
    folded = which & layouts.overlapping & np.isfinite(layouts.energy)
    if folded.any():
        sound = split_layers(atlas, graph, layouts, folded, edge_costs(atlas), found.clear)
        left = folded & ~sound
        if left.any() and not pushed:
            # what overlaps by less than a face is not worth a seam where it can be pushed apart
            sound |= left & ~unstick(atlas, layouts, bound, monitor, left).overlapping
        apart = sound.copy()
        if (folded & ~sound).any():
            apart |= split_overlaps(atlas, graph, layouts, folded & ~sound)
    rest = which & ~apart
    if rest.any():
        split_charts(atlas, graph, chart, rest)
    shorten(atlas, 3, before)
    return sound


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


def relaxed_layouts(
    atlas: Atlas, options: RelaxOptions, bound: float, aim: float, monitor: Monitor
) -> ChartLayouts:
    """Relax the layout of all charts, after mending its flips; small charts are always relaxed to the end.

    bound: what a few local steps leave above it is relaxed on, until it falls to ``aim`` or cannot get there.
    """
    cut_mesh = atlas.cut_mesh()
    uv = atlas.gather(cut_mesh)
    small = group_count(cut_mesh.vertex_chart, cut_mesh.n_charts) <= SMALL_CHART
    if options.local is None:
        small[:] = False
    for which, asked in ((small, replace(FINAL, bound=options.bound)), (~small, options)):
        if which.any():
            sub, vid, _ = cut_mesh.subset(which)
            uv[vid] = lay_out_sound(sub, uv[vid], asked, monitor)
    if options.local is not None:
        energy = chart_energies(cut_mesh, uv)
        over = (energy > bound) & np.isfinite(energy)
        if over.any():
            sub, vid, _ = cut_mesh.subset(over)
            uv[vid] = relax(sub, uv[vid], replace(FINAL, bound=aim, give_up=bound), monitor).uv
    atlas.scatter(cut_mesh, uv)
    return judge(cut_mesh, uv)
