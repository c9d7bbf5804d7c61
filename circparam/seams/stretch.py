"""How far faces may be stretched, and whether seams may be added for that."""

from dataclasses import replace

import numpy as np

from circparam.core.monitor import Monitor
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import AIMED, LOCAL
from circparam.seams.finish import LEVEL_FACES
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.tail import limit_stretch
from circparam.seams.segmentation.weigh import Limits, share_over, with_tails

STRETCH = 2.0  # that all but a thousandth of the surface keep to where nothing else is asked for
STRICT = SeamOptions.max_distortion  # bound up to which seams are added for that
# of the root of the area of a chart, and in roots of the area of a face: where a level has settled what is
# further away, weights change no more than this round a face
NEARBY, NEAR_FACES = 0.05, 4.0


def stretch_asked(most: float | None, bound: float) -> bool:
    """Whether seams may be added for a largest stretch (None: the usual one) at a bound of the distortion.

    Who allows more distortion wants fewer seams: then none are added for a stretch nobody asked for.
    """
    return most is not None or bound <= STRICT


def stretch_limits(bound: float, options: SeamOptions) -> tuple[Limits, bool]:
    """How far faces may be stretched; whether seams may be added for that."""
    asked = stretch_asked(options.max_stretch, options.max_distortion)
    free = asked and options.max_charts is None and options.min_chart_faces == 1
    local, cuts_off = (LOCAL, free) if options.search.draft else (None, False)
    explicit = options.max_stretch is not None
    limits = Limits(
        bound, options.max_stretch or STRETCH, local=local, cuts_off=cuts_off, asked=explicit
    )
    return limits, free


def stretch_held(atlas: Atlas, bound: float, options: SeamOptions, monitor: Monitor) -> Atlas:
    """The atlas of a level with its stretch limited: by weights, and by seams where they are not enough."""
    out = Atlas(atlas.surface, atlas.cut, atlas.corners, atlas.prices)
    if not monitor.expired:
        limits, seams = stretch_limits(bound, options)
        if limits.local is not None:  # the surface that it stands for gets what a level leaves
            limits = replace(limits, allowed=AIMED * limits.allowed)
        with monitor.shown_as("level"), monitor.stage("stretch"):
            limit_stretch(out, limits, monitor, seams)
    return out


def limit_stretch_of_all(atlas: Atlas, limits: Limits, monitor: Monitor, seams: bool) -> None:
    """As ``limit_stretch``; of large surfaces only the few charts with most of the tail are gone through."""
    if len(atlas.surface.faces) <= LEVEL_FACES and limits.local is None:
        limit_stretch(atlas, limits, monitor, seams)
        return
    cut_mesh, uv = atlas.open()
    over = share_over(cut_mesh, face_stretch(cut_mesh, uv), limits.most)
    if over.sum() <= limits.allowed:
        return
    which = with_tails(over, limits)
    rest = limits.without(over[~which].sum(), cut_mesh, cut_mesh.subset(which)[0])
    faces = which[cut_mesh.chart]
    part = atlas.part(faces)
    # on a rough mesh such faces are everywhere: what is near is told in faces
    face, chart = part.surface.areas.mean(), cut_mesh.chart_areas[which].max()
    near = min(NEARBY, NEAR_FACES * float(np.sqrt(face / chart)))
    limit_stretch(part, replace(rest, near=near, local=LOCAL), monitor, seams)
    atlas.put(faces, part)
