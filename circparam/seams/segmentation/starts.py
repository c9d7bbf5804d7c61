"""Starts of a search for charts: regions grown, merged, their seams shortened, and merged again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import ROUGH, TRIAL
from circparam.seams.cost import COST
from circparam.seams.multires.holes import complexity
from circparam.seams.options import Search
from circparam.seams.segmentation.grow import (
    dual_graph,
    first_charts,
    make_disks,
    split_charts,
)
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.shorten import propose
from circparam.seams.segmentation.shorten_seams import shorten_seams
from circparam.seams.segmentation.state import arcs_of
from circparam.seams.segmentation.unions import MergeOptions

CUT_UP = 20  # faces: a surface with fewer for each hole and handle is cut up by them
# regions that each start of a search grows its charts from, and faces of the largest surface that it is made
# on: one start alone costs 3 % more (seams and charts of 74 small meshes, two rotations each)
SEEDS = (60, 12, 30, 100)
START_FACES = (1 << 62, 6000, 1500, 1500)
DRAFT_SEEDS = 12  # regions of the one start of a draft
OTHER_SEEDS = (30, 20, 12, 45, 8, 60)  # of the one start of each search that more effort makes
HASTY = replace(ROUGH, max_iterations=6)
# charts whose seams are shortened: the tolerance of FAIR takes a fifth more steps, for seams none the better
BRISK = replace(TRIAL, max_iterations=30)
BEHIND = 0.1  # share by which a start costs more than another when both have merged, from which it is given up
MERGED = 0.5  # share of the search for charts that has been done then
LOOPS = 300  # handles and holes above which the regions that charts are grown from hardly matter
CROWD = 300  # more first charts than that are a soup of faces: those that are bad are split in four, not in two


def searched(
    surface: Surface,
    options: MergeOptions,
    worker: Worker,
    monitor: Monitor,
    begin: Callable[[list[Atlas]], None] | None = None,
) -> Atlas:
    """The cheapest atlas of a few starts: each grows charts, merges them, shortens their seams, merges again.

    Starts that are clearly behind when they have merged are given up. options: of merging; their ``search``
    says which starts there are. begin: called with the atlases when their charts have merged; it may raise what
    ends the search.
    """
    seeds = seeds_of(options.search, surface)
    if len(seeds) == 1:
        starts = [grow_and_merge(surface, options, seeds[0], worker, monitor)]
    else:
        tasks = [(surface, options, k, k == seeds[0]) for k in seeds]
        starts = [s for s in worker.map(start_once, tasks, monitor) if s is not None]
    monitor.update(MERGED)
    merged = [start.merger.atlas for start in starts]
    if begin is not None:
        begin(merged)
    if options.search.draft:
        return merged[0]
    cost = np.array([COST.seams(one) for one in merged])
    most = cost.min() if monitor.expired else (1 + BEHIND) * cost.min()
    near = [(starts[k],) for k in np.flatnonzero(cost <= most)]
    ends = [Atlas(surface, *one) for one in worker.map(shortened, near, monitor)]
    return min(ends, key=COST.seams)


def seeds_of(search: Search, surface: Surface) -> list[int]:
    """How many regions each start of a search grows its charts from."""
    faces = len(surface.faces)
    if search.draft:
        return [DRAFT_SEEDS]
    if search.draw:
        return [OTHER_SEEDS[search.draw % len(OTHER_SEEDS)]]
    # so many holes and handles cut the surface up that regions hardly matter
    if complexity(surface) > min(LOOPS, faces / CUT_UP):
        return [SEEDS[0]]
    return [k for k, most in zip(SEEDS, START_FACES, strict=True) if faces <= most]


@dataclass(frozen=True, eq=False)
class Start:
    """Charts that have merged, and what the merging has learnt. crowd: they came from very many."""

    merger: Merger
    crowd: bool


def start_once(
    surface: Surface, options: MergeOptions, seeds: int, needed: bool, monitor: Monitor
) -> Start | None:
    """One start of several; None where it is not needed and there is no time for it."""
    if monitor.expired and not needed:
        return None
    return grow_and_merge(surface, options, seeds, None, monitor)


def grow_and_merge(
    surface: Surface, options: MergeOptions, seeds: int, worker: Worker | None, monitor: Monitor
) -> Start:
    """Grow charts round so many seeds, split what is bad, merge.

    worker: lays half of the charts out where there is nothing better for it to do.
    """
    atlas, crowd = _grown(surface, options.bound, seeds, worker, monitor)
    merger = Merger(atlas, options, np.zeros(len(atlas.cut), bool), worker)
    merger.run(monitor)
    return Start(merger, crowd)


def _grown(
    surface: Surface, bound: float, seeds: int, worker: Worker | None, monitor: Monitor
) -> tuple[Atlas, bool]:
    """(charts grown round so many seeds and split until they are good, whether they are a crowd)."""
    graph = dual_graph(surface)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    first_charts(atlas, graph, seeds)
    make_disks(atlas, graph)
    proposal = propose(atlas, 2)
    atlas.cut = proposal.cut(np.ones(proposal.n, bool))
    make_disks(atlas, graph)
    crowd = atlas.charts()[0] > CROWD
    layouts = lay_out_fresh(atlas, None, HASTY if crowd else ROUGH, worker, monitor)
    for _ in range(12):
        monitor.keep(atlas, sound=False)
        bad = layouts.bad(bound) & (np.bincount(layouts.cut_mesh.chart) > 1)
        if not bad.any():
            break
        was = bad[layouts.cut_mesh.chart]
        split_charts(atlas, graph, layouts.cut_mesh.chart, bad, 4 if bad.sum() > CROWD else 2)
        make_disks(atlas, graph)
        n, chart = atlas.charts()
        again = np.zeros(n, bool)
        again[chart[was]] = True
        steps = HASTY if bad.sum() > CROWD else ROUGH
        layouts = lay_out_fresh(atlas, again, steps, worker, monitor)
    return atlas, crowd


def shortened(start: Start, monitor: Monitor) -> tuple[BoolArray, FloatArray]:
    """(cut, corners) of a start with its seams shortened and merged again."""
    merger, atlas, options = start.merger, start.merger.atlas, start.merger.options
    _, before = atlas.charts()
    arcs = arcs_of(atlas, before)
    steps = HASTY if start.crowd else BRISK
    shorten_seams(atlas, options.bound, steps, 3, margin=options.margin)
    merger.seams_moved(before, arcs)
    merger.run(monitor)
    return atlas.cut, atlas.corners
