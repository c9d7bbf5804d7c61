"""Starts of a search for charts: regions grown, merged, their seams shortened, and merged again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
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
from circparam.solvers.newton import RelaxOptions

CUT_UP = 20  # faces: a surface with fewer for each hole and handle is cut up by them
SEEDS = (60, 12, 30, 100)  # regions that charts are grown from, start by start
START_FACES = (1 << 62, 6000, 1500, 1500)  # up to this size a start is made
DRAFT_SEEDS = 12  # regions of the one start of a draft
OTHER_SEEDS = (30, 20, 12, 45, 8, 60)  # of other draws, in turn: each is a start of its own
# faces up to which starts merge in one system: less work there, which is done when another process is ready.
# On surfaces in several pieces they do too: alone they end with other last digits, two pages a tenth less full
TOGETHER = 1500
# share by which a start costs more when it has merged, from which it is given up: of 15 meshes none of them won
BEHIND = 0.1
ROUGH = RelaxOptions(tolerance=1e-3, max_iterations=25, bound=1.01)
HASTY = RelaxOptions(tolerance=1e-3, max_iterations=6, bound=1.01)
FAIR = RelaxOptions(tolerance=1e-4, max_iterations=30)
# charts whose seams are shortened: the tolerance of FAIR takes a fifth more steps, for seams none the better
BRISK = RelaxOptions(tolerance=1e-3, max_iterations=30)
MERGED, SHORTENED = 0.5, 0.9  # share of the search for charts that has been done then
LOOPS = 300  # handles and holes above which the regions that charts are grown from hardly matter
CROWD = 300  # more first charts than that are a soup of faces: those that are bad are split in four, not in two


def best_of_starts(
    surface: Surface,
    options: MergeOptions,
    worker: Worker,
    monitor: Monitor,
    begin: Callable[[list[Atlas]], None] | None = None,
    alone: bool = False,
) -> Atlas:
    """Grow, merge and shorten charts: the best of a few starts where that is cheap.

    Starts that are clearly behind when they have merged are not gone on with. options: of merging; their
    ``search`` says how many starts there are. begin: called with the starts when they have merged and what is
    left keeps one process busy, hardly more; it may raise what ends the search. alone: starts of several pieces
    merge alone too, as those of levels always have: in one system they
    end with other last digits, and a scan of 0.33 million faces had 55 charts in place of 45.
    """
    begin = begin or _nothing
    seeds = seeds_of(options.search, len(surface.faces))
    # so many holes and handles cut the surface up that regions hardly matter
    if complexity(surface) > min(LOOPS, len(surface.faces) / CUT_UP):
        seeds = seeds[:1]
    if len(seeds) == 1:
        start = grow_and_merge(surface, options, seeds[0], worker, monitor)
        monitor.update(MERGED)
        begin([start.merger.atlas])
        return shortened(start, monitor)
    if len(surface.faces) <= TOGETHER or (surface.components[0] > 1 and not alone):
        starts = merged_together(surface, options, seeds, monitor)
    else:
        tasks = [(surface, options, k, k == seeds[0]) for k in seeds]
        starts = [s for s in worker.map(start_once, tasks, monitor) if s]
    merged = [start.merger.atlas for start in starts]
    monitor.update(MERGED)
    begin(merged)
    cost = np.array([COST.seams(one) for one in merged])
    near = np.flatnonzero(cost <= (1 + BEHIND) * cost.min())
    if monitor.expired:
        near = np.array([int(cost.argmin())])
    were = [merged[k].cut.copy() for k in near]
    done = worker.map(shorten_once, [(starts[k],) for k in near], monitor)
    ends = [Atlas(surface, *one) for one in done]
    monitor.update(SHORTENED)
    best = int(np.argmin([COST.seams(end) for end in ends]))
    # what is won by a second time, 5 % at most, hardly ever makes another one the best
    shorten_again(ends[best], were[best], options, starts[near[best]].crowd)
    return ends[best]


def seeds_of(search: Search, faces: int) -> list[int]:
    """How many regions each start of a search grows its charts from, on a surface of so many faces."""
    if search.draft:
        return [DRAFT_SEEDS]
    if search.draw:
        return [OTHER_SEEDS[search.draw % len(OTHER_SEEDS)]]
    return [k for k, most in zip(SEEDS, START_FACES, strict=True) if faces <= most]


def _nothing(merged: list[Atlas]) -> None:
    pass


@dataclass(frozen=True, eq=False)
class Start:
    """Charts that have merged, and what the merging has learnt. crowd: they came from very many."""

    merger: Merger
    crowd: bool


def start_once(
    surface: Surface, options: MergeOptions, seeds: int, needed: bool, monitor: Monitor
) -> Start | None:
    """One start; None where it is not needed and there is no time for it."""
    if monitor.expired and not needed:
        return None
    return grow_and_merge(surface, options, seeds, None, monitor)


def shorten_once(start: Start, monitor: Monitor) -> tuple[BoolArray, FloatArray]:
    """(cut, corners) of a start when its seams are short, but for a second time."""
    atlas = shortened_and_merged(start, monitor)
    return atlas.cut, atlas.corners


def grow_and_merge(
    surface: Surface,
    options: MergeOptions,
    seeds: int,
    worker: Worker | None,
    monitor: Monitor,
) -> Start:
    """Grow charts round so many seeds, split what is bad, merge.

    worker: lays half of the charts out where there is nothing better for it to do.
    """
    atlas, crowd = _grown(surface, options.bound, seeds, worker, monitor)
    merger = Merger(atlas, options, np.zeros(len(atlas.cut), bool), worker)
    merger.run(monitor)
    return Start(merger, crowd)


def merged_together(
    surface: Surface, options: MergeOptions, seeds: list[int], monitor: Monitor
) -> list[Start]:
    """The starts from so many seeds each, merged side by side: on small surfaces calls are what trials cost."""
    grown: list[tuple[Atlas, bool]] = []
    for k in seeds:
        if not (monitor.expired and grown):
            grown.append(_grown(surface, options.bound, k, None, monitor))
    cut = np.concatenate([atlas.cut for atlas, _ in grown])
    corners = np.concatenate([atlas.corners for atlas, _ in grown])
    all_of_them = Atlas(surface.copies(len(grown)), cut, corners)
    merger = Merger(all_of_them, options, np.zeros(len(cut), bool))
    e, m = len(surface.edges), len(surface.faces)

    def one_of(copies: Atlas, k: int) -> Atlas:
        mine, faces = slice(k * e, (k + 1) * e), slice(k * m, (k + 1) * m)
        return Atlas(surface, copies.cut[mine], copies.corners[faces])

    def keep(copies: Atlas, sound: bool) -> None:
        if copies is all_of_them:
            for k in range(len(grown)):
                monitor.keep(one_of(copies, k), sound)

    with monitor.keeping(keep):
        merger.run(monitor)
    starts = []
    for k, (_, crowd) in enumerate(grown):
        mine = slice(k * e, (k + 1) * e)
        of_one = Merger(one_of(merger.atlas, k), options, np.zeros(e, bool))
        of_one.lower_bound, of_one.failed = merger.lower_bound[mine], merger.failed.part(mine)
        starts.append(Start(of_one, crowd))
    return starts


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


def shortened(start: Start, monitor: Monitor) -> Atlas:
    """Shorten the seams, merge again, and shorten once more where that changed anything."""
    was = start.merger.atlas.cut.copy()
    atlas = shortened_and_merged(start, monitor)
    shorten_again(atlas, was, start.merger.options, start.crowd)
    return atlas


def shortened_and_merged(start: Start, monitor: Monitor) -> Atlas:
    """Shorten the seams and merge again."""
    merger, atlas = start.merger, start.merger.atlas
    _, before = atlas.charts()
    arcs = arcs_of(atlas, before)
    options = merger.options
    steps = HASTY if start.crowd else BRISK
    shorten_seams(atlas, options.bound, steps, 3, margin=options.margin)
    merger.seams_moved(before, arcs)
    merger.run(monitor)
    return atlas


def shorten_again(atlas: Atlas, was: BoolArray, options: MergeOptions, crowd: bool) -> None:
    """Shorten seams in a narrow band where they are others than those that were there ((e,) bool)."""
    if not options.search.draft and (atlas.cut != was).any():
        steps = HASTY if crowd else BRISK
        shorten_seams(atlas, options.bound, steps, 1, margin=options.margin)
