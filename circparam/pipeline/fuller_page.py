"""A fuller page for a little seam (``--pack-splits auto``).

A chart is cut if and only if the cut lowers the cost of the atlas (``AtlasCost``): its seam and one more chart
are paid by the fuller page. ``page_search`` proposes cuts by estimates of the page. The best
layouts are packed as they will be, each only as far as it may cost less than those before it, and the cheapest
is kept. A mesh that needs no seam gets none. At a texel density that the user fixed, charts too large for
their pages are cut so that they fit.
"""

import contextlib
from dataclasses import replace

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.plural import counted
from circparam.errors import CircparamError
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.packing import pack
from circparam.packing.budget import Budget
from circparam.pipeline import fallback
from circparam.pipeline.configure import pack_options
from circparam.pipeline.cut_along import Limits
from circparam.pipeline.fallback import Cascade, KnownPacking
from circparam.pipeline.options import Options
from circparam.pipeline.page_cuts import Cutter, Part, joined
from circparam.pipeline.page_search import Plan, Search
from circparam.pipeline.place import chart_signs, sized
from circparam.seams.cost import COST
from circparam.seams.search import WORK_PER_FACE
from circparam.seams.segmentation.weigh import TAIL_SHARE, share_over
from circparam.seams.segmentation.weigh import Limits as StretchLimits
from circparam.seams.stretch import STRETCH, limit_stretch_of_all, stretch_asked


def fill_page(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Cut charts if a fuller page is worth the seam; a note says which cuts were made.

    There are never more charts than ``options.max_charts``, nor parts of fewer faces than
    ``options.min_chart_faces``. Charts keep the layout they had, so nothing overlaps, and their bound.
    """
    cascade = fallback.settle(cascade, monitor)
    most = most_cuts(cascade, options, monitor)
    one = options.cuts_asked is None and options.pages in (None, 1)
    if most < 1 or (one and cascade.atlas.seam_length <= 0):
        return cascade
    if not options.draft:
        cascade = replace(cascade, packing=packing(cascade, options, monitor))
    return cheapest(cascade, plans_of(cascade, options, most, monitor), options, monitor)


def most_cuts(cascade: Cascade, options: Options, monitor: Monitor) -> int:
    """How many cuts the options allow; none if time is up or some face has no layout."""
    cut_mesh, uv = cascade.atlas.open()
    if monitor.expired or not np.isfinite(uv).all():
        return 0
    most = len(cut_mesh.faces) if options.cuts_asked is None else options.cuts_asked
    if options.max_charts is None:
        return most
    return min(most, options.max_charts - cut_mesh.n_charts)


def page_cutter(cascade: Cascade, options: Options) -> Cutter:
    """The maker of cuts; a cut through a flat costs no more than its length only if the user asked for cuts."""
    limits = Limits(cascade.rules.bound, options.min_chart_faces or 1)
    return Cutter(cascade.atlas, limits, options.cuts_asked is not None)


def plans_of(whole: Cascade, options: Options, most: int, monitor: Monitor) -> list[Plan]:
    """The plan of the page without a cut, then those that are estimated to cost less, the cheapest first."""
    cutter = page_cutter(whole, options)
    share = None if whole.packing is None else _log_share(whole.packing)
    if not cutter.charts:
        return [Plan([], 0.0, 0, 0.0)]
    budget = Budget(WORK_PER_FACE * len(cutter.cut_mesh.faces), lambda: monitor.expired)
    search = Search(cutter, most, options.pages or 1, budget, options.draft)
    first, *others = search.plans(share)
    cheaper = [plan for plan in others if plan.cost < first.cost]
    return [first, *sorted(cheaper, key=lambda plan: plan.cost)]


def cheapest(whole: Cascade, plans: list[Plan], options: Options, monitor: Monitor) -> Cascade:
    """The cheapest layout of the first plan, which has no cut, and of those after it.

    All are packed as they will be, the first one already. A draft goes by the estimates and packs none.
    """
    pages = options.pages or 1
    purpose = "for a fuller page" if pages == 1 else f"to fill {pages} pages"
    best, kept = plans[0], whole
    cost = best.cost
    for plan in plans[1:]:
        atlas = joined(whole.atlas, plan.parts)
        if not stretch_kept(atlas, whole.atlas, options, whole.rules.bound, monitor):
            continue
        after = replace(whole, atlas=atlas, packing=None)
        note = longer(counted(plan.cuts, "cut"), purpose, whole, after)
        if options.draft:
            return after.noted(note)
        least = 0.0 if kept.packing is None else plan.least(best, kept.packing.packed.scale)
        found = packing(after, options, monitor, least)
        if found is not None and plan.packed_cost(_log_share(found)) < cost:
            best, kept = plan, replace(after, packing=found).noted(note)
            cost = plan.packed_cost(_log_share(found))
    if options.cuts_asked is not None and best is plans[0]:
        return kept.noted("--pack-splits: no cut is worth its seam")
    return kept


def longer(cuts: str, purpose: str, before: Cascade, after: Cascade) -> str:
    """A note on cuts, for the user."""
    old, new = before.atlas.seam_length, after.atlas.seam_length
    by = f"{new / old - 1:.1%} longer" if old > 0 else f"{new:.2f} roots of the area long"
    return f"{cuts} {purpose} made the seams {by} (--pack-splits 0 prevents this)"


def stretch_kept(
    atlas: Atlas, before: Atlas, options: Options, bound: float, monitor: Monitor
) -> bool:
    """Whether the cuts keep the stretched area within what is promised, or below its old value.

    Each part of a chart has its own scale, which stretches other faces. Weights may help; the rest has its
    price in the cost.
    """
    if not stretch_asked(options.max_stretch, options.bound or np.inf):
        return True
    limits = StretchLimits(bound, options.max_stretch or STRETCH)
    after = _stretched(atlas, limits.most)
    if after <= TAIL_SHARE:
        return True
    allowed = max(_stretched(before, limits.most), TAIL_SHARE)
    if after > allowed:
        limit_stretch_of_all(atlas, limits, monitor, seams=False)
        after = _stretched(atlas, limits.most)
    return after <= allowed


def _stretched(atlas: Atlas, most: float) -> float:
    cut_mesh, uv = atlas.open()
    return float(share_over(cut_mesh, face_stretch(cut_mesh, uv), most).sum())


def packing(
    cascade: Cascade, options: Options, monitor: Monitor, least: float = 0.0, work: float = 1.0
) -> KnownPacking | None:
    """The charts packed as they will be; None if they cannot be, or not at the scale ``least``.

    work: times the work that the options ask for.
    """
    cut_mesh, uv = cascade.open()
    uv[:, 0] *= chart_signs(cascade.atlas.surface, cut_mesh, options)[cut_mesh.vertex_chart]
    uv = sized(cut_mesh, uv, cascade.kept_sizes(cut_mesh))
    with contextlib.suppress(CircparamError):
        page = pack_options(options)
        page = replace(page, effort=work * page.effort)
        return KnownPacking(uv, pack(cut_mesh.faces, uv, cut_mesh.chart, page, monitor, least))
    return None


def _log_share(found: KnownPacking) -> float:
    """Logarithm of the covered share; −∞ where charts without area cover nothing."""
    share = covered_share(found)
    return float(np.log(share)) if share > 0 else -np.inf


def covered_share(found: KnownPacking) -> float:
    """Covered share of all pages that were asked for."""
    return float(found.packed.share.mean())


def fit_pages(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Cut charts that are longer than a page at the density asked for; a note tells it.

    Charts are unchanged if no cuts are enough. There are never more charts than ``options.max_charts``, nor
    parts of fewer faces than ``options.min_chart_faces``.
    """
    cascade = fallback.settle(cascade, monitor)
    page, most = pack_options(options), most_cuts(cascade, options, monitor)
    if most < 1 or page.fixed_scale is None:
        return cascade
    side = page.room / page.fixed_scale
    # there is no layout otherwise: cuts lead through flats too
    cutter = replace(page_cutter(cascade, options), through_flats=True)
    # a chart as long as a page lies along its sides, and leaves no room beside it: shorter ones follow
    for share in (1.0, np.sqrt(0.5), 0.5) if cutter.charts else ():
        parts = _divided(cutter, share * side, most, monitor)
        if parts is None:
            continue
        cuts = len(parts) - len(cutter.charts)
        after = cascade
        if cuts:
            after = replace(cascade, atlas=joined(cascade.atlas, parts))
            note = longer(counted(cuts, "cut"), "for charts that fit on a page", cascade, after)
            after = after.noted(note)
        if stretch_kept(after.atlas, cascade.atlas, options, cascade.rules.bound, monitor):
            found = packing(after, options, monitor)
            if found is not None:
                return replace(after, packing=found)
    return cascade


def _divided(cutter: Cutter, side: float, most: int, monitor: Monitor) -> list[Part] | None:
    """Parts that fit into squares of a side, the widest chart cut first; None if ``most`` cuts are too few."""
    parts = sorted(cutter.charts, key=lambda part: part.square)
    for _ in range(most):
        if parts[-1].square <= side:
            return parts
        halves = None if monitor.expired else _halves(cutter, parts.pop(), side)
        if halves is None:
            return None
        parts = sorted([*parts, *halves], key=lambda part: part.square)
    return parts if parts[-1].square <= side else None


def _halves(cutter: Cutter, part: Part, side: float) -> list[Part] | None:
    """Both parts of a part: a smaller page pays the seam, down to one of a side. None if no cut is left."""
    chords = part.chords
    page = 2 * np.log(np.maximum(chords.square / side, 1.0))
    cost = chords.length / cutter.root + COST.page * page
    for k in np.argsort(cost, kind="stable").tolist():
        done = cutter.cut(part, k) if cutter.worth_trying(part, k) else None
        if done is not None:
            return done[0]
    return None
