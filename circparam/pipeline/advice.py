"""Advice for a half-empty page: other options are tried, and only measured gains are named."""

from dataclasses import replace

from circparam.core.monitor import Monitor
from circparam.core.plural import counted
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.fuller_page import covered_share, fill_page, packing
from circparam.pipeline.options import Options

# covered share of a page below which cuts are tried that only the user can allow
HALF_EMPTY_SHARE = 0.5
GAIN_PAGE_SHARE = 0.05  # share of the page that they must cover more
CUT_TRIALS = 10  # that are tried
# faces: a smaller surface is unwrapped in less time than cuts take to try
LEAST_ADVISED_FACES = 500


def advised(filled: Cascade, start: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """The layout ``filled`` that ``fill_page`` made of ``start``, with advice where its page is half empty.

    The advice names the share that further cuts cover. The cuts were made and packed. There is no advice if the
    user has set the number.
    """
    small = len(start.atlas.surface.faces) < LEAST_ADVISED_FACES
    if options.cuts_asked is not None or options.max_charts is not None or small or monitor.expired:
        return filled
    found = filled.packing or packing(filled, options, monitor)
    filled = replace(filled, packing=found)
    if found is None or covered_share(found) >= HALF_EMPTY_SHARE:
        return filled
    start = fallback.settle(start, monitor)
    more = fill_page(start, replace(options, pack_splits=CUT_TRIALS), monitor)
    if more.packing is None or covered_share(more.packing) < covered_share(found) + GAIN_PAGE_SHARE:
        return filled
    cuts = more.atlas.charts()[0] - start.atlas.charts()[0]
    return replace(
        filled,
        advice=f"{counted(cuts, 'cut')} across charts would cover "
        f"{100 * covered_share(more.packing):.0f} % (--pack-splits {CUT_TRIALS})",
    )
