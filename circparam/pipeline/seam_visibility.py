"""Visibility of the seams, for the report: computed beside verifying and writing, left out when time is up."""

import time
from dataclasses import replace

from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray
from circparam.core.workers import DeferredTask
from circparam.geometry.visibility import DIRECTION_PARTS, visible_part, visible_share
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface
from circparam.pipeline.verify import Verification, uv_seams

# seconds over those of the repair: 2 to 6 on twelve meshes of 30,000 faces and more
VISIBILITY_COST = 6.0


def first_part(surface: Surface, cut: BoolArray, monitor: Monitor) -> float:
    """Part 0 of ``visible_share``. monitor: not asked, it is soon done."""
    return visible_part(surface, cut, 0)


@dataclass(frozen=True)
class KnownFigure:
    """A figure that was found already, or never will be."""

    value: float | None

    def __call__(self) -> float | None:
        """The figure."""
        return self.value


class SeamVisibility:
    """The visibility of the seams of a layout: an idle process takes half of the directions."""

    def __init__(self, surface: Surface, uvmap: UVMap, monitor: Monitor) -> None:
        self._surface, self._uvmap, self._monitor = surface, uvmap, monitor
        self._deferred: DeferredTask | None = None
        if monitor.jobs > 1 and not self._late():
            self._cut = uv_seams(surface, uvmap)
            if surface.edge_lengths[self._cut].sum() > 0:
                # caches of a surface need not be sent
                task = (replace(surface), self._cut)
                self._deferred = DeferredTask(monitor.jobs, first_part, task, monitor)
                self._deferred.begin()

    def completed(self, found: Verification) -> Verification:
        """A verification of that layout which knows the figure, where another process looked or time is up.

        Otherwise the figure is computed on demand, because a caller of the library may never ask.
        """
        if self._deferred is not None and self._deferred.begun:
            # here meanwhile, all in the order of ``visible_share``: so the sum is the same to the last digit
            rest = [visible_part(self._surface, self._cut, k) for k in range(1, DIRECTION_PARTS)]
            return replace(found, seen=KnownFigure(sum([self._deferred.result(), *rest])))
        if self._late():
            return replace(found, seen=KnownFigure(None))
        if self._surface is found.surface:
            return found
        cut = uv_seams(self._surface, self._uvmap)
        return replace(found, seen=lambda: visible_share(self._surface, cut))

    def _late(self) -> bool:
        """Whether looking would end after the moment at which all work has to."""
        last = self._monitor.last
        cost = VISIBILITY_COST * self._monitor.seconds.get("repair", 0.0)
        return last is not None and time.monotonic() + cost > last


__all__ = ["KnownFigure", "SeamVisibility", "first_part"]
