"""Few charts under a distortion bound: grow, merge, shorten, on a coarse proxy where the mesh is large."""

import dataclasses
from contextlib import suppress
from functools import partial

import numpy as np

from circparam.core.arrays import group_sum, mask_of
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray
from circparam.errors import OutOfTimeError
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.constraints import constrain
from circparam.seams.cost import COST
from circparam.seams.evaluate import MARGIN
from circparam.seams.finish import LEVEL_FACES, REGROUP_FACES, Decided, finish
from circparam.seams.grown import grown_atlas
from circparam.seams.hard.charts import hard_atlas, quick_atlas, unrolls_in_part, unrolls_whole
from circparam.seams.hard.regions import (
    creased_flats,
    edges_inside,
    hard_components,
    large_flats,
    surely_hard,
)
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.multires.transfer import transfer_to_fine
from circparam.seams.options import HIDDEN, SeamOptions, Seams
from circparam.seams.prices import edge_prices, with_visibility, with_weights
from circparam.seams.reached import in_time
from circparam.seams.segmentation.decide import DIRECT_FACES, merge_on, reach_count, worth
from circparam.seams.segmentation.grow import DualGraph, make_disks
from circparam.seams.segmentation.layout import judge
from circparam.seams.segmentation.small import small_note
from circparam.seams.stretch import STRETCH, limit_stretch_of_all, stretch_limits
from circparam.seams.symmetry import Mirror, about_image_of, both_sides, find_mirror, image_of
from circparam.seams.tiny_components import debris


def charts(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    """Seams that leave few charts, each a disk (holes allowed) whose isometric map stays under the bound.

    Returns the seams with the layout (symmetric Dirichlet energy minimised, no flips, no chart overlapping
    itself). Raises OptionError for contradictory seams, and for a symmetry that the surface does not have.
    Deterministic.
    """
    mirror = None if options.symmetry is None else find_mirror(surface, options.symmetry)
    surface, forced, notes = constrain(surface, options)
    hide = options.hide_seams
    if hide is None and options.search.draft:
        hide = 0.0
    if hide is None:  # seams that moved have no distortion left for tips to be held more strictly
        hide = HIDDEN if (options.max_stretch or STRETCH) >= STRETCH else 0.0
    if hide > 0:
        options = dataclasses.replace(options, hide_seams=hide)
        # else they are found when it is clear what for, beside other things where that can be
        whole = mirror is not None or options.max_charts is not None or options.weights is not None
        if whole or (forced.any() and len(surface.faces) <= LEVEL_FACES):
            surface = with_visibility(surface, options, monitor)
    if options.weights is not None:
        surface = with_weights(surface, options.weights)
    if mirror is not None:
        surface = dataclasses.replace(surface, locked=mirror.closed(surface.locked))
        forced = mirror.closed(forced) & ~surface.locked
        notes.append(mirror.note)
    opened = surface.without_edges(forced)
    bound = 1 + (options.max_distortion - 1) * (1 - 1e-4)
    limits, seams = stretch_limits(bound, options)

    def search() -> Atlas:
        if mirror is not None:
            halved = mirror.without(forced)
            return mirrored_atlas(opened, halved, bound, options, monitor)
        return bounded_atlas(opened, bound, options, monitor)

    atlas = in_time(opened, search, monitor, partly=True)
    best = Atlas(opened, atlas.cut, atlas.corners)
    try:
        with monitor.stage("stretch"):
            if not monitor.expired:
                limit_stretch_of_all(atlas, limits, monitor, seams and mirror is None)
    except OutOfTimeError:
        monitor.late, atlas = True, best
    if options.min_chart_faces > 1:
        with suppress(OutOfTimeError):
            notes += small_note(atlas, options.min_chart_faces)
    # the seams of the opened surface, and those that were demanded
    cut = forced.copy()
    cut[~forced] = atlas.cut
    return Seams(cut, atlas.corners, notes)


def contains_draft(surface: Surface, options: SeamOptions) -> bool:
    """Whether a search has the charts of a draft among those that it chooses from: on hard and small surfaces.

    It counts as one where other things than the cost decide: a number of charts, hidden or weighed seams, and
    charts of many faces; and above ``LEVEL_FACES``, where a draft takes as long.
    """
    asked = (options.max_charts, options.weights, options.start)
    if options.min_chart_faces > 1 or options.hide_seams or any(x is not None for x in asked):
        return True
    if len(surface.faces) > LEVEL_FACES:
        return True
    return int((~hard_faces(surface, options.max_distortion)).sum()) <= DIRECT_FACES


def hard_faces(surface: Surface, bound: float) -> BoolArray:
    """(m,) bool: faces of hard components: of those that may be, a part unrolls, or they are it for sure."""
    hard = hard_components(surface) & ~debris(surface)
    doubtful = hard & ~surely_hard(surface)
    if doubtful.any():
        hard[doubtful] = unrolls_in_part(surface.part(doubtful), bound)
    return hard


def mirrored_atlas(
    surface: Surface, mirror: Mirror, bound: float, options: SeamOptions, monitor: Monitor
) -> Atlas:
    """The atlas of one half on both, then whatever charts of both may be glued where they meet.

    A seam between the halves passes faces across the plane on their negative side. Its image beside it would
    make a chart of each of these faces.
    """
    if options.max_charts is not None:
        options = dataclasses.replace(options, max_charts=max(options.max_charts // 2, 1))
    half = bounded_atlas(surface.part(mirror.half), bound, options, monitor)
    if mirror.images is not None:
        other = image_of(surface, mirror, mirror.images, half)
    else:
        with monitor.stage("carry"):
            rest = surface.part(~mirror.half)
            graph = DualGraph(rest)
            other = transfer_to_fine(rest, graph, *about_image_of(mirror, half, rest))
        finish(Decided(other, graph), bound, options, monitor)
    atlas, between = both_sides(surface, mirror, half, other)
    with monitor.stage("charts"):
        merge(atlas, MergeOptions(bound, margin=MARGIN / 2), monitor, ~between)
        if not_disks(atlas.cut_mesh()).any():
            make_disks(atlas, DualGraph(surface))
    return atlas


def bounded_atlas(surface: Surface, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """Decide the seams of a surface and lay its charts out: hard components from their regions.

    A number of charts is reached from the atlas without one, so that it never leads to more.
    """
    most = options.max_charts
    if most is None:
        return free_atlas(surface, bound, options, monitor)
    free = dataclasses.replace(options, max_charts=None)
    atlas = free_atlas(surface, bound, free, monitor)
    count = atlas.charts()[0]
    pieces, _ = surface.components
    if count <= max(most, pieces) or monitor.expired:
        return atlas
    tried = [atlas, grown_atlas(surface, bound, options, monitor)]
    if len(surface.faces) <= REGROUP_FACES:
        merged = Atlas(surface, atlas.cut.copy(), atlas.corners.copy())
        with monitor.stage("charts"):
            reach_count(merged, bound, most, monitor)
        tried.append(merged)
    best = min(tried, key=lambda one: worth(one, most, bound))
    best.prices = atlas.prices
    return best


def free_atlas(surface: Surface, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """As many charts as the bound needs, and no more than can be had at the same distortion."""
    atlas = _first_atlas(surface, bound, options, monitor)
    # where charts have a least size, it decides who joins whom
    if options.min_chart_faces > 1 or options.search.draft:
        return atlas
    with monitor.stage("charts"):
        if len(surface.faces) <= LEVEL_FACES:
            merge_on(atlas, bound, MARGIN / 2, monitor)
            return atlas
        hard = with_creases(atlas)
        for which in (hard, ~hard):
            # charts from a level were merged there: a union costs a twelfth of what it does here
            if which.any() and (which is hard or which.sum() <= LEVEL_FACES):
                part = atlas.part(which)
                merge_on(part, bound, MARGIN / 2, monitor)
                atlas.put(which, part)
    return atlas


def _first_atlas(surface: Surface, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """Hard components from their regions, the others grown."""
    with monitor.stage("charts"):
        hard = hard_faces(surface, bound)
    if not hard.any():
        return grown_atlas(surface, bound, options, monitor)
    if monitor.deadline is not None:
        with monitor.stage("charts"):
            monitor.keep(quick_atlas(surface.part(hard), bound, monitor))
    if not unrolls_whole(surface.part(hard)):
        surface = with_visibility(surface, options, monitor, LEVEL_FACES)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool), prices=edge_prices(surface, hard))
    # the first has its share of the time that is left, the second the rest
    for faces, make, share in ((hard, hard_atlas, hard.mean()), (~hard, grown_atlas, 1.0)):
        if faces.any():
            part = surface.part(faces)
            search = partial(make, part, bound, options, monitor)
            with monitor.holding(np.inf, least=float(share)):
                atlas.put(faces, in_time(part, search, monitor))
            monitor.keep(atlas.part(faces))
    doubtful = hard & ~surely_hard(surface) & surface.components_with(atlas.cut)
    if doubtful.any() and not monitor.expired:
        hard &= ~grown_where_cheaper(atlas, doubtful, bound, options, monitor)
        atlas.prices = edge_prices(surface, hard)
    return atlas


def grown_where_cheaper(
    atlas: Atlas, faces: BoolArray, bound: float, options: SeamOptions, monitor: Monitor
) -> BoolArray:
    """Grow charts of components with those faces ((m,) bool) too, and put them where they cost less.

    Flats that creases bound do not cover half of these. A designer's flat between fillets looks like a facet of
    a tube, and a designer's edge like one of a round shape of few faces. Grown charts that cut a flat between
    creases have to cost half. A draft comes first: where it costs over twice as much, a longer search does not
    catch up (26 surfaces).
    Returns (m,) bool, faces of the components that have grown charts now.
    """
    out = np.zeros(len(faces), bool)
    draft = dataclasses.replace(options.search, draft=True)
    for search in dict.fromkeys((draft, options.search)):
        part = atlas.part(faces)
        asked = dataclasses.replace(options, search=search)
        make = partial(grown_atlas, part.surface, bound, asked, monitor)
        try:
            grown = in_time(part.surface, make, monitor)
        except OutOfTimeError:
            monitor.late = True
            break
        flat = edges_inside(part.surface, large_flats(part.surface))
        ratio = COST.of_components(grown, flat) / COST.of_components(part, flat)
        creased = edges_inside(part.surface, creased_flats(part.surface))
        more = _seam_within(grown, creased) > _seam_within(part, creased)
        ratio = np.where(more, 2 * ratio, ratio)
        # where seams are forbidden, grown charts may keep a distortion that the others do not have
        worse = _breaks_bound(grown, bound) & ~_breaks_bound(part, bound)
        ratio = np.where(worse, np.inf, ratio)[part.surface.components[1]]
        if (ratio < 1).any():
            cheaper = _those_of(faces, ratio < 1)
            atlas.put(cheaper, grown.part(ratio < 1))
            out |= cheaper
        faces = _those_of(faces, ratio <= 2)
        if not faces.any() or monitor.expired:
            break
    return out


def _breaks_bound(atlas: Atlas, bound: float) -> BoolArray:
    """(components,) bool: a chart of the component is bad or above the bound."""
    n, component = atlas.surface.components
    return mask_of(n, component[judge(*atlas.open()).bad_faces(bound)])


def _seam_within(atlas: Atlas, edges: BoolArray) -> FloatArray:
    """(components,) length of the seams among those edges ((e,) bool)."""
    surface = atlas.surface
    n, component = surface.components
    on = atlas.cut & edges
    return group_sum(surface.edge_lengths[on], component[surface.sides[0, on]], n)


def _those_of(faces: BoolArray, chosen: BoolArray) -> BoolArray:
    """(m,) bool: the chosen ones (bool) of the faces of a part."""
    out = faces.copy()
    out[faces] = chosen
    return out


def with_creases(atlas: Atlas) -> BoolArray:
    """(m,) bool: faces of hard components that have creases."""
    surface, prices = atlas.surface, atlas.prices
    return surface.components_with(np.zeros_like(atlas.cut) if prices is None else prices.crease)
