"""Work begun before it is known that it is wanted: the level of a large surface, and the stretch of an atlas
held; of a few large charts beside merging on, which seldom finds any to merge."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import DeferredTask
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams import grown
from circparam.seams.finish import LEVEL_FACES
from circparam.seams.multires.decimate import decimating
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.tail import hold_stretch
from circparam.seams.segmentation.weigh import Limits, share_over

# charts: of real meshes those with 3 stayed as they were, those with 9, 18 and 32 did not
FEW = 6
LEAST = 1_500  # faces: of fewer it is soon held
# as ``weigh.NEAR``, where a level has settled what is further away; and in roots of the area of a face
NEARBY, NEAR_FACES = 0.05, 4.0
LOCAL = 8  # iterations of a step there
# faces of such charts, above which no seam is added: a slit takes as long as to carry them, a split more yet
MOST_SLIT = 5_000_000
# faces of a surface whose level is begun ahead: that takes 600 bytes a face more
MOST_AHEAD = 2_000_000


def level_ahead(
    surface: Surface, options: SeamOptions, monitor: Monitor
) -> AbstractContextManager[None]:
    """Inside, the level of a large surface is being made, beside what tells how its charts are found.

    Only where there is a core for it, and memory, and one piece: of several some may need no level.
    """
    large = LEVEL_FACES < len(surface.faces) <= MOST_AHEAD and options.max_charts is None
    if not large or monitor.jobs < 2 or surface.components[0] > 1:
        return nullcontext()
    return decimating(surface, grown.level_faces(surface))


class StretchAhead:
    """Holds the stretch of an atlas, perhaps begun before it is known whether that is the last word.

    limits, slits, splits: as ``hold_all`` has them.
    """

    def __init__(self, limits: Limits, slits: bool, splits: bool, monitor: Monitor) -> None:
        self._how = limits, slits, splits
        self._monitor = monitor
        self._begun: tuple[Atlas, DeferredTask] | None = None

    def begin(self, atlas: Atlas) -> None:
        """Let an idle process go on with the atlas as it is now, where it is likely to stay like that."""
        large = len(atlas.surface.faces) >= LEAST and self._monitor.jobs > 1
        if large and atlas.charts()[0] <= FEW:
            start = Atlas(atlas.surface, atlas.cut, atlas.corners, atlas.prices)
            later = DeferredTask(self._monitor.jobs, held, (start, *self._how), self._monitor)
            later.begin_soon()
            self._begun = start, later

    def hold(self, atlas: Atlas) -> None:
        """Hold the stretch of an atlas: by what was begun, if that was with this very atlas."""
        if self._begun is not None:
            start, later = self._begun
            if np.array_equal(start.cut, atlas.cut) and np.array_equal(
                start.corners, atlas.corners
            ):
                atlas.cut, atlas.corners = later.result()
                return
        limits, slits, splits = self._how
        hold_all(atlas, limits, self._monitor, slits, splits)


def held(
    atlas: Atlas, limits: Limits, slits: bool, splits: bool, monitor: Monitor
) -> tuple[BoolArray, FloatArray]:
    """(cut, corners) of an atlas whose stretch was held."""
    hold_all(atlas, limits, monitor, slits, splits)
    return atlas.cut, atlas.corners


def hold_all(
    atlas: Atlas, limits: Limits, monitor: Monitor, slits: bool = True, splits: bool = True
) -> None:
    """As ``hold_stretch``; of large surfaces only the few charts with most of the tail are gone through."""
    if len(atlas.surface.faces) <= LEVEL_FACES and limits.local is None:
        hold_stretch(atlas, limits, monitor, slits, splits)
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
    hold_stretch(part, replace(rest, near=near, local=LOCAL), monitor, slits, splits)
    atlas.put(faces, part)
