"""The atlas of hard surfaces: smooth regions at full resolution that merge across sharp edges."""

import dataclasses

import numpy as np

from circparam.core.arrays import group_sum, mask_of
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import FINAL, ROUGH, UNROLLED
from circparam.seams.hard.copies import find_copies, spread_copies
from circparam.seams.hard.regions import (
    CURVED,
    MOST_REGIONS,
    SHARP,
    area_share,
    curvature,
    flats,
    large_flats,
    turns,
)
from circparam.seams.hard.unroll import slits, unroll
from circparam.seams.moves.glue import Glue, MergeOptions
from circparam.seams.moves.hand_over import HandOver
from circparam.seams.options import SeamOptions, Search
from circparam.seams.prices import edge_prices
from circparam.seams.search import WORK_PER_FACE, Effort, search
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.grow import DualGraph, make_disks, split_charts
from circparam.seams.segmentation.layout import ChartLayouts, embed_and_relax, judge
from circparam.seams.segmentation.small import absorb
from circparam.solvers.objective import chart_energies

SETTLED = dataclasses.replace(FINAL, bound=UNROLLED)
MARGIN = 0.001  # of the root of the area of a chart: its parts keep so far apart


def hard_atlas(surface: Surface, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """Few charts of a hard surface, each a disk (holes allowed) below the bound, laid out. Deterministic.

    Of components that are copies of each other one is worked on, and the others get the same charts.
    """
    copies = find_copies(surface)
    whole = Atlas(surface, np.zeros(len(surface.edges), bool), prices=edge_prices(surface))
    if copies.first.all():
        return _decided(whole, bound, options, monitor)
    part = _decided(whole.part(copies.first), bound, options, monitor)
    atlas = spread_copies(surface, copies, part)
    bad = judge(*atlas.open()).bad_faces(bound) & ~copies.first
    if bad.any():  # copies are not exact: these need charts of their own
        own = surface.whole_components(bad)
        atlas.put(own, _decided(whole.part(own), bound, options, monitor))
    atlas.prices = whole.prices
    return atlas


def quick_atlas(surface: Surface, bound: float, monitor: Monitor) -> Atlas:
    """Charts of any surface at once, sound but many: what there is before a search has come to a component."""
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool), prices=edge_prices(surface))
    first_regions(atlas, bound, monitor)
    return atlas


def _decided(atlas: Atlas, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """Cut and lay out a hard surface that has no seams yet, all components at the same time."""
    with monitor.stage("charts"):
        first_regions(atlas, bound, monitor)
        work = WORK_PER_FACE * len(atlas.surface.faces)
        draw = Search(draw=options.search.draw)
        merging = MergeOptions(bound, MARGIN, work=work, search=draw)
        merge_regions(atlas, merging, monitor)
    with monitor.stage("enforce"):
        enforce(atlas, judge(*atlas.open()), bound, SETTLED, monitor)
    if options.min_chart_faces > 1:
        with monitor.stage("charts"):
            absorbing = MergeOptions(bound, MARGIN, chart=np.inf)
            absorb(atlas, absorbing, options.min_chart_faces, monitor)
    return atlas


def merge_regions(atlas: Atlas, options: MergeOptions, monitor: Monitor) -> None:
    """Glue the regions of an atlas and hand some over, in turns, until neither makes charts cheaper."""
    glue, hand_over = Glue(atlas, options), HandOver(atlas.charts()[1])
    search(atlas, glue, options.demands, Effort(options.work), monitor)
    work, seams = options.work, np.zeros(0, bool)
    while not np.array_equal(seams, atlas.cut):
        seams = atlas.cut
        work = search(atlas, hand_over, options.demands, Effort(work), monitor)
        work = search(atlas, glue, options.demands, Effort(work), monitor)


def unrolls_whole(surface: Surface) -> bool:
    """Whether a surface has no sharp edge, and all components are disks, holes allowed, that unroll: no seam
    has to be looked for, nor what one would cost."""
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    cut_mesh = atlas.cut_mesh()
    if not_disks(cut_mesh).any():
        return False
    defect, rim = curvature(cut_mesh)
    inside = np.abs(np.where(rim, 0.0, defect))
    if (group_sum(inside, cut_mesh.vertex_chart, cut_mesh.n_charts) > CURVED).any():
        return False
    return not (turns(surface)[0] >= SHARP).any() and not slits(atlas).any()


def first_regions(atlas: Atlas, bound: float, monitor: Monitor) -> None:
    """Cut along sharp edges, open what does not unroll, and split what still breaks the bound.

    Flats stay whole. Where faces are folded over, one may lie over itself in space: it is no flat of the
    design, and is split like the rest.
    """
    prices = edge_prices(atlas.surface) if atlas.prices is None else atlas.prices
    graph = DualGraph(atlas.surface, prices.flat)
    layouts = creased_regions(atlas, graph, bound)
    while not monitor.expired:
        monitor.keep(atlas, sound=False)
        chart = layouts.cut_mesh.chart
        bad = layouts.bad(bound) & (np.bincount(chart) > 1)
        if not bad.any():
            break
        if not split_charts(atlas, graph, chart, bad).any():
            over = prices.flat & bad[chart[atlas.surface.sides]].all(0)
            if not over.any():
                break
            atlas.prices = prices = dataclasses.replace(prices, flat=prices.flat & ~over)
            graph = DualGraph(atlas.surface, prices.flat)
            split_charts(atlas, graph, chart, bad)
        layouts = _laid_out(atlas, graph, bad[chart], bound)


def creased_regions(
    atlas: Atlas, graph: DualGraph, bound: float, relaxed: bool = True
) -> ChartLayouts:
    """Cut along sharp edges, and what does not unroll then along blunter ones."""
    prices = edge_prices(atlas.surface) if atlas.prices is None else atlas.prices
    locked = atlas.surface.locked
    atlas.cut |= prices.sharp & ~locked
    todo = np.ones(len(atlas.surface.faces), bool)
    layouts = _laid_out(atlas, graph, todo, bound, relaxed)
    todo = layouts.bad_faces(bound)
    new = prices.crease & atlas.surface.inner_edges(todo) & ~locked & ~atlas.cut
    if new.any():
        atlas.cut |= new
        layouts = _laid_out(atlas, graph, todo, bound, relaxed)
    return layouts


def unrolls_in_part(surface: Surface, bound: float) -> BoolArray:
    """(m,) bool: large flats, and regions between creases that unroll, cover over a quarter of the component.

    A scan may stand on a flat, and a smooth shape end in some: the rest of it does not unroll.
    """
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool), prices=edge_prices(surface))
    layouts = creased_regions(atlas, DualGraph(surface, atlas.flat), bound, relaxed=False)
    bad = layouts.bad_faces(bound) & ~large_flats(surface)[flats(surface)[0]]
    return (area_share(surface, bad) <= MOST_REGIONS)[surface.components[1]]


def _laid_out(
    atlas: Atlas, graph: DualGraph, todo: BoolArray, bound: float, relaxed: bool = True
) -> ChartLayouts:
    """Make charts disks that unroll and lay out those that hold faces ``todo`` ((m,) bool)."""
    n, chart = atlas.charts()
    atlas.cut |= slits(atlas, mask_of(n, chart[todo]))
    make_disks(atlas, graph)
    cut_mesh = atlas.cut_mesh()
    sub, vid, fid = cut_mesh.subset(mask_of(cut_mesh.n_charts, cut_mesh.chart[todo]))
    uv = atlas.gather(cut_mesh)
    part = unroll(sub)
    high = ~(chart_energies(sub, part) <= bound)
    if relaxed and high.any():
        rest, rvid, _ = sub.subset(high)
        part[rvid] = embed_and_relax(rest, dataclasses.replace(ROUGH, give_up=bound), None)
    uv[vid] = part
    atlas.corners[fid] = uv[cut_mesh.faces[fid]]
    return judge(cut_mesh, uv)
