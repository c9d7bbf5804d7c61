"""Few charts under a distortion bound: grow, merge, shorten, on a coarse proxy where the mesh is large."""

from __future__ import annotations

import dataclasses

import numpy as np

from circparam.core.arrays import BoolArray
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, Worker, in_parts
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.constraints import constrain
from circparam.seams.hard.charts import hard_atlas, take_better
from circparam.seams.hard.flats import flat_prices, hard_prices, with_flats, with_hard_prices
from circparam.seams.hard.regions import DOUBTFUL, HARD, hardness, seam_prices
from circparam.seams.hard.straighten import straighten
from circparam.seams.hidden import hiding_prices
from circparam.seams.multires.decimate import Proxy, decimate, proxy_faces
from circparam.seams.multires.holes import close_small_holes, complexity, without_fans
from circparam.seams.multires.transfer_layout import (
    drop_slivers,
    fine_targets,
    nearest_coarse_face,
    separate,
)
from circparam.seams.multires.transfer_seams import transfer_seams
from circparam.seams.options import HIDDEN, SeamOptions, Seams
from circparam.seams.segmentation.decide import (
    ANY_BOUND,
    CHART_COST,
    CROWD,
    LOOPS,
    better_in_all,
    decide,
    merge_on,
    nearly_flat_components,
    reach_count,
    worth,
)
from circparam.seams.segmentation.enforce import enforce, relaxed_layouts
from circparam.seams.segmentation.grow import (
    DualGraph,
    dual_graph,
    make_disks,
)
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.small import absorb, small_note
from circparam.seams.segmentation.tail import hold_stretch
from circparam.seams.segmentation.unions import MergeOptions
from circparam.seams.segmentation.weigh import Limits
from circparam.seams.symmetry import Mirror, about_image_of, both_sides, find_mirror, image_of
from circparam.solvers.newton import RelaxOptions
from circparam.solvers.poisson import from_jacobians

DIRECT_FACES = 3_500  # up to this size charts are decided on the mesh itself
WORTH_IT = 0.7  # a proxy that keeps more of the faces (many small components) is no use
SHARED_FACES = 500  # from this size on starts are shared with other processes
DOUBTS = (
    10_000  # faces of components that may be hard surfaces or not, up to which both ways are tried
)
REGROUP_FACES = 20_000  # larger unions than that are not tried on the fine mesh
REGROUPINGS = 3  # rounds of merging on the fine mesh after charts were split there
MARGIN = 0.004  # share of the root of its area that parts of one chart keep apart
PROXY_MARGIN = 0.01  # on the proxy, whose boundaries are only about those of the mesh
TRANSFER_COST = 30.0  # seconds after the proxy over those of the repair: 22 to 38 from 40k faces on
DECIDING = 0.4  # of the time that is left, at least, for charts on the proxy
SLACK = 0.01  # share of the bound's excess over 1 that seams on the proxy leave for the fine mesh
STRETCH = 2.0  # that all but a thousandth of the surface keep to where nothing else is asked for
TRIED_TWICE = (
    25_000  # faces, up to which charts that merged on the proxy are tried beside those that did not
)
SOUP = 1_000  # charts, from which on nobody sees which way a seam runs
STRICT = 1.05  # bound up to which seams are added for that
FINAL = RelaxOptions(tolerance=1e-4, max_iterations=60)


def charts(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    """Seams that leave few charts, each a disk (holes allowed) whose isometric map stays under the bound.

    Returns the seams with the layout (symmetric Dirichlet energy minimised, no flips, no chart overlapping
    itself). Raises OptionError for contradictory seams, and for a symmetry that the surface does not have.
    Deterministic.
    """
    mirror = None if options.symmetry is None else find_mirror(surface, options.symmetry)
    surface, forced, notes = constrain(surface, options)
    hide = options.hide_seams
    if hide is None:  # seams that moved have no distortion left for tips to be held more strictly
        hide = HIDDEN if (options.max_stretch or STRETCH) >= STRETCH else 0.0
    if hide > 0:
        with monitor.stage("visibility"):
            price = hiding_prices(surface, hide)
            surface = dataclasses.replace(surface, price=price)
    if mirror is not None:
        surface = dataclasses.replace(surface, locked=mirror.closed(surface.locked))
        forced = mirror.closed(forced) & ~surface.locked
        notes.append(mirror.note)
    opened = surface.without_edges(forced)
    bound = 1 + (options.max_distortion - 1) * (1 - 1e-4)
    if mirror is None:
        atlas = bounded_atlas(opened, bound, options, monitor, notes)
    else:
        atlas = mirrored_atlas(opened, mirror.without(forced), bound, options, monitor, notes)
    with monitor.stage("stretch"):
        if monitor.expired:
            return _seams(atlas, forced, notes)
        # who allows more distortion wants fewer seams: then none are added for a stretch nobody asked for
        asked = options.max_stretch is not None or options.max_distortion <= STRICT
        free = asked and options.max_charts is None and options.min_chart_faces == 1
        limits = Limits(bound, options.max_stretch or STRETCH)
        hold_stretch(atlas, limits, monitor, asked and mirror is None, free)
    if mirror is None:
        with monitor.stage("charts"):
            straighten_parts(atlas, limits, monitor)
    return _seams(atlas, forced, notes)


def _seams(atlas: Atlas, forced: BoolArray, notes: list[str]) -> Seams:
    """The seams of the opened surface and those that were demanded."""
    cut = forced.copy()
    cut[~forced] = atlas.cut
    return Seams(cut, atlas.corners, notes)


def straighten_parts(atlas: Atlas, limits: Limits, monitor: Monitor) -> None:
    """Move seams to cheaper paths: on hard components all of them, on others where they have flats."""
    if atlas.charts()[0] > SOUP:
        return
    hard = with_hard_prices(atlas)
    for which, priced in ((hard, seam_prices), (with_flats(atlas.surface) & ~hard, flat_prices)):
        if not which.any() or not atlas.cut.any():
            continue
        part = atlas.part(which)
        part = Atlas(part.surface, part.cut, part.corners, priced(part.surface))
        straighten(part, limits, monitor)
        atlas.put(which, part)


def mirrored_atlas(
    surface: Surface,
    mirror: Mirror,
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
) -> Atlas:
    """The atlas of one half on both, then whatever charts of both may be glued where they meet."""
    if options.max_charts is not None:
        options = dataclasses.replace(options, max_charts=max(options.max_charts // 2, 1))
    half = bounded_atlas(surface.part(mirror.half), bound, options, monitor, notes)
    if mirror.images is not None:
        other = image_of(surface, mirror, mirror.images, half)
    else:
        with monitor.stage("carry"):
            rest = surface.part(~mirror.half)
            graph = dual_graph(rest)
            other = transfer_to_fine(rest, graph, *about_image_of(mirror, half, rest))
        worker = Worker(monitor.jobs if len(rest.faces) > PARTED else 1)
        finish(other, graph, bound, options, worker, monitor, notes)
    atlas, between = both_sides(surface, mirror, half, other)
    with monitor.stage("charts"):
        Merger(atlas, MergeOptions(bound, margin=MARGIN / 2), ~between).run(monitor)
        atlas.cut = mirror.closed(atlas.cut)
        if not_disks(atlas.cut_mesh()).any():
            make_disks(atlas, dual_graph(surface))
    return atlas


def bounded_atlas(
    surface: Surface, bound: float, options: SeamOptions, monitor: Monitor, notes: list[str]
) -> Atlas:
    """Decide the seams of a surface and lay its charts out: hard components from their regions.

    A number of charts is reached from the atlas without one, so that it never leads to more.
    """
    most = options.max_charts
    if most is None:
        return free_atlas(surface, bound, options, monitor, notes)
    free = dataclasses.replace(options, max_charts=None)
    atlas = free_atlas(surface, bound, free, monitor, notes)
    count = atlas.charts()[0]
    pieces, _ = surface.components
    if count <= max(most, pieces) or monitor.expired:
        return atlas
    tried = [atlas, grown_atlas(surface, bound, options, monitor, notes)]
    if len(surface.faces) <= REGROUP_FACES and count <= CROWD:
        merged = Atlas(surface, atlas.cut.copy(), atlas.corners.copy())
        with monitor.stage("charts"):
            reach_count(merged, bound, most, monitor)
        tried.append(merged)
    best = min(tried, key=lambda one: worth(one, most, bound))
    best.prices = atlas.prices
    return best


def free_atlas(
    surface: Surface, bound: float, options: SeamOptions, monitor: Monitor, notes: list[str]
) -> Atlas:
    """As many charts as the bound needs, and no more than can be had at the same distortion."""
    atlas = _first_atlas(surface, bound, options, monitor, notes)
    if options.min_chart_faces == 1:  # else small charts are what decides who joins whom
        with monitor.stage("charts"):
            merge_on(atlas, bound, MARGIN / 2, monitor)
    return atlas


def _first_atlas(
    surface: Surface, bound: float, options: SeamOptions, monitor: Monitor, notes: list[str]
) -> Atlas:
    """Hard components from their regions, the others grown."""
    kind = hardness(surface)
    hard, doubtful = kind == HARD, kind == DOUBTFUL
    doubtful &= doubtful.sum() <= DOUBTS
    if not (hard | doubtful).any():
        return grown_atlas(surface, bound, options, monitor, notes)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    if not hard.all():
        atlas.put(~hard, grown_atlas(surface.part(~hard), bound, options, monitor, notes))
    worker = Worker(monitor.jobs if hard.sum() > PARTED else 1)
    if hard.any():
        atlas.put(hard, hard_atlas(surface.part(hard), bound, options, worker, monitor, notes))
    if doubtful.any() and not monitor.expired:
        other = hard_atlas(surface.part(doubtful), bound, options, worker, monitor, notes)
        hard |= take_better(atlas, doubtful, other, CHART_COST)
    if hard.any():
        atlas.prices = hard_prices(surface, hard)
    return atlas


def grown_atlas(
    surface: Surface, bound: float, options: SeamOptions, monitor: Monitor, notes: list[str]
) -> Atlas:
    """Decide the seams of a surface on a coarse proxy and lay its charts out.

    Components that need no seam are told on the surface itself: a proxy is never quite as flat.
    """
    worker = Worker(monitor.jobs if len(surface.faces) > SHARED_FACES else 1)
    atlas, rest = Atlas(surface, np.zeros(len(surface.edges), bool)), np.ones(1, bool)
    if len(surface.faces) > DIRECT_FACES:
        with monitor.stage("charts"):
            rest = ~nearly_flat_components(atlas, bound)
    tried = [atlas]
    if rest.all():
        tried = _decided(surface, bound, options, worker, monitor)
    elif rest.any():
        atlas.put(rest, _decided(surface.part(rest), bound, options, worker, monitor)[0])
    said: list[list[str]] = [[] for _ in tried]
    for one, about in zip(tried, said, strict=True):
        finish(one, dual_graph(surface), bound, options, worker, monitor, about)
        if len(tried) > 1:
            merge_on(one, bound, MARGIN / 2, monitor)
    best = int(better_in_all(tried[-1], tried[0]))
    notes += said[best]
    return tried[best]


def finish(
    atlas: Atlas,
    graph: DualGraph,
    bound: float,
    options: SeamOptions,
    worker: Worker,
    monitor: Monitor,
    notes: list[str],
) -> None:
    """Relax charts on the surface itself, and split and merge again what is not as wanted there."""
    make_disks(atlas, graph)
    with monitor.stage("enforce"):
        count, chart = atlas.charts()
        # where the number of charts counts more than the bound, only what overlaps is split
        to_bound = bound if options.max_charts is None else ANY_BOUND
        parts = in_parts(chart)
        tasks = [(atlas.part(faces), to_bound) for faces in parts]
        for faces, part in zip(parts, worker.map(settle_part, tasks, monitor), strict=True):
            atlas.put(faces, part)
        if atlas.charts()[0] > count:
            regroup(atlas, bound, worker, monitor)
    if options.min_chart_faces > 1:
        with monitor.stage("charts"):
            merging, least = MergeOptions(bound, margin=MARGIN / 2), options.min_chart_faces
            notes += small_note(absorb(atlas, merging, least, monitor), least)


def settle_part(atlas: Atlas, bound: float, monitor: Monitor) -> Atlas:
    """Relax charts, and hold them to a bound."""
    with monitor.stage("relax"):
        layouts = relaxed_layouts(atlas, FINAL, monitor)
    enforce(atlas, dual_graph(atlas.surface), layouts, bound, FINAL, monitor)
    return atlas


def _decided(
    surface: Surface, bound: float, options: SeamOptions, worker: Worker, monitor: Monitor
) -> list[Atlas]:
    """Seams before the last relaxation, decided on the surface or on its proxy.

    From the proxy also, where that is cheap, with charts merged on that may be fine on the surface itself.
    """
    if complexity(surface) > LOOPS:
        closed = close_small_holes(surface)
        if complexity(closed) <= complexity(surface) / 2:
            atlas = _decided(closed, bound, options, worker, monitor)[0]
            return [without_fans(atlas, surface)]
    count, graph = len(surface.faces), dual_graph(surface)
    proxy = None
    with monitor.stage("charts"):
        if count > DIRECT_FACES:
            target = proxy_faces(surface)
            proxy = decimate(surface, target) if target < count else None
        if proxy is None or len(proxy.surface.faces) > WORTH_IT * count:
            return [decide(surface, bound, MARGIN, options.max_charts, worker, monitor)]
        inner = 1 + (bound - 1) * (1 - SLACK)
        rest = TRANSFER_COST * monitor.seconds.get("repair", 0.0)
        with monitor.holding(rest, least=DECIDING):
            coarse = decide(proxy.surface, inner, PROXY_MARGIN, options.max_charts, worker, monitor)
            tried = [coarse]
            if count <= TRIED_TWICE and options.max_charts is None:
                other = Atlas(coarse.surface, coarse.cut, coarse.corners)
                merge_on(other, inner, 0.0, monitor)
                tried += [other] if other.charts()[0] < coarse.charts()[0] else []
    with monitor.stage("carry"):
        # prices have done their part: paths that heed them edge by edge are longer, and cost charts
        blind = dataclasses.replace(surface, price=None)
        return [transfer_to_fine(blind, graph, one, proxy) for one in tried]


def regroup(atlas: Atlas, bound: float, worker: Worker, monitor: Monitor) -> None:
    """Merge the pieces that enforcing left with their neighbours where that is good again."""
    fixed = np.zeros(len(atlas.cut), bool)
    options = MergeOptions(bound, margin=MARGIN / 2, rounds=REGROUPINGS, faces=REGROUP_FACES)
    Merger(atlas, options, fixed, worker).run(monitor)


def transfer_to_fine(surface: Surface, graph: DualGraph, coarse: Atlas, proxy: Proxy) -> Atlas:
    """Seams and layout of the proxy on the fine surface (not relaxed yet)."""
    fine = Atlas(surface, np.zeros(len(surface.edges), bool))
    transfer_seams(coarse, proxy, fine)
    near = nearest_coarse_face(surface, proxy)
    _, coarse_chart = coarse.charts()
    separate(fine, graph, coarse, coarse_chart, near)
    transferred = drop_slivers(fine, coarse_chart, near)
    targets, _ = fine_targets(coarse, fine, coarse_chart, near, transferred)
    cut_mesh = fine.cut_mesh()
    bad = not_disks(cut_mesh)
    uv, _ = from_jacobians(cut_mesh, targets, 0 if bad.any() else 8)
    fine.scatter(cut_mesh, uv)
    return fine
