"""A fuller page for a little seam: what ``--pack-splits auto`` does.

Texels are bought with seam. A page of R · R texels of which a share s is covered has s R² texels of surface,
and seams and boundaries of length L, in roots of the area, have L √s R texels beside them, where filters blend
and mip maps bleed. **A cut is worth it where texels grow by half the percentage by which seams do, at least**
(``RATE`` in ``cut_plan``), as sketches of the page see it. They see it in steps of a cell, 4 % of what is
covered, and so late; what they rank highest is packed, beside the page without cuts, and the best is kept.
A mesh that needs no seam gets none, and all cuts together make the seams no longer than ``LIMIT`` allows.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.words import counted
from circparam.core.workers import Worker
from circparam.errors import CircparamError
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.packing import pack
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade, KnownPacking
from circparam.pipeline.configure import pack_options
from circparam.pipeline.cut_along import Limits
from circparam.pipeline.cut_plan import RATE, Planner, easel_of, first_plan
from circparam.pipeline.options import Options
from circparam.pipeline.pieces import Carver
from circparam.pipeline.place import chart_signs, sized
from circparam.seams.segmentation.tail import hold_stretch
from circparam.seams.segmentation.weigh import Limits as StretchLimits
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH, stretch_asked

LIMIT = 0.149  # of the length of the seams that all cuts may add
FEW = 12  # charts: the page of more depends less on cuts, and each packing takes longer
ENOUGH, ENOUGH_OF_MANY = 0.7, 0.66  # covered share of a page on which nothing is looked for
# plans that are packed, beside the one without a cut: sketches only rank them
COMPARED = 2
CUTS = 8  # at most


def fill_page(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Cut charts where a page so much fuller is worth the seam; a note tells what was done.

    There are never more charts than ``options.max_charts``, nor parts of fewer faces than
    ``options.min_chart_faces``. Charts keep the layout they had, so nothing overlaps, and their bound.
    """
    most, least_faces = options.max_charts, options.min_chart_faces or 1
    cascade = fallback.settle(cascade, monitor)
    before = cascade.atlas
    cut_mesh, uv = before.open()
    cuts = CUTS if most is None else min(CUTS, most - cut_mesh.n_charts)
    seams = before.seam_length * float(np.sqrt(before.surface.areas.sum()))
    if cuts < 1 or seams <= 0 or monitor.expired or not np.isfinite(uv).all():
        return cascade

    known = packing(cascade, options, monitor)
    few = cut_mesh.n_charts <= FEW
    if known is None or _share(known) >= (ENOUGH if few else ENOUGH_OF_MANY):
        return replace(cascade, packing=known)

    def stop() -> bool:
        return monitor.expired

    easel = easel_of(cut_mesh, pack_options(options))
    carver = Carver(before, cut_mesh, uv, easel, Limits(cascade.rules.bound, least_faces))
    first = first_plan(carver, stop)
    if first is None:
        return replace(cascade, packing=known)
    area = float(cut_mesh.chart_areas.sum())
    planner = Planner(carver, area, first.length + LIMIT * seams, cuts, stop)
    plans, tried = [first], [cascade]
    for plan in planner.best(first, COMPARED):
        atlas = carver.joined(plan.pieces)
        if stretch_kept(atlas, before, options, cascade.rules.bound, monitor):
            plans.append(plan)
            tried.append(replace(cascade, atlas=atlas))
    tasks = [(c, options) for c in tried[1:]]
    packings = [known, *Worker(monitor.jobs).map(packing, tasks, monitor)]
    value = [_value(k, plan.length) for k, plan in zip(packings, plans, strict=True)]
    best = int(np.argmax(value))  # the first where several are alike: no cut
    chosen = replace(tried[best], packing=packings[best])
    if best == 0:
        return chosen
    longer = chosen.atlas.seam_length / before.seam_length - 1
    return chosen.noted(
        f"{counted(plans[best].cuts, 'cut')} for a fuller page made the seams {longer:.1%} longer "
        "(--pack-splits 0 makes none)"
    )


def stretch_kept(
    atlas: Atlas, before: Atlas, options: Options, bound: float, monitor: Monitor
) -> bool:
    """Whether no more of an atlas with cuts is stretched too much than may be, or was; by weights if need be.

    Parts of a chart have a scale each, and those that were relaxed have lost the weights that they had.
    """
    if not stretch_asked(options.max_stretch, options.bound or np.inf):
        return True
    limits = StretchLimits(bound, options.max_stretch or STRETCH)
    allowed = max(_stretched(before, limits.most), limits.allowed)
    if _stretched(atlas, limits.most) <= allowed:
        return True
    hold_stretch(atlas, limits, monitor, slits=False, splits=False)
    return _stretched(atlas, limits.most) <= allowed


def _stretched(atlas: Atlas, most: float) -> float:
    cut_mesh, uv = atlas.open()
    return float(share_over(cut_mesh, face_stretch(cut_mesh, uv), most).sum())


def packing(cascade: Cascade, options: Options, monitor: Monitor) -> KnownPacking | None:
    """The charts packed as they will be; None where they cannot be."""
    cut_mesh, uv = cascade.open()
    uv[:, 0] *= chart_signs(cascade.atlas.surface, cut_mesh, options)[cut_mesh.vertex_chart]
    uv = sized(cut_mesh, uv, cascade.kept_sizes(cut_mesh))
    with contextlib.suppress(CircparamError):
        return KnownPacking(
            uv, pack(cut_mesh.faces, uv, cut_mesh.chart, pack_options(options), monitor)
        )
    return None


def _value(found: KnownPacking | None, length: float) -> float:
    """What ``Plan.value`` is for a page that was packed."""
    return -np.inf if found is None else float(np.log(_share(found)) - RATE * np.log(length))


def _share(found: KnownPacking) -> float:
    """Covered share of the pages that are used."""
    return float(found.packed.share[: int(found.packed.page.max()) + 1].mean())
