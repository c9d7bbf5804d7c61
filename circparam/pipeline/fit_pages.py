"""Charts cut so that they fit on pages too small for them, at a texel density that the user fixed."""

from dataclasses import replace

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.plural import counted
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.configure import pack_options
from circparam.pipeline.fuller_page import longer, packing, page_cutter, stretch_kept
from circparam.pipeline.options import Options
from circparam.pipeline.page_cuts import Cutter, Part, joined
from circparam.pipeline.page_search import CHORDS
from circparam.seams.cost import COST


def fit_pages(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Cut charts that are longer than a page at the density asked for; a note tells it.

    Charts are unchanged if no cuts are enough. There are never more charts than ``options.max_charts``, nor
    parts of fewer faces than ``options.min_chart_faces``.
    """
    cascade = fallback.settle(cascade, monitor)
    cut_mesh, uv = cascade.atlas.open()
    page = pack_options(options)
    most = np.inf if options.max_charts is None else options.max_charts - cut_mesh.n_charts
    most = min(most, len(cut_mesh.faces) if options.cuts_asked is None else options.cuts_asked)
    if most < 1 or page.fixed_scale is None or monitor.expired or not np.isfinite(uv).all():
        return cascade
    side = (page.resolution - 2 * page.border) / page.fixed_scale
    # there is no layout otherwise: cuts lead through flats too
    cutter = replace(page_cutter(cascade, options), through_flats=True)
    # a chart as long as a page lies along its sides, and leaves no room beside it: shorter ones follow
    for share in (1.0, np.sqrt(0.5), 0.5) if cutter.charts else ():
        parts = _divided(cutter, share * side, int(most), monitor)
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
        if len(part.failed) == CHORDS:
            break
        done = cutter.cut(part, k) if chords.inside(k) else None
        if done is not None:
            return done[0]
    return None
