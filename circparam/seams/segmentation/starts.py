"""Starts of a search for charts: regions grown round seeds, split until they are good, and merged."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import ROUGH
from circparam.seams.cost import COST
from circparam.seams.hard.regions import facets
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.moves.reroute import shorten
from circparam.seams.options import Search
from circparam.seams.prices import planar
from circparam.seams.segmentation.grow import (
    dual_graph,
    first_charts,
    make_disks,
    split_charts,
)
from circparam.seams.segmentation.layout import lay_out_fresh

# regions of a draft: from 12 most charts were halved eight times before they were below the bound
REGIONS = 30
DRAFT_START = (1.0, REGIONS)
# (size of the proxy, regions that charts are grown from) of each start of a search. Which leads to the fewest
# charts is a matter of luck: four cost 8 % less than one (seams and charts of eleven meshes of 4,000 to 22,000
# faces). The draft beside a search is the fourth. Surfaces without a proxy get the first two.
STARTS = ((1.0, 2 * REGIONS), (0.5, REGIONS), (0.5, 2 * REGIONS))
# up to this size charts are decided on the surface itself; larger ones that have no proxy get one start
DIRECT_FACES = 1_500


def starts_of(search: Search, surface: Surface) -> list[tuple[float, int]]:
    """(size of the proxy, regions) of each start of a search; size 1 is that of a draft."""
    if search.draft:
        return [DRAFT_START]
    return list(STARTS[:2] if len(surface.faces) <= DIRECT_FACES else STARTS)


def searched(
    surface: Surface,
    options: MergeOptions,
    regions: Sequence[int],
    worker: Worker,
    monitor: Monitor,
) -> Atlas:
    """The cheapest atlas of a few starts, each of which grows charts from so many regions and merges them."""
    if len(regions) == 1:
        return grow_and_merge(surface, options, regions[0], worker, monitor)
    tasks = [(surface, options, k, k == regions[0]) for k in regions]
    found = [Atlas(surface, *one) for one in worker.map(start_once, tasks, monitor) if one]
    return min(found, key=COST.seams)


def start_once(
    surface: Surface, options: MergeOptions, seeds: int, needed: bool, monitor: Monitor
) -> tuple[BoolArray, FloatArray] | None:
    """(cut, corners) of one start of several; None if it is not needed and there is no time for it."""
    if monitor.expired and not needed:
        return None
    atlas = grow_and_merge(surface, options, seeds, None, monitor)
    return atlas.cut, atlas.corners


def grow_and_merge(
    surface: Surface, options: MergeOptions, seeds: int, worker: Worker | None, monitor: Monitor
) -> Atlas:
    """Grow charts round so many seeds, split what is bad, merge.

    worker: lays half of the charts out where there is nothing better for it to do.
    """
    atlas = _grown(surface, options, seeds, worker, monitor)
    merge(atlas, options, monitor, worker=worker)
    return atlas


def _grown(
    surface: Surface, options: MergeOptions, seeds: int, worker: Worker | None, monitor: Monitor
) -> Atlas:
    """Charts grown round so many seeds and split until they are good."""
    bound = options.bound
    # what stays above the bound is split, wherever it ends; only a draft takes the word of the first steps
    rough = replace(ROUGH, give_up=bound) if options.search.draft else ROUGH
    graph = dual_graph(surface, planar(surface, facets(surface)))
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    first_charts(atlas, graph, seeds)
    make_disks(atlas, graph)
    shorten(atlas, 2)
    make_disks(atlas, graph)
    layouts = lay_out_fresh(atlas, None, rough, worker, monitor)
    monitor.keep(atlas, sound=False)
    while (bad := layouts.bad(bound) & (np.bincount(layouts.cut_mesh.chart) > 1)).any():
        was = bad[layouts.cut_mesh.chart]
        if not split_charts(atlas, graph, layouts.cut_mesh.chart, bad).any():
            break
        make_disks(atlas, graph)
        monitor.keep(atlas, sound=False)
        n, chart = atlas.charts()
        again = np.zeros(n, bool)
        again[chart[was]] = True
        layouts = lay_out_fresh(atlas, again, rough, worker, monitor)
    return atlas
