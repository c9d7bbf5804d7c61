"""Visibility of the seams, for the report: computed beside verifying and writing, left out when time is up."""

import time
from dataclasses import replace

from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray
from circparam.core.workers import DeferredTask
from circparam.geometry.visibility import visible_share
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface
from circparam.pipeline.verify import Verification, uv_seams

# seconds over those of the repair: 2 to 6 on twelve meshes of 30,000 faces and more
VISIBILITY_COST = 6.0


def seen_share(surface: Surface, cut: BoolArray, monitor: Monitor) -> float | None:
    """As ``visible_share``. monitor: not asked, the caller knows whether there is time."""
    return visible_share(surface, cut)


class SeamVisibility:
    """The visibility of the seams of a layout: an idle process looks while this one verifies and writes."""

    def __init__(self, surface: Surface, uvmap: UVMap, monitor: Monitor) -> None:
        self._surface, self._uvmap, self._monitor = surface, uvmap, monitor
        self._deferred: DeferredTask | None = None
        if monitor.jobs > 1 and not self._late():
            cut = uv_seams(surface, uvmap)
            if cut.any():
                # caches of a surface need not be sent
                task = replace(surface), cut
                self._deferred = DeferredTask(monitor.jobs, seen_share, task, monitor)
                self._deferred.begin()

    def completed(self, found: Verification) -> Verification:
        """A verification of that layout which finds the figure on demand, or never where time is up.

        A caller of the library may never ask for it.
        """
        if self._deferred is not None and self._deferred.begun:
            return replace(found, seen=self._deferred.result)
        if self._late():
            return replace(found, seen=lambda: None)
        if self._surface is found.surface:
            return found
        cut = uv_seams(self._surface, self._uvmap)
        return replace(found, seen=lambda: visible_share(self._surface, cut))

    def _late(self) -> bool:
        """Whether looking would end after the moment at which all work has to."""
        last = self._monitor.last
        cost = VISIBILITY_COST * self._monitor.seconds.get("repair", 0.0)
        return last is not None and time.monotonic() + cost > last


__all__ = ["SeamVisibility", "seen_share"]
