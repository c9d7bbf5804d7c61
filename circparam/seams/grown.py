"""Charts of organic surfaces: decided on a coarse proxy, and those of large surfaces level by level."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from circparam.core import clock
from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import FINAL
from circparam.seams.cost import COST
from circparam.seams.finish import LEVEL_FACES, MARGIN, Decided, finish
from circparam.seams.prices import with_visibility
from circparam.seams.multires.decimate import Proxy, decimate, priced, proxy_faces
from circparam.seams.multires.holes import close_small_holes, complexity, without_fans
from circparam.seams.multires.roughness import roughness
from circparam.seams.multires.transfer import from_level, transfer_to_fine
from circparam.seams.multires.transfer_layout import nearest_coarse_face
from circparam.seams.options import SeamOptions
from circparam.seams.reached import in_time
from circparam.seams.segmentation.decide import decide, merge_on, merged_on, nearly_flat_components
from circparam.seams.segmentation.grow import dual_graph
from circparam.seams.segmentation.starts import LOOPS
from circparam.seams.segmentation.unions import ENOUGH, MergeOptions
from circparam.seams.stretch import stretch_held
from circparam.seams.tiny_components import tiny_atlas, tiny_components
from circparam.solvers.newton import RelaxOptions

DIRECT_FACES = 3_500  # up to this size charts are decided on the mesh itself
DRAFT_FACES = 1_500  # the same in a draft
WORTH_IT = 0.7  # a proxy that keeps more of the faces (many small components) is no use
SHARED_FACES = 500  # from this size on starts are shared with other processes
PROXY_MARGIN = 0.01  # on the proxy, whose boundaries are only about those of the mesh
TRANSFER_COST = 30.0  # seconds after the proxy over those of the repair: 22 to 38 from 40k faces on
DECIDING = 0.4  # of the time that is left, at least, for charts on the proxy
SLACK = 0.01  # share of the bound's excess over 1 that seams on the proxy leave for the fine mesh
LEAST_LEVEL, LEVEL_RATIO = 60_000, 12  # faces of a level, and at most so many times fewer
OTHER_PROXIES = (2.25,)  # times the faces of the proxy of a level: charts decided on those compete
LEVEL_SLACK = 0.08  # as SLACK, for the mesh after a level: splitting large charts gives less back
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

    Components that need hardly a seam get theirs on the surface itself.
    """
    worker = Worker(monitor.jobs if len(surface.faces) > SHARED_FACES else 1)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    rest = np.ones(len(surface.faces), bool)
    if options.max_charts is None and options.min_chart_faces == 1:
        rest = ~tiny_components(surface)
    if not rest.all():
        atlas.surface = surface = with_visibility(surface, options, monitor, LEVEL_FACES)
        atlas.put(~rest, tiny_atlas(surface.part(~rest), bound, worker, monitor))
        monitor.keep(atlas.part(~rest))
    if rest.sum() > DIRECT_FACES:
        part = atlas.part(rest)
        with monitor.stage("charts"):
            flat = nearly_flat_components(part, bound)
        if flat.any():
            monitor.keep(part.part(flat), sound=False)
            if not flat.all():  # what is nearly flat needs no seam that could be hidden
                atlas.surface = surface = with_visibility(surface, options, monitor, LEVEL_FACES)
            few = part.part(flat)
            finish(Decided(few, dual_graph(few.surface)), bound, options, worker, monitor, notes)
            part.put(flat, few)
            atlas.put(rest, part)
            rest[rest] = ~flat
    if rest.any():
        own = surface.part(rest)
        if own is not surface and len(surface.faces) > LEVEL_FACES:
            surface.forget()  # both would have all that is known of them side by side
        decided = _decided(own, bound, options, worker, monitor, target)
        finish(decided, bound, options, worker, monitor, notes)
        if own is surface:
            return decided.atlas
        atlas.put(rest, decided.atlas)
    return atlas


def _decided(
    surface: Surface,
    bound: float,
    options: SeamOptions,
    worker: Worker,
    monitor: Monitor,
    target: int | None = None,
) -> Decided:
    """Seams before the last relaxation, decided on the surface or on its proxy (of ``target`` faces)."""
    if complexity(surface) > LOOPS:
        surface = with_visibility(surface, options, monitor, LEVEL_FACES)
        closed = close_small_holes(surface)
        if complexity(closed) <= complexity(surface) / 2:
            found = _decided(closed, bound, options, worker, monitor)
            return Decided(without_fans(found.atlas, surface), dual_graph(surface), found.relaxing)
    if len(surface.faces) > LEVEL_FACES and options.max_charts is None:
        return _from_level(surface, bound, options, worker, monitor)
    count, graph, search = len(surface.faces), dual_graph(surface), options.search
    most, proxy = options.max_charts, None
    if count > (DRAFT_FACES if search.draft else DIRECT_FACES):
        with monitor.stage("charts"):
            fewer_faces = target or proxy_faces(surface, search.draft)
            proxy = decimate(surface, fewer_faces) if fewer_faces < count else None
    if proxy is None or len(proxy.surface.faces) > WORTH_IT * count:
        fine = partial(_prices, surface, None, options, monitor)
        merging = MergeOptions(bound, margin=MARGIN, search=search)
        with monitor.stage("charts"):
            return Decided(decide(surface, merging, most, worker, monitor, fine), graph)
    inner = 1 + (bound - 1) * (1 - SLACK)
    merging = MergeOptions(inner, margin=PROXY_MARGIN, search=search)
    prices = partial(_prices, surface, proxy, options, monitor)
    with monitor.stage("charts"), _before_transfer(monitor):
        make = partial(decide, proxy.surface, merging, most, worker, monitor, prices)
        coarse = in_time(proxy.surface, make, monitor)
        free = target is None and most is None and options.min_chart_faces == 1
        if free and not search.draft and not monitor.expired:
            coarse = in_time(proxy.surface, partial(_merged_on, coarse, inner, monitor), monitor)
    with monitor.stage("carry"):
        # prices have done their part: paths that heed them edge by edge are longer, and cost charts
        carried = transfer_to_fine(surface.unpriced(), graph, coarse, proxy)
    return Decided(carried, graph, _relaxing(bound, options) if search.draft else FINAL)


def _prices(
    surface: Surface, proxy: Proxy | None, options: SeamOptions, monitor: Monitor
) -> FloatArray | None:
    """Prices of the edges of a surface, or of its proxy, by their visibility on the surface."""
    fine = with_visibility(surface, options, monitor)
    return fine.price if proxy is None else priced(proxy.surface, fine, proxy.cell).price


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


def _from_level(
    surface: Surface, bound: float, options: SeamOptions, worker: Worker, monitor: Monitor
) -> Decided:
    """Charts made with all steps on a smaller surface, carried over: those of a large one cost as little."""
    with monitor.stage("charts"):
        level = decimate(surface, max(LEAST_LEVEL, len(surface.faces) // LEVEL_RATIO))
        near = nearest_coarse_face(surface, level)
        rough = UNEVEN * roughness(surface, level.surface, near)
    lost = min(rough, MOST_LOST * (bound - 1))
    middle = with_visibility(level.surface, options, monitor)
    inner = 1 + (bound - 1) * (1 - LEVEL_SLACK) - lost
    with _before_transfer(monitor):
        best = min(_levels(middle, inner, options, worker, monitor), key=COST.seams)
        best = stretch_held(best, inner, options, monitor)
    with monitor.stage("carry"):
        # another surface would have areas, normals and all else of its own
        blind, graph = surface.unpriced(), dual_graph(surface)
        atlas = from_level(blind, graph, best, level, near)
    return Decided(atlas, graph, _relaxing(inner, options))


def _levels(
    middle: Surface, bound: float, options: SeamOptions, worker: Worker, monitor: Monitor
) -> list[Atlas]:
    """Atlases of a level, decided on proxies of several sizes where it is not too large itself."""
    targets = [proxy_faces(middle, options.search.draft)]
    if len(middle.faces) <= LEVEL_FACES and not options.search.draft:
        targets += [int(k * targets[0]) for k in OTHER_PROXIES]
    tasks = [(middle, bound, options, k, k == targets[0]) for k in targets]
    found = worker.map(_level_atlas, tasks, monitor)
    return [Atlas(middle, *t) for t in found if t]


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
