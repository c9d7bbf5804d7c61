"""Thousands of tiny components, as the floaters of a scan are: all at once, in few passes over their faces."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, group_sum
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker, in_parts
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import ROUGH
from circparam.seams.segmentation.decide import whole_components
from circparam.seams.segmentation.grow import dual_graph, make_disks, split_charts
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.unions import MergeOptions

CRUMB = 300  # faces that a tiny component has at most
MANY = 200  # of them: fewer are decided with all others, where every step is tried
NOTHING = 2e-4  # of the area of the surface, up to which a crumb is debris
SPLITS = 10  # rounds of halving: a component of CRUMB faces is single faces then
MERGES = 4  # rounds of merging; three quarters of all unions come in the first two
MARGIN = 0.002  # share of the root of its area that parts of one chart keep apart


def crumbs(surface: Surface) -> BoolArray:
    """(m,) bool: faces of tiny components, where there are many of those."""
    _, component = surface.components
    tiny = np.bincount(component) <= CRUMB
    if tiny.sum() < MANY:
        return np.zeros(len(component), bool)
    result: BoolArray = tiny[component]
    return result


def debris(surface: Surface) -> BoolArray:
    """(m,) bool: crumbs so small in the whole that it does not matter what they are: hard surfaces or not."""
    tiny = crumbs(surface)
    if not tiny.any():
        return tiny
    n, component = surface.components
    share = group_sum(surface.areas, component, n) / surface.areas.sum()
    result: BoolArray = tiny & (share <= NOTHING)[component]
    return result


def crumb_atlas(surface: Surface, bound: float, worker: Worker, monitor: Monitor) -> Atlas:
    """Charts of tiny components: whole where that is good, else in halves that are merged where they fit.

    No proxy, no shortening and no second start: what is a twentieth of the page in all is not worth more.
    """
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    with monitor.stage("charts"):
        parts = in_parts(surface.components[1])
        tasks = [(atlas.part(faces), bound) for faces in parts]
        for faces, part in zip(parts, worker.map(halved, tasks, monitor), strict=True):
            atlas.put(faces, part)
    return atlas


def halved(atlas: Atlas, bound: float, monitor: Monitor) -> Atlas:
    """The charts of some tiny components."""
    rest = ~whole_components(atlas, bound)
    if not rest.any():
        return atlas
    part = atlas.part(rest)
    graph = dual_graph(part.surface)
    n, chart = part.charts()
    split_charts(part, graph, chart, np.ones(n, bool))
    make_disks(part, graph)
    layouts = lay_out_fresh(part, None, ROUGH)
    for _ in range(SPLITS):
        bad = layouts.bad(bound) & (np.bincount(layouts.cut_mesh.chart) > 1)
        if not bad.any():
            break
        was = bad[layouts.cut_mesh.chart]
        split_charts(part, graph, layouts.cut_mesh.chart, bad)
        make_disks(part, graph)
        n, chart = part.charts()
        again = np.zeros(n, bool)
        again[chart[was]] = True
        layouts = lay_out_fresh(part, again, ROUGH)
    options = MergeOptions(bound, margin=MARGIN, rounds=MERGES)
    Merger(part, options, np.zeros(len(part.cut), bool)).run(monitor)
    atlas.put(rest, part)
    return atlas
