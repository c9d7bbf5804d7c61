"""A fuller page for a little seam (``--pack-splits auto``).

A chart is cut if and only if the cut lowers the cost of the atlas (``AtlasCost``): its seam and one more chart
are paid by the fuller page. ``page_search`` proposes cuts by estimates and sketches of the page. The best
layouts are packed as they will be, beside the page without cuts, and the cheapest is kept. A draft packs
one page: it cuts where the estimate promises more than estimates err. A mesh that needs no seam gets none.
"""

import contextlib
from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray
from circparam.core.monitor import Monitor
from circparam.core.plural import counted
from circparam.core.workers import Worker
from circparam.errors import CircparamError
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.packing import pack
from circparam.packing.budget import Budget
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade, KnownPacking
from circparam.pipeline.configure import pack_options
from circparam.pipeline.cut_along import Limits
from circparam.pipeline.layout_cost import finished_cost
from circparam.pipeline.options import Options
from circparam.pipeline.page_cuts import Cutter, joined
from circparam.pipeline.page_search import CELLS, SKETCHED, Plan, Search
from circparam.pipeline.place import chart_signs, sized
from circparam.seams.segmentation.tail import limit_stretch
from circparam.seams.segmentation.weigh import Limits as StretchLimits
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH, stretch_asked

WORK = 12.0  # work of a search: charts are cut that have so many faces together, in faces of the surface
PACKED = 2  # plans that are packed, beside the page without cuts
DOUBT = 2.0  # roots of the area by which estimates promise too much at most (28 meshes); a draft asks for more


def fill_page(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Cut charts if a fuller page is worth the seam; a note says which cuts were made.

    There are never more charts than ``options.max_charts``, nor parts of fewer faces than
    ``options.min_chart_faces``. Charts keep the layout they had, so nothing overlaps, and their bound.
    """
    cascade = fallback.settle(cascade, monitor)
    cut_mesh, uv = cascade.atlas.open()
    asked = options.cuts_asked
    most = np.inf if options.max_charts is None else options.max_charts - cut_mesh.n_charts
    most = min(most, len(cut_mesh.faces) if asked is None else asked)
    one = asked is None and options.pages in (None, 1)
    no_seam = one and cascade.atlas.seam_length <= 0
    if most < 1 or no_seam or monitor.expired or not np.isfinite(uv).all():
        return cascade
    plans = searched(cascade, options, int(most), monitor)
    return cheapest(cascade, plans, options, monitor)


def page_cutter(cascade: Cascade, options: Options) -> Cutter:
    """The maker of cuts; cuts lead through flats only if the user asked for cuts."""
    limits = Limits(cascade.rules.bound, options.min_chart_faces or 1)
    return Cutter(cascade.atlas, *cascade.atlas.open(), limits, options.cuts_asked is not None)


def searched(cascade: Cascade, options: Options, most: int, monitor: Monitor) -> list[Plan]:
    """The plans that cost less than the one without a cut, the cheapest first."""
    cutter = page_cutter(cascade, options)
    budget = Budget(WORK * len(cutter.cut_mesh.faces), lambda: monitor.expired)
    one = options.pages in (None, 1)
    widest = max((np.ptp(part.outline.p, axis=0).max() for part in cutter.charts), default=np.inf)
    if not np.isfinite(widest):
        return []
    drawn = len(cutter.charts) <= SKETCHED and 2 * widest <= CELLS * cutter.root
    sketches = one and drawn and not options.draft
    gain = DOUBT if options.draft else -np.inf  # of one cut: others may prepare the next one
    search = Search(cutter, most, pack_options(options), sketches, gain, budget, monitor)
    first, *others = search.plans()
    limit = first.cost - max(gain, 0.0)
    return sorted((p for p in others if p.cost < limit), key=lambda plan: plan.cost)


def cheapest(cascade: Cascade, plans: list[Plan], options: Options, monitor: Monitor) -> Cascade:
    """The cheapest layout of the one without cuts and those of the first plans, packed as they will be."""
    pages = options.pages or 1
    purpose = "for a fuller page" if pages == 1 else f"to fill {pages} pages"
    found = [cascade]
    for plan in plans:
        if len(found) > (1 if options.draft else PACKED):
            break
        atlas = joined(cascade.atlas, plan.parts)
        if stretch_kept(atlas, cascade.atlas, options, cascade.rules.bound, monitor):
            after = replace(cascade, atlas=atlas)
            note = longer(counted(plan.cuts, "cut"), purpose, cascade, after)
            found.append(after.noted(note))
    if len(found) > 1 and options.draft:
        found = found[1:]
    tasks = [(c, options) for c in found]
    packings = Worker(monitor.jobs).map(packing, tasks, monitor)
    packed = [replace(c, packing=p) for c, p in zip(found, packings, strict=True)]
    best = min(packed, key=lambda c: _priced_cost(c, cascade.atlas.cut))
    if options.cuts_asked is not None and best is packed[0] and found[0] is cascade:
        return best.noted("--pack-splits: no cut is worth its seam")
    return best


def _priced_cost(cascade: Cascade, before: BoolArray) -> float:
    """The cost of a layout, whose seams beyond those of ``before`` ((e,) bool) have the prices of the user."""
    if cascade.packing is None:
        return np.inf
    surface = cascade.atlas.surface
    new = cascade.atlas.cut & ~before
    more = (surface.priced_lengths[new] - surface.edge_lengths[new]).sum() / surface.unit
    return finished_cost(cascade) + float(more)


def longer(cuts: str, purpose: str, before: Cascade, after: Cascade) -> str:
    """A note on cuts, for the user."""
    old, new = before.atlas.seam_length, after.atlas.seam_length
    by = f"{new / old - 1:.1%} longer" if old > 0 else f"{new:.2f} roots of the area long"
    return f"{cuts} {purpose} made the seams {by} (--pack-splits 0 prevents this)"


def stretch_kept(
    atlas: Atlas, before: Atlas, options: Options, bound: float, monitor: Monitor
) -> bool:
    """Whether the cuts keep the stretched area within its limit, or below its old value; weights may help.

    Each part of a chart has its own scale, which stretches other faces.
    """
    if not stretch_asked(options.max_stretch, options.bound or np.inf):
        return True
    limits = StretchLimits(bound, options.max_stretch or STRETCH)
    allowed = max(_stretched(before, limits.most), limits.allowed)
    if _stretched(atlas, limits.most) <= allowed:
        return True
    limit_stretch(atlas, limits, monitor, slits=False)
    return _stretched(atlas, limits.most) <= allowed


def _stretched(atlas: Atlas, most: float) -> float:
    cut_mesh, uv = atlas.open()
    return float(share_over(cut_mesh, face_stretch(cut_mesh, uv), most).sum())


def packing(cascade: Cascade, options: Options, monitor: Monitor) -> KnownPacking | None:
    """The charts packed as they will be; None if they cannot be."""
    cut_mesh, uv = cascade.open()
    uv[:, 0] *= chart_signs(cascade.atlas.surface, cut_mesh, options)[cut_mesh.vertex_chart]
    uv = sized(cut_mesh, uv, cascade.kept_sizes(cut_mesh))
    with contextlib.suppress(CircparamError):
        return KnownPacking(
            uv, pack(cut_mesh.faces, uv, cut_mesh.chart, pack_options(options), monitor)
        )
    return None


def covered_share(found: KnownPacking) -> float:
    """Covered share of all pages that were asked for."""
    return float(found.packed.share.mean())
