"""How far faces may be stretched, and whether seams may be added for that."""

from __future__ import annotations

from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.weigh import Limits

STRETCH = 2.0  # that all but a thousandth of the surface keep to where nothing else is asked for
STRICT = 1.05  # bound up to which seams are added for that


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
