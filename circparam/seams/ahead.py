"""The stretch of a few large charts, held beside merging on, which seldom finds anything to merge of those."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, Later
from circparam.mesh.atlas import Atlas
from circparam.seams.grown import hold_all
from circparam.seams.segmentation.weigh import Limits

# charts: of real meshes those with 3 stayed as they were, those with 9, 18 and 32 did not
FEW = 6


class StretchAhead:
    """Holds the stretch of an atlas, perhaps begun before it is known whether that is the last word.

    limits, slits, splits: as ``hold_all`` has them.
    """

    def __init__(self, limits: Limits, slits: bool, splits: bool, monitor: Monitor) -> None:
        self._how = limits, slits, splits
        self._monitor = monitor
        self._begun: tuple[Atlas, Later] | None = None

    def begin(self, atlas: Atlas) -> None:
        """Let an idle process go on with the atlas as it is now, where it is likely to stay like that."""
        large = len(atlas.surface.faces) >= PARTED and self._monitor.jobs > 1
        if large and atlas.charts()[0] <= FEW:
            start = Atlas(atlas.surface, atlas.cut, atlas.corners, atlas.prices)
            later = Later(self._monitor.jobs, held, (start, *self._how), self._monitor)
            later.begin()
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
