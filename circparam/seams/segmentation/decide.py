"""Seams decided on one surface: regions grown round seeds, split until they are good, merged, and merged on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circparam.core.arrays import mask_of
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray
from circparam.core.workers import in_processes
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import ANY_BOUND, FINAL, ROUGH
from circparam.seams.cost import COST
from circparam.seams.hard.regions import facets
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.moves.reroute import shorten
from circparam.seams.options import Search
from circparam.seams.prices import planar
from circparam.seams.search import WORK_PER_FACE
from circparam.seams.segmentation.grow import DualGraph, first_charts, make_disks, split_charts
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.solvers.newton import relax

# regions of a draft: from 12 most charts were halved eight times before they were below the bound
REGIONS = 30
DRAFT_START = (1.0, REGIONS)
# (size of the proxy, regions that charts are grown from) of each start of a search. Which leads to the fewest
# charts is a matter of luck: four cost 8 % less than one (seams and charts of eleven meshes of 4,000 to 22,000
# faces). The draft beside a search is the fourth. Surfaces without a proxy get the first two.
STARTS = ((1.0, 2 * REGIONS), (0.5, REGIONS), (0.5, 2 * REGIONS))
# up to this size charts are decided on the surface itself; larger ones that have no proxy get one start
DIRECT_FACES = 1_500
SHORT_ARCS = 0.2  # radians; arcs end at such vertices when charts of a finished atlas merge


def starts_of(search: Search, surface: Surface) -> list[tuple[float, int]]:
    """(size of the proxy, regions) of each start of a search; size 1 is that of a draft."""
    if search.draft:
        return [DRAFT_START]
    return list(STARTS[:2] if len(surface.faces) <= DIRECT_FACES else STARTS)


def decide(
    surface: Surface,
    merging: MergeOptions,
    regions: Sequence[int],
    max_charts: int | None,
    monitor: Monitor,
) -> Atlas:
    """Decide seams on the surface itself: components that are good charts as they are stay whole.

    regions: that the charts of each start are grown from.
    """
    # visibility does not predict which charts merge: charts are decided by length alone
    atlas = Atlas(surface.unpriced(), np.zeros(len(surface.edges), bool))
    rest = ~whole_components(atlas, merging.bound)
    if not rest.all():
        monitor.keep(atlas.part(~rest))
    if rest.any():
        atlas.put(rest, searched(atlas.surface.part(rest), merging, regions, monitor))
    if max_charts is not None:
        reach_count(atlas, merging.bound, max_charts, monitor)
    return atlas


def whole_components(atlas: Atlas, bound: float) -> BoolArray:
    """(m,) bool: faces of components that are good charts without a seam. They are laid out."""
    cut_mesh = atlas.cut_mesh()
    able = ~not_disks(cut_mesh)
    if able.any():
        layouts = lay_out_fresh(atlas, able, replace(ROUGH, give_up=bound))
        able &= ~layouts.bad(bound)
    return able[cut_mesh.chart]


def searched(
    surface: Surface, options: MergeOptions, regions: Sequence[int], monitor: Monitor
) -> Atlas:
    """The cheapest atlas of a few starts, each of which grows charts from so many regions and merges them."""
    if len(regions) == 1:
        return grow_and_merge(surface, options, regions[0], monitor)
    tasks = [(surface, options, k, k == regions[0]) for k in regions]
    done = in_processes(start_once, tasks, monitor)
    return min((Atlas(surface, *one) for one in done if one), key=COST.seams)


def start_once(
    surface: Surface, options: MergeOptions, seeds: int, needed: bool, monitor: Monitor
) -> tuple[BoolArray, FloatArray] | None:
    """(cut, corners) of one start of several; None if it is not needed and there is no time for it."""
    if monitor.expired and not needed:
        return None
    atlas = grow_and_merge(surface, options, seeds, monitor)
    return atlas.cut, atlas.corners


def grow_and_merge(surface: Surface, options: MergeOptions, seeds: int, monitor: Monitor) -> Atlas:
    """Charts grown round so many seeds, split until they are good, and merged."""
    bound = options.bound
    # what stays above the bound is split, wherever it ends; only a draft takes the word of the first steps
    rough = replace(ROUGH, give_up=bound) if options.search.draft else ROUGH
    graph = DualGraph(surface, planar(surface, facets(surface)))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    first_charts(atlas, graph, seeds)
    make_disks(atlas, graph)
    shorten(atlas, 2)
    make_disks(atlas, graph)
    layouts = lay_out_fresh(atlas, None, rough, monitor)
    monitor.keep(atlas, sound=False)
    while (bad := layouts.bad(bound) & (np.bincount(layouts.cut_mesh.chart) > 1)).any():
        was = bad[layouts.cut_mesh.chart]
        if not split_charts(atlas, graph, layouts.cut_mesh.chart, bad).any():
            break
        make_disks(atlas, graph)
        monitor.keep(atlas, sound=False)
        n, chart = atlas.charts()
        layouts = lay_out_fresh(atlas, mask_of(n, chart[was]), rough, monitor)
    merge(atlas, options, monitor)
    return atlas


def merge_on(atlas: Atlas, bound: float, margin: float, monitor: Monitor) -> None:
    """Merge charts of a finished atlas wherever that lowers its cost, distortion included.

    Arcs end at smaller curvature than they did and parts may come nearer to each other, so that unions turn out
    fine that were refused when charts were decided.
    """
    n, _ = atlas.charts()
    pieces, _ = atlas.surface.components
    if n <= pieces or monitor.expired:
        return
    work = WORK_PER_FACE * len(atlas.surface.faces)
    options = MergeOptions(bound, margin, cone=SHORT_ARCS, zip=False, work=work)
    merge(atlas, options, monitor)


def merged_on(coarse: Atlas, bound: float, monitor: Monitor) -> Atlas:
    """The atlas of a proxy relaxed to the end and merged on, as far as there is time."""
    monitor.keep(coarse)
    pieces, _ = coarse.surface.components
    out = Atlas(coarse.surface, coarse.cut, coarse.corners)
    if coarse.charts()[0] > pieces and not monitor.expired:
        cut_mesh, uv = out.open()
        relaxed = judge(cut_mesh, relax(cut_mesh, uv, FINAL).uv)
        fine = ~relaxed.bad(bound)[cut_mesh.vertex_chart]
        out.scatter(cut_mesh, np.where(fine[:, None], relaxed.uv, uv))
        merge_on(out, bound, 0.0, monitor)
    return out


def reach_count(atlas: Atlas, bound: float, count: int, monitor: Monitor) -> None:
    """Merge on with a rising bound until there are at most ``count`` charts, or nothing merges any more."""
    pieces, _ = atlas.surface.components
    for _ in range(24):
        if atlas.charts()[0] <= max(count, pieces):
            break
        bound = 1 + max(bound - 1, 1e-3) * 1.6
        options = MergeOptions(bound, 0.0, cone=SHORT_ARCS, zip=False, chart=np.inf, count=count)
        merge(atlas, options, monitor)


def worth(atlas: Atlas, most: int, bound: float) -> tuple[int, int, float, float]:
    """What counts where so many charts are wanted, the least first: charts that lie on themselves, which would
    be split, charts beyond that number, distortion, seam length."""
    layouts = judge(*atlas.open())
    cut_mesh = layouts.cut_mesh
    over = float(np.average(layouts.energy, weights=cut_mesh.chart_areas))
    faulty = int(layouts.bad(ANY_BOUND).sum())
    return faulty, max(cut_mesh.n_charts, most), max(over, bound), atlas.seam_length
