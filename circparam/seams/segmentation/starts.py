"""Starts of a search for charts: regions grown round seeds, split until they are good, and merged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import ROUGH
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
from circparam.seams.segmentation.unions import MergeOptions

CUT_UP = 20  # faces: a surface with fewer for each hole and handle is cut up by them
# regions that each start of a search grows its charts from, and faces of the largest surface that it is made
# on: one start alone costs 3 % more (seams and charts of 74 small meshes, two rotations each)
SEEDS = (60, 12, 30, 100)
START_FACES = (1 << 62, 6000, 1500, 1500)
DRAFT_SEEDS = 12  # regions of the one start of a draft
OTHER_SEEDS = (30, 20, 12, 45, 8, 60)  # of the one start of each search that more effort makes
HASTY = replace(ROUGH, max_iterations=6)
LOOPS = 300  # handles and holes above which the regions that charts are grown from hardly matter
CROWD = 300  # more first charts than that are a soup of faces: those that are bad are split in four, not in two


def searched(surface: Surface, options: MergeOptions, worker: Worker, monitor: Monitor) -> Atlas:
    """The cheapest atlas of a few starts, each of which grows charts and merges them.

    options: of merging; their ``search`` says which starts there are.
    """
    seeds = seeds_of(options.search, surface)
    if len(seeds) == 1:
        return grow_and_merge(surface, options, seeds[0], worker, monitor)
    tasks = [(surface, options, k, k == seeds[0]) for k in seeds]
    found = [Atlas(surface, *one) for one in worker.map(start_once, tasks, monitor) if one]
    return min(found, key=COST.seams)


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
    atlas = _grown(surface, options.bound, seeds, worker, monitor)
    Merger(atlas, options, np.zeros(len(atlas.cut), bool), worker).run(monitor)
    return atlas


def _grown(
    surface: Surface, bound: float, seeds: int, worker: Worker | None, monitor: Monitor
) -> Atlas:
    """Charts grown round so many seeds and split until they are good."""
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
    return atlas
