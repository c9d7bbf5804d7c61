"""How far faces may be stretched, and whether seams may be added for that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.finish import LEVEL_FACES
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.tail import limit_stretch
from circparam.seams.segmentation.weigh import Limits, share_over

STRETCH = 2.0  # that all but a thousandth of the surface keep to where nothing else is asked for
STRICT = 1.05  # bound up to which seams are added for that
HARDLY_MORE = 1.1  # times: seams for the stretch add half of that to the cost of an atlas
# of the root of the area of a chart, and in roots of the area of a face: where a level has settled what is
# further away, weights change no more than this round a face
NEARBY, NEAR_FACES = 0.05, 4.0
LOCAL_STEPS = 8  # iterations of a step there
# faces of such charts, above which no seam is added: a slit takes as long as to carry them, a split more yet
MOST_SLIT = 5_000_000
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


def held_level(
    atlas: Atlas, bound: float, options: SeamOptions, weigh: bool, monitor: Monitor
) -> tuple[BoolArray, FloatArray]:
    """(cut, corners) of the atlas of a level with its stretch held, by seams where weights are not enough.

    weigh: by weights more strictly than asked first, since the surface that it stands for is rougher.
    """
    out = Atlas(atlas.surface, atlas.cut, atlas.corners, atlas.prices)
    if not monitor.expired:
        limits, slits, splits = stretch_limits(bound, options)
        with monitor.shown_as("level"), monitor.stage("stretch"):
            if weigh:
                limit_stretch(out, _stricter(limits), monitor, slits=False)
            limit_stretch(out, limits, monitor, slits, splits)
    return out.cut, out.corners


def _stricter(limits: Limits) -> Limits:
    most = 1 + (limits.most - 1) * LEVEL_STRETCH
    return replace(limits, most=most, allowed=limits.allowed / 2)


def best_held(
    tried: list[Atlas], bound: float, options: SeamOptions, worker: Worker, monitor: Monitor
) -> tuple[Atlas, Atlas | None]:
    """The cheapest atlas of a level once its stretch is held, and the next best, not held, if there is one.

    Mostly weights hold it, and only the cheapest one is gone through. Where that takes seams and another costs
    hardly more, both are.
    """
    first, *others = sorted(tried, key=COST.seams)
    best = Atlas(first.surface, first.cut, first.corners)
    tasks = [(best, bound, options, True)]
    if others and COST.seams(others[0]) <= HARDLY_MORE * COST.seams(first) and not monitor.expired:
        limits, slits, _ = stretch_limits(bound, options)
        with monitor.shown_as("level"), monitor.stage("stretch"):
            limit_stretch(best, _stricter(limits), monitor, slits=False)
            cut_mesh, uv = best.open()
            left = float(share_over(cut_mesh, face_stretch(cut_mesh, uv), limits.most).sum())
        tasks = [(best, bound, options, False)]
        if slits and left > limits.enough:
            tasks.append((others[0], bound, options, True))
    held = [Atlas(first.surface, *one) for one in worker.map(held_level, tasks, monitor)]
    if len(held) > 1 and COST.seams(held[1]) < COST.seams(held[0]):
        return held[1], first
    return held[0], others[0] if others else None


def limit_stretch_of_all(
    atlas: Atlas, limits: Limits, monitor: Monitor, slits: bool = True, splits: bool = True
) -> None:
    """As ``limit_stretch``; of large surfaces only the few charts with most of the tail are gone through."""
    if len(atlas.surface.faces) <= LEVEL_FACES and limits.local is None:
        limit_stretch(atlas, limits, monitor, slits, splits)
        return
    cut_mesh, uv = atlas.open()
    over = share_over(cut_mesh, face_stretch(cut_mesh, uv), limits.most)
    if over.sum() <= limits.allowed:
        return
    order = np.argsort(over, kind="stable")
    which = np.ones(cut_mesh.n_charts, bool)
    which[order[np.cumsum(over[order]) <= limits.allowed / 2]] = False
    rest = limits.without(over[~which].sum(), cut_mesh, cut_mesh.subset(which)[0])
    faces = which[cut_mesh.chart]
    part = atlas.part(faces)
    # on a rough mesh such faces are everywhere: what is near is told in faces
    face, chart = part.surface.areas.mean(), cut_mesh.chart_areas[which].max()
    near = min(NEARBY, NEAR_FACES * float(np.sqrt(face / chart)))
    slits = slits and len(part.surface.faces) <= MOST_SLIT
    limit_stretch(part, replace(rest, near=near, local=LOCAL_STEPS), monitor, slits, splits)
    atlas.put(faces, part)
