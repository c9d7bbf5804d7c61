"""Hold every chart to the bound: open, split or map anew those that exceed it, flip or overlap themselves."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import group_count, mask_of, sorted_distinct
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.accuracy import FINAL
from circparam.seams.moves.reroute import shorten
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.grow import DualGraph, make_disks
from circparam.seams.segmentation.halves import halve_between_ends, halve_evenly
from circparam.seams.segmentation.layout import (
    ChartLayouts,
    judge,
    lay_out_sound,
    pushed_apart,
)
from circparam.seams.segmentation.overlap_cut import split_layers
from circparam.seams.segmentation.slits import slit_charts
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.objective import chart_energies
from circparam.solvers.preconditioner import SMALL_CHART

# of a chart before it is split: with one, drafts of scans of 25,000 and 50,000 faces have longer seams
SLITS = 2
NARROW = 0.5  # share of the faces below which bad charts are worked on alone
# of the excess of the bound, where charts of a draft stop: weights against stretch add a fiftieth of it, and no
# layout above the bound is kept (1,004 charts in place of 305 of a rough scan of 1.2 million faces)
ROOM_SHARE = 0.95


def enforce(
    atlas: Atlas,
    layouts: ChartLayouts,
    bound: float,
    options: RelaxOptions,
    monitor: Monitor,
) -> None:
    """Cut the charts that are bad until none is: below the bound, without flips, not overlapping themselves.

    layouts: what ``atlas`` has; afterwards the layout is in its corners. A chart above the bound is slit
    SLITS times from its boundary to where it is bent most, then split in two. Parts that lie on each other are
    pushed or cut apart. Single cells cannot be split, so the work ends; what is left then is for the caller to
    judge. Where good charts hold most of the faces, the work goes on with the others alone.
    """
    atlas.scatter(layouts.cut_mesh, layouts.uv)
    if not layouts.bad(bound).any():  # the dual graph of a large part takes longer than to see that
        return
    graph = DualGraph(atlas.surface, atlas.flat)
    slits = np.zeros(len(atlas.surface.faces), np.int64)  # how often the chart of a face was slit
    whole, faces = atlas, np.ones(len(slits), bool)
    # halves of halves are single cells after so many rounds as their number has digits
    for _ in range(SLITS + 2 * int(graph.n).bit_length()):
        bad = layouts.bad(bound) & (_cells(graph, layouts.cut_mesh.chart) > 1)
        if not bad.any() or monitor.expired:
            break
        inside = bad[layouts.cut_mesh.chart]
        if inside.mean() < NARROW:
            whole.put(faces, atlas)
            faces[faces] = inside
            atlas, slits = whole.part(faces), slits[inside]
            graph = DualGraph(atlas.surface, atlas.flat)
            layouts = judge(*atlas.open())
            bad = np.ones(layouts.cut_mesh.n_charts, bool)
        before = atlas.cut.copy()
        kept, slits = _cut_open(atlas, graph, layouts, bad, slits, bound, monitor)
        if np.array_equal(before, atlas.cut) and not kept.any():
            break
        layouts = _map_again(atlas, layouts, bad, kept, bound, options, monitor)
    if atlas is not whole:
        whole.put(faces, atlas)


def _cut_open(
    atlas: Atlas,
    graph: DualGraph,
    layouts: ChartLayouts,
    bad: BoolArray,
    slits: IntArray,
    bound: float,
    monitor: Monitor,
) -> tuple[BoolArray, IntArray]:
    """Slit bad charts ((n,) bool), or split them in two. slits: (m,) how often the chart of a face was slit.

    Returns (n,) bool: charts whose pieces may keep their layout, since they were cut or pushed apart where they
    overlapped; (m,) as ``slits``.
    """
    chart, was = layouts.cut_mesh.chart, atlas.cut.copy()
    often = group_count(chart[slits >= SLITS], len(bad)) > 0
    open_to_slits = bad & np.isfinite(layouts.energy) & ~layouts.overlapping & ~often
    slit = slit_charts(atlas, layouts.cut_mesh, open_to_slits)
    split = bad & ~slit
    folded = split & layouts.overlapping & np.isfinite(layouts.energy)
    kept = _push_apart(atlas, layouts, folded, bound, monitor)
    layered = split & layouts.overlapping & ~kept
    kept |= split_layers(atlas, graph, layouts, layered, edge_costs(atlas))
    laid = np.isfinite(layouts.energy) & ~layouts.overlapping
    if (split & laid).any():
        halve_evenly(atlas, graph, layouts, split & laid)
    if (split & ~laid & ~kept).any():
        halve_between_ends(atlas, graph, chart, split & ~laid & ~kept)
    if split.any():
        shorten(atlas, 3, was)
    make_disks(atlas, graph)
    return kept, slits + slit[chart]


def _push_apart(
    atlas: Atlas, layouts: ChartLayouts, which: BoolArray, bound: float, monitor: Monitor
) -> BoolArray:
    """Push parts of charts ((n,) bool) apart that lie on each other by less than a face; returns the free ones.

    Only charts below the bound are pushed, because that costs distortion.
    """
    which = which & (layouts.energy <= bound)
    done = np.zeros(len(which), bool)
    if which.any():
        sub, vid, fid = layouts.cut_mesh.subset(which)
        uv, fine = pushed_apart(sub, layouts.uv[vid], bound, monitor)
        kept = fine[sub.chart]
        atlas.corners[fid[kept]] = uv[sub.faces[kept]]
        done[layouts.cut_mesh.chart[fid[kept]]] = True
    return done


def _cells(graph: DualGraph, chart: IntArray) -> IntArray:
    """(n,) number of cells of each chart."""
    pairs = sorted_distinct(chart * graph.n + graph.cell)
    return group_count(pairs // graph.n, int(chart.max()) + 1)


def _map_again(
    atlas: Atlas,
    layouts: ChartLayouts,
    changed: BoolArray,
    kept: BoolArray,
    bound: float,
    options: RelaxOptions,
    monitor: Monitor,
) -> ChartLayouts:
    """Lay out the pieces of changed charts: from the layout they had, or anew where that has flips.

    kept: charts whose pieces keep their layout as it is, where that is within the bound.
    """
    cut_mesh, uv = atlas.open()
    was = layouts.cut_mesh.chart
    over = ~(chart_energies(cut_mesh, uv) <= bound)[cut_mesh.chart]
    again = (changed & ~kept)[was] | (changed[was] & over)
    todo = mask_of(cut_mesh.n_charts, cut_mesh.chart[again])
    if todo.any():
        sub, vid, fid = cut_mesh.subset(todo)
        part = relaxed(sub, uv[vid], options, bound, monitor)
        uv[vid] = part
        atlas.corners[fid] = part[sub.faces]
    return judge(cut_mesh, uv)


def relaxed_layouts(
    atlas: Atlas, options: RelaxOptions, bound: float, monitor: Monitor
) -> ChartLayouts:
    """Relax the layout of all charts, after mending its flips: see ``relaxed``."""
    cut_mesh, uv = atlas.open()
    uv = relaxed(cut_mesh, uv, options, bound, monitor)
    atlas.scatter(cut_mesh, uv)
    return judge(cut_mesh, uv)


def relaxed(
    cut_mesh: CutMesh, uv: FloatArray, options: RelaxOptions, bound: float, monitor: Monitor
) -> FloatArray:
    """(nv, 2) the layout relaxed, after mending its flips; small charts are always relaxed to the end.

    What a few local steps leave above the bound is relaxed on, until it falls below it or cannot get there.
    """
    if options.local is None:
        return lay_out_sound(cut_mesh, uv, options, monitor)
    uv = uv.copy()
    small = group_count(cut_mesh.vertex_chart, cut_mesh.n_charts) <= SMALL_CHART
    for which, asked in ((small, replace(FINAL, bound=options.bound)), (~small, options)):
        if which.any():
            sub, vid, _ = cut_mesh.subset(which)
            uv[vid] = lay_out_sound(sub, uv[vid], asked, monitor)
    energy = chart_energies(cut_mesh, uv)
    over = (energy > bound) & np.isfinite(energy)
    if over.any():
        aim = bound if options.bound is None else 1 + ROOM_SHARE * (bound - 1)
        sub, vid, _ = cut_mesh.subset(over)
        uv[vid] = relax(sub, uv[vid], replace(FINAL, bound=aim, give_up=bound), monitor).uv
    return uv
