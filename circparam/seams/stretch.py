"""How far faces may be stretched, and whether seams may be added for that."""

from __future__ import annotations

from dataclasses import replace

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.starts import cost_of
from circparam.seams.segmentation.tail import hold_stretch
from circparam.seams.segmentation.weigh import Limits

STRETCH = 2.0  # that all but a thousandth of the surface keep to where nothing else is asked for
STRICT = 1.05  # bound up to which seams are added for that
LEVEL_STRETCH = 0.85  # of the stretch in excess of 1 that a level may have, which is smoother


def stretch_asked(most: float | None, bound: float) -> bool:
    """Whether seams may be added for a largest stretch (None: the usual one) at a bound of the distortion.

    Who allows more distortion wants fewer seams: then none are added for a stretch nobody asked for.
    """
    return most is not None or bound <= STRICT


def stretch_limits(bound: float, options: SeamOptions) -> tuple[Limits, bool, bool]:
    """How far faces may be stretched; whether seams may be added for that, and charts be split."""
    asked = stretch_asked(options.max_stretch, options.max_distortion)
    free = asked and options.max_charts is None and options.min_chart_faces == 1
    return Limits(bound, options.max_stretch or STRETCH), asked, free


def held_more_strictly(atlas: Atlas, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """The atlas of a level with its stretch held: by weights more strictly than asked, since the surface that
    it stands for is rougher."""
    if monitor.expired:
        return atlas
    limits, slits, splits = stretch_limits(bound, options)
    out = Atlas(atlas.surface, atlas.cut, atlas.corners, atlas.prices)
    with monitor.shown_as("level"), monitor.stage("stretch"):
        most = 1 + (limits.most - 1) * LEVEL_STRETCH
        strict = replace(limits, most=most, allowed=limits.allowed / 2)
        hold_stretch(out, strict, monitor, slits=False)
        hold_stretch(out, limits, monitor, slits, splits)
    return out


def best_held(
    tried: list[Atlas], bound: float, options: SeamOptions, monitor: Monitor
) -> tuple[Atlas, Atlas | None]:
    """The cheapest atlas of a level once its stretch is held, and the next best, not held yet, if any.

    Seams for that only add to what an atlas costs: another is held where that makes it the cheaper one.
    """
    first, *others = sorted(tried, key=cost_of)
    best = held_more_strictly(first, bound, options, monitor)
    if not others:
        return best, None
    other = others[0]
    if cost_of(best) > cost_of(other):
        held = held_more_strictly(other, bound, options, monitor)
        if cost_of(held) < cost_of(best):
            return held, first
    return best, other
