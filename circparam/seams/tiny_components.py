"""Thousands of tiny components, as the floaters of a scan are: all at once, in few passes over their faces."""

import numpy as np

from circparam.core.arrays import BoolArray, group_sum
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker, in_parts
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import ROUGH
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.multires.decimate import SMALL_COMPONENT
from circparam.seams.segmentation.decide import whole_components
from circparam.seams.segmentation.grow import dual_graph, make_disks, split_charts
from circparam.seams.segmentation.layout import lay_out_fresh

# components: so many tiny ones skip the search; fewer are searched with all others
MANY_COMPONENTS = 200
# of the area of the surface: a tiny component below this share is not searched as a hard one
DEBRIS_AREA_SHARE = 2e-4


def tiny_components(surface: Surface) -> BoolArray:
    """(m,) bool: faces of components with few faces, where the surface has many such components."""
    _, component = surface.components
    tiny = np.bincount(component) <= SMALL_COMPONENT
    if tiny.sum() < MANY_COMPONENTS:
        return np.zeros(len(component), bool)
    result: BoolArray = tiny[component]
    return result


def debris(surface: Surface) -> BoolArray:
    """(m,) bool: faces of tiny components whose area does not justify asking whether they are hard surfaces."""
    tiny = tiny_components(surface)
    if not tiny.any():
        return tiny
    n, component = surface.components
    share = group_sum(surface.areas, component, n) / surface.areas.sum()
    result: BoolArray = tiny & (share <= DEBRIS_AREA_SHARE)[component]
    return result


def tiny_atlas(surface: Surface, bound: float, worker: Worker, monitor: Monitor) -> Atlas:
    """Charts of tiny components: whole where that is within the bound, else halved and merged again.

    There is no proxy, no shortening and no second start: they cover a twentieth of a page.
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
    while (bad := layouts.bad(bound) & (np.bincount(layouts.cut_mesh.chart) > 1)).any():
        halves = bad[layouts.cut_mesh.chart]
        if not split_charts(part, graph, layouts.cut_mesh.chart, bad).any():
            break
        make_disks(part, graph)
        n, chart = part.charts()
        again = np.zeros(n, bool)
        again[chart[halves]] = True
        layouts = lay_out_fresh(part, again, ROUGH)
    merge(part, MergeOptions(bound), monitor)
    atlas.put(rest, part)
    return atlas
