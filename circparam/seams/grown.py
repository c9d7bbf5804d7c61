"""Charts of organic surfaces: decided on a coarse proxy, and those of large surfaces level by level."""

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from circparam.core import clock
from circparam.core.monitor import Monitor
from circparam.core.workers import in_processes
from circparam.errors import OutOfTimeError
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import AIMED, FINAL, LOCAL
from circparam.seams.cost import COST
from circparam.seams.evaluate import MARGIN
from circparam.seams.finish import LEVEL_FACES, Decided, finish
from circparam.seams.moves.glue import MergeOptions
from circparam.seams.moves.reroute import move_seams
from circparam.seams.multires.decimate import Proxy, decimate, priced, proxy_faces
from circparam.seams.multires.holes import close_small_holes, complexity, without_fans
from circparam.seams.multires.roughness import with_roughness
from circparam.seams.multires.transfer import from_level, transfer_to_fine
from circparam.seams.multires.transfer_layout import nearest_coarse_face
from circparam.seams.options import SeamOptions
from circparam.seams.prices import LATER_REPAIRS, with_visibility
from circparam.seams.reached import in_time
from circparam.seams.segmentation.decide import (
    DIRECT_FACES,
    REGIONS,
    decide,
    merge_on,
    merged_on,
    starts_of,
)
from circparam.seams.segmentation.grow import DualGraph
from circparam.seams.stretch import stretch_held
from circparam.seams.tiny_components import tiny_components
from circparam.solvers.newton import RelaxOptions

LOOPS = 300  # handles and holes above which small holes are closed while charts are decided
# of the faces: a proxy or a level that keeps more (many small components) is no use
PROXY_MOST_SHARE = 0.5
DECIDING_SHARE = 0.5  # of the time that is left, at least, for charts on the proxy
LEAST_LEVEL, LEVEL_RATIO = 60_000, 12  # faces of a level, and at most so many times fewer
# the same as LEVEL_FACES in drafts, whose levels may be as small as the ratio makes them: of 65,000 to 124,000
# faces they take 0.8 of the time without a level (docs/experiments/draft-profile.md)
DRAFT_LEVEL_FACES = 50_000
LEVEL_STEPS = dataclasses.replace(FINAL, max_iterations=3, local=LOCAL)  # from a level on


def grown_atlas(surface: Surface, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """Decide the seams of a surface on a coarse proxy and lay its charts out.

    Components that need none, and thousands of tiny ones, are laid out on the surface itself.
    """
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    rest = np.ones(len(surface.faces), bool)
    if options.max_charts is None and options.min_chart_faces == 1:
        rest = ~tiny_components(surface)
    if not rest.all():
        atlas.surface = surface = with_visibility(surface, options, monitor, LEVEL_FACES)
        with monitor.stage("charts"):  # one start: they cover a twentieth of a page
            part, merging = surface.part(~rest), MergeOptions(bound)
            atlas.put(~rest, decide(part, merging, [REGIONS], None, monitor))
        monitor.keep(atlas.part(~rest))
    if rest.any():
        own = surface.part(rest)
        if own is not surface and len(surface.faces) > LEVEL_FACES:
            surface.forget()  # both would have all that is known of them side by side
        decided = _decided(own, bound, options, monitor)
        finish(decided, bound, options, monitor)
        if own is surface:
            return decided.atlas
        atlas.put(rest, decided.atlas)
    return atlas


def _decided(surface: Surface, bound: float, options: SeamOptions, monitor: Monitor) -> Decided:
    """Seams before the last relaxation, decided on the surface or on its proxy."""
    if complexity(surface) > LOOPS:
        surface = with_visibility(surface, options, monitor, LEVEL_FACES)
        closed = close_small_holes(surface)
        if complexity(closed) <= complexity(surface) / 2:
            decided = _decided(closed, bound, options, monitor)
            atlas = without_fans(decided.atlas, surface)
            return Decided(atlas, DualGraph(surface), decided.relaxing)
    above = DRAFT_LEVEL_FACES if options.search.draft else LEVEL_FACES
    if len(surface.faces) > above and options.max_charts is None:
        with monitor.stage("charts"):
            least = 0 if options.search.draft else LEAST_LEVEL
            level = decimate(surface, max(least, len(surface.faces) // LEVEL_RATIO))
        if len(level.surface.faces) <= PROXY_MOST_SHARE * len(surface.faces):
            return _from_level(surface, level, bound, options, monitor)
    graph, draft = DualGraph(surface), options.search.draft
    with monitor.stage("charts"):
        found = _on_proxies(surface, bound, options, monitor)
        if found is None:
            merging = MergeOptions(bound, search=options.search)
            starts = starts_of(options.search, surface)
            if len(surface.faces) > DIRECT_FACES:
                starts = starts[:1]
            regions = [regions for _, regions in starts]
            atlas = decide(surface, merging, regions, options.max_charts, monitor)
            if not draft:
                atlas = _moved(atlas, surface, None, merging, options, monitor)
            return Decided(atlas, graph)
        proxy, coarse = found
    with monitor.stage("carry"):
        # prices have done their part: paths that heed them edge by edge are longer, and cost charts
        carried = transfer_to_fine(surface.unpriced(), graph, coarse, proxy)
    return Decided(carried, graph, _relaxing(bound, options) if draft else FINAL)


def _on_proxies(
    surface: Surface, bound: float, options: SeamOptions, monitor: Monitor
) -> tuple[Proxy, Atlas] | None:
    """The cheapest atlas of several starts, each on a proxy, with that; None where the surface is as small."""
    merging = MergeOptions(bound, search=options.search)
    if len(surface.faces) <= DIRECT_FACES:
        return None
    starts = starts_of(options.search, surface)
    tasks = [(surface, start, start == starts[0], merging, options) for start in starts]
    with _before_transfer(monitor):
        done = in_processes(_on_proxy, tasks, monitor)
        found = [one for one in done if one is not None]
        if not found:
            return None
        proxy, coarse = min(found, key=lambda one: COST.of_components(one[1], relaxed=True).sum())
        if not options.search.draft:
            if options.max_charts is None and options.min_chart_faces == 1:
                merging_on = partial(merged_on, coarse, bound, monitor)
                coarse = in_time(proxy.surface, merging_on, monitor)
            coarse = _moved(coarse, surface, proxy, merging, options, monitor)
    return proxy, coarse


def _on_proxy(
    surface: Surface,
    start: tuple[float, int],
    needed: bool,
    merging: MergeOptions,
    options: SeamOptions,
    monitor: Monitor,
) -> tuple[Proxy, Atlas] | None:
    """Charts of one start; None without time for it, or where its proxy keeps too many faces."""
    if monitor.expired and not needed:
        return None
    size, regions = start
    faces = proxy_faces(surface, size)
    if faces >= len(surface.faces):
        return None
    proxy = decimate(surface, faces)
    if len(proxy.surface.faces) > PROXY_MOST_SHARE * len(surface.faces):
        return None
    proxy = with_roughness(proxy, surface, merging.bound)
    try:
        make = partial(decide, proxy.surface, merging, [regions], options.max_charts, monitor)
        coarse = in_time(proxy.surface, make, monitor)
    except OutOfTimeError:
        if needed:
            raise
        return None
    return proxy, coarse


def _moved(
    atlas: Atlas,
    surface: Surface,
    proxy: Proxy | None,
    merging: MergeOptions,
    options: SeamOptions,
    monitor: Monitor,
) -> Atlas:
    """The atlas of a surface, or of its proxy, with seams moved to where they are hardly seen."""
    if not atlas.cut.any() or monitor.expired:
        return atlas
    fine = with_visibility(surface, options, monitor)
    price = fine.price if proxy is None else priced(proxy.surface, fine, proxy.cell).price
    out = Atlas(dataclasses.replace(atlas.surface, price=price), atlas.cut, atlas.corners)
    move_seams(out, merging.demands, monitor)
    return Atlas(atlas.surface, out.cut, out.corners)


def _relaxing(bound: float, options: SeamOptions) -> RelaxOptions:
    """How far charts from a smaller surface are relaxed; those of a draft no further than the bound needs."""
    enough = 1 + AIMED * (bound - 1)
    return dataclasses.replace(LEVEL_STEPS, bound=enough) if options.search.draft else LEVEL_STEPS


@contextmanager
def _before_transfer(monitor: Monitor) -> Iterator[None]:
    """Inside, time is kept for carrying over what a smaller surface has reached by then."""
    later = LATER_REPAIRS * monitor.seconds.get("repair", 0.0)
    with monitor.holding(later, least=DECIDING_SHARE), clock.bounded(monitor.last):
        yield


def _from_level(
    surface: Surface, level: Proxy, bound: float, options: SeamOptions, monitor: Monitor
) -> Decided:
    """Charts made with all steps on a smaller surface, carried over: those of a large one cost as little."""
    with monitor.stage("charts"):
        near = nearest_coarse_face(surface, level)
    level = with_roughness(level, surface, bound)
    middle = with_visibility(level.surface, options, monitor)
    with _before_transfer(monitor):
        best = stretch_held(_level_atlas(middle, bound, options, monitor), bound, options, monitor)
    with monitor.stage("carry"):
        # another surface would have areas, normals and all else of its own
        blind, graph = surface.unpriced(), DualGraph(surface)
        atlas = from_level(blind, graph, best, level, near)
    return Decided(atlas, graph, _relaxing(bound, options))


def _level_atlas(surface: Surface, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """The atlas of a level, merged on there: on the surface itself a union costs as many times more."""
    with monitor.shown_as("level"):
        search = partial(grown_atlas, surface, bound, options, monitor)
        atlas = in_time(surface, search, monitor)
        if options.min_chart_faces == 1 and not options.search.draft:
            with monitor.stage("charts"):
                merge_on(atlas, bound, MARGIN, monitor)
    return atlas
