"""Charts of organic surfaces: decided on a coarse proxy, and those of large surfaces level by level."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from circparam.core import clock
from circparam.core.arrays import BoolArray, FloatArray, IntArray, dot
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, DeferredTask, Worker, in_parts
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.cost import COST
from circparam.seams.decided import Decided, beside
from circparam.seams.finish import (
    LEVEL_FACES,
    MARGIN,
    NextBest,
    begun,
    finish,
    plain_finished,
)
from circparam.seams.multires.decimate import Proxy, decimate, priced, proxy_faces
from circparam.seams.multires.holes import close_small_holes, complexity, without_fans
from circparam.seams.multires.roughness import roughness
from circparam.seams.multires.transfer import from_level, transfer_to_fine
from circparam.seams.multires.transfer_layout import nearest_coarse_face
from circparam.seams.options import SeamOptions
from circparam.seams.prices import with_visibility
from circparam.seams.reached import in_time
from circparam.seams.segmentation.decide import (
    better_in_all,
    decide,
    merge_on,
    merge_on_once,
    merged_on,
    nearly_flat_components,
)
from circparam.seams.segmentation.enforce import breaks_up
from circparam.seams.segmentation.grow import DualGraph, dual_graph
from circparam.seams.segmentation.starts import LOOPS
from circparam.seams.segmentation.unions import ENOUGH, MergeOptions
from circparam.seams.stretch import best_held, held_level
from circparam.seams.tiny_components import tiny_atlas, tiny_components
from circparam.solvers.newton import RelaxOptions

DIRECT_FACES = 3_500  # up to this size charts are decided on the mesh itself
# share of the faces of a mesh that the proxy of a draft has where the usual one is too smooth: drafts of five
# such meshes take 0.80 times as long in the mean (0.59 to 0.96), and cost 1.04 times as much (0.89 to 1.21)
DETAILED = 1 / 20
WORTH_IT = 0.7  # a proxy that keeps more of the faces (many small components) is no use
SHARED_FACES = 500  # from this size on starts are shared with other processes
PROXY_MARGIN = 0.01  # on the proxy, whose boundaries are only about those of the mesh
TRANSFER_COST = 30.0  # seconds after the proxy over those of the repair: 22 to 38 from 40k faces on
DECIDING = 0.4  # of the time that is left, at least, for charts on the proxy
SLACK = 0.01  # share of the bound's excess over 1 that seams on the proxy leave for the fine mesh
LEAST_LEVEL, LEVEL_RATIO = 60_000, 12  # faces of a level, and at most so many times fewer
OTHER_PROXIES = (2.25,)  # times the faces of the proxy of a level: charts decided on those compete
LEVEL_SLACK = 0.08  # as SLACK, for the mesh after a level: splitting large charts gives less back
# faces, above which the next best level is not finished beside the best: for memory
MOST_BESIDE = 1_000_000
SMALL_FACES = 25_000  # up to which charts merged on the proxy are always tried on the mesh too
BROKEN = 0.5  # of what the next best level costs, above which that is tried on the mesh too
MOST_LOST = 0.7  # of the bound's excess that is given up to roughness: beyond it charts are split
UNEVEN = 1.3  # times the mean roughness: half of the charts have more, and pieces of those more yet
LOCAL = RelaxOptions(tolerance=1e-4, max_iterations=3, local=8)  # from a level on


def grown_atlas(
    surface: Surface,
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
    target: int | None = None,
) -> Atlas:
    """Decide the seams of a surface on a coarse proxy (of ``target`` faces) and lay its charts out.

    Components that need no seam are found on the surface itself.
    """
    worker = Worker(monitor.jobs if len(surface.faces) > SHARED_FACES else 1)
    if options.max_charts is None and options.min_chart_faces == 1:
        tiny = tiny_components(surface)
        if tiny.any():
            surface = with_visibility(surface, options, monitor, LEVEL_FACES)
            atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
            atlas.put(tiny, tiny_atlas(surface.part(tiny), bound, worker, monitor))
            monitor.keep(atlas.part(tiny))
            if not tiny.all():
                rest = surface.part(~tiny)
                atlas.put(~tiny, grown_atlas(rest, bound, options, monitor, notes, target))
            return atlas
    atlas, bent = Atlas(surface, np.zeros(len(surface.edges), bool)), np.ones(1, bool)
    if len(surface.faces) > DIRECT_FACES:
        with monitor.stage("charts"):
            bent = ~nearly_flat_components(atlas, bound)
        if not bent.all():
            monitor.keep(atlas.part(~bent), sound=False)
    if bent.all():
        decided = _decided(surface, bound, options, worker, monitor, target)
    else:
        if some := bent.any():  # what is nearly flat needs no seam that could be hidden
            atlas.surface = surface = with_visibility(surface, options, monitor, LEVEL_FACES)
        decided = Decided(atlas, dual_graph(surface))
        if some:
            own = surface.part(bent)
            if len(surface.faces) > LEVEL_FACES:  # both would have all of it side by side
                surface.forget()
            part = _decided(own, bound, options, worker, monitor, target, on=False)
            decided = beside(decided, bent, part)
    return _finished(decided, bound, options, worker, monitor, notes)


def _finished(
    decided: Decided,
    bound: float,
    options: SeamOptions,
    worker: Worker,
    monitor: Monitor,
    notes: list[str],
) -> Atlas:
    """The atlas as it is on the surface itself: as it was decided, or the next best where that breaks.

    One large chart keeps one process busy; what it may give way to is made by another meanwhile.
    """
    merged, make = decided.atlas, decided.plain
    if make is None:
        finish(decided, bound, options, worker, monitor, notes)
        return merged
    whole, chart = merged.charts()
    count, one_part = len(chart), len(in_parts(chart)) == 1
    ahead = None
    if SMALL_FACES < count <= LEVEL_FACES:
        ahead = DeferredTask(monitor.jobs, begun, (make,), monitor)
        if one_part:
            ahead.begin()
        with monitor.stage("enforce"):
            bad = breaks_up(merged, decided.graph, bound, decided.relaxing, monitor)
        if ahead.begun:
            make = partial(_as_begun, decided, ahead)
        if bad > 1:
            decided = make(monitor)
            finish(decided, bound, options, worker, monitor, notes)
            return decided.atlas
    other = DeferredTask(monitor.jobs, plain_finished, (make, bound, options), monitor)
    # of more faces in several parts, what splits merged charts has more use for the processes
    if count < PARTED or (one_part and ahead is None and count <= MOST_BESIDE):
        other.begin()
    rest = NextBest(merged.surface, other)
    finish(decided, bound, options, worker, monitor, notes, rest if decided.most else None)
    # where merging on the proxy holds on the mesh, the charts that were not merged on are hardly better
    if not rest.taken and (merged.charts()[0] <= whole or COST.seams(merged) <= decided.most):
        return merged
    plain = rest.atlas
    if decided.most:
        return merged if COST.seams(merged) <= COST.seams(plain) and not rest.taken else plain
    with monitor.stage("charts"):
        done = worker.map(merge_on_once, [(a, bound, MARGIN / 2) for a in (plain, merged)], monitor)
    for one, now in zip((plain, merged), done, strict=True):
        one.cut, one.corners, one.merged_on = now
    return merged if better_in_all(merged, plain) else plain


def _as_begun(decided: Decided, ahead: DeferredTask, monitor: Monitor) -> Decided:
    """The next best atlas, as another process has begun it."""
    with monitor.stage("carry"):
        cut, corners, relaxed = ahead.result()
        atlas = Atlas(decided.atlas.surface, cut, corners)
    return decided._replace(atlas=atlas, plain=None, relaxed=relaxed)


def _decided(
    surface: Surface,
    bound: float,
    options: SeamOptions,
    worker: Worker,
    monitor: Monitor,
    target: int | None = None,
    on: bool = True,
) -> Decided:
    """Seams before the last relaxation, decided on the surface or on its proxy.

    target: faces of the proxy, None as its size has it. on: whether charts are merged on there if that may be
    gone back on.
    """
    if complexity(surface) > LOOPS:
        surface = with_visibility(surface, options, monitor, LEVEL_FACES)
        closed = close_small_holes(surface)
        if complexity(closed) <= complexity(surface) / 2:
            found = _decided(closed, bound, options, worker, monitor)
            return Decided(without_fans(found.atlas, surface), dual_graph(surface), found.relaxing)
    count, graph = len(surface.faces), dual_graph(surface)
    twice = on and target is None
    twice &= (
        options.max_charts is None and options.min_chart_faces == 1 and not options.search.draft
    )
    if count > LEVEL_FACES and options.max_charts is None:
        return _from_level(surface, graph, bound, options, worker, monitor)
    proxy, most = None, options.max_charts

    def prices() -> FloatArray | None:
        fine = with_visibility(surface, options, monitor)
        return fine.price if proxy is None else priced(proxy.surface, fine, proxy.cell).price

    how = most, worker, monitor, prices
    with monitor.stage("charts"):
        if count > (DIRECT_FACES // 2 if options.search.draft else DIRECT_FACES):
            fewer_faces = target or proxy_faces(surface, options.search.draft)
            proxy = decimate(surface, fewer_faces) if fewer_faces < count else None
        if proxy is None or len(proxy.surface.faces) > WORTH_IT * count:
            proxy = None
            merging = MergeOptions(bound, margin=MARGIN, search=options.search)
            return Decided(decide(surface, merging, *how), graph)
        proxy = _detailed(surface, proxy, bound) if options.search.draft else proxy
        inner = 1 + (bound - 1) * (1 - SLACK)
        merging = MergeOptions(inner, margin=PROXY_MARGIN, search=options.search)
        with _before_transfer(monitor):
            search = partial(decide, proxy.surface, merging, *how)
            coarse = other = in_time(proxy.surface, search, monitor)
            if twice and not monitor.expired:
                other = in_time(proxy.surface, partial(_merged_on, coarse, inner, monitor), monitor)
    with monitor.stage("carry"):
        # prices have done their part: paths that heed them edge by edge are longer, and cost charts
        blind = surface.unpriced()
        if options.search.draft:
            carried = transfer_to_fine(blind, graph, coarse, proxy)
            return Decided(carried, graph, _relaxing(bound, options))
        if other.charts()[0] >= coarse.charts()[0]:
            return Decided(transfer_to_fine(blind, graph, coarse, proxy), graph)
        plain = partial(_carried, blind, graph, coarse, proxy)
        return Decided(transfer_to_fine(blind, graph, other, proxy), graph, plain=plain)


def _detailed(surface: Surface, proxy: Proxy, bound: float) -> Proxy:
    """The proxy of a draft; a larger one where the faces of the mesh lean too far against those of the proxy.

    Laid onto the proxy, a face is narrowed by the cosine of its angle. If the mean loss exceeds what the bound
    allows, charts of the proxy break on the mesh, and to cut them there takes most of a draft.
    """
    faces = int(DETAILED * len(surface.faces))
    if faces <= len(proxy.surface.faces):
        return proxy
    near = nearest_coarse_face(surface, proxy)
    cosine = (surface.normals * proxy.surface.normals[near]).sum(1)
    weight = np.where(near >= 0, surface.areas, 0.0)
    lost = 1 - dot(weight, cosine) / max(float(weight.sum()), 1e-300)
    return decimate(surface, faces) if lost > bound - 1 else proxy


def _relaxing(bound: float, options: SeamOptions) -> RelaxOptions:
    """How far charts from a smaller surface are relaxed; those of a draft no further than the bound needs."""
    enough = 1 + ENOUGH * (bound - 1)
    return dataclasses.replace(LOCAL, bound=enough) if options.search.draft else LOCAL


@contextmanager
def _before_transfer(monitor: Monitor) -> Iterator[None]:
    """Inside, time is kept for carrying over what a smaller surface has reached by then."""
    later = TRANSFER_COST * monitor.seconds.get("repair", 0.0)
    with monitor.holding(later, least=DECIDING), clock.bounded(monitor.last):
        yield


def _merged_on(coarse: Atlas, bound: float, monitor: Monitor) -> Atlas:
    """As ``merged_on``, from what has been reached."""
    monitor.keep(coarse)
    return merged_on(coarse, bound, monitor)


def _carried(
    surface: Surface, graph: DualGraph, coarse: Atlas, proxy: Proxy, monitor: Monitor
) -> Decided:
    """An atlas of the proxy carried over."""
    with monitor.stage("carry"):
        return Decided(transfer_to_fine(surface, graph, coarse, proxy), graph)


def level_faces(surface: Surface) -> int:
    """How many faces the level of a large surface should have."""
    return max(LEAST_LEVEL, len(surface.faces) // LEVEL_RATIO)


def _from_level(
    surface: Surface,
    graph: DualGraph,
    bound: float,
    options: SeamOptions,
    worker: Worker,
    monitor: Monitor,
) -> Decided:
    """Charts made with all steps on a smaller surface, carried over: those of a large one cost as little.

    What the next best of that surface promised, and a half more, is what they may come to.
    """
    with monitor.stage("charts"):
        level = decimate(surface, level_faces(surface))
    middle = level.surface
    with monitor.stage("charts"):
        near = nearest_coarse_face(surface, level)
        rough = UNEVEN * roughness(surface, middle, near)
        lost = min(rough, MOST_LOST * (bound - 1))
    middle = with_visibility(middle, options, monitor)
    inner = 1 + (bound - 1) * (1 - LEVEL_SLACK) - lost
    with _before_transfer(monitor):
        tried = _levels(middle, inner, options, worker, monitor)
        best, other = best_held(tried, inner, options, worker, monitor)
    with monitor.stage("carry"):
        # another surface would have areas, normals and all else of its own
        blind = surface.unpriced()
        atlas = from_level(blind, graph, best, level, near)
        if other is None:
            return Decided(atlas, graph, _relaxing(inner, options))
        # it may be never, and is late: what the surface has worked out is not kept for that
        bare = dataclasses.replace(surface.unpriced())
        plain = partial(_next_best, bare, other, inner, options, level, near)
        return Decided(atlas, graph, LOCAL, plain, (1 + BROKEN) * COST.seams(other))


def _levels(
    middle: Surface, bound: float, options: SeamOptions, worker: Worker, monitor: Monitor
) -> list[Atlas]:
    """Atlases of a level, decided on proxies of several sizes where it is not too large itself."""
    targets = [proxy_faces(middle, options.search.draft)]
    if len(middle.faces) <= LEVEL_FACES and not options.search.draft:
        targets += [int(k * targets[0]) for k in OTHER_PROXIES]
    tasks = [(middle, bound, options, k, k == targets[0]) for k in targets]
    # the caller takes the first, and what others have done with theirs sooner shares the rest of it
    turn = -1 if monitor.jobs > 1 else 1
    found = worker.map(_level_atlas, tasks[::turn], monitor)[::turn]
    return [Atlas(middle, *t) for t in found if t]


def _next_best(
    surface: Surface,
    coarse: Atlas,
    bound: float,
    options: SeamOptions,
    level: Proxy,
    near: IntArray,
    monitor: Monitor,
) -> Decided:
    """As ``from_level``, with the stretch of the level held first, and all that it takes made anew."""
    held = Atlas(level.surface, *held_level(coarse, bound, options, True, monitor))
    with monitor.stage("carry"):
        graph = dual_graph(surface)
        return Decided(from_level(surface, graph, held, level, near), graph, LOCAL)


def _level_atlas(
    surface: Surface,
    bound: float,
    options: SeamOptions,
    target: int,
    needed: bool,
    monitor: Monitor,
) -> tuple[BoolArray, FloatArray] | None:
    """(cut, corners) of a level, decided on a proxy of so many faces; None where there is no time for it."""
    if monitor.expired and not needed:
        return None
    with monitor.shown_as("level"):
        search = partial(grown_atlas, surface, bound, options, monitor, [], target)
        atlas = in_time(surface, search, monitor)
        if options.min_chart_faces == 1 and not options.search.draft:
            with monitor.stage("charts"):
                merge_on(atlas, bound, MARGIN, monitor)
    return atlas.cut, atlas.corners
