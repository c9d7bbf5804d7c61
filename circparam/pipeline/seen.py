"""What is seen of the seams, for the report: found beside verifying and writing, left out where time is up."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from circparam.core.arrays import BoolArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Later
from circparam.geometry.visibility import visible_share
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface
from circparam.pipeline.verify import Verification, uv_seams

COST = 6.0  # seconds over those of the repair: 2 to 6 on twelve meshes of 30,000 faces and more


def shares(surface: Surface, cut: BoolArray, monitor: Monitor) -> float | None:
    """As ``visible_share``. monitor: not asked, it is soon done."""
    return visible_share(surface, cut)


@dataclass(frozen=True)
class Known:
    """A figure that was found already, or never will be."""

    value: float | None

    def __call__(self) -> float | None:
        """The figure."""
        return self.value


class SeenBeside:
    """What is seen of the seams of a layout, found by an idle process; where there is none, when asked."""

    def __init__(self, surface: Surface, uvmap: UVMap, monitor: Monitor) -> None:
        self._monitor = monitor
        self._later: Later | None = None
        if monitor.jobs > 1 and not self._late():
            # what a surface keeps beside its fields need not be sent
            task = (replace(surface), uv_seams(surface, uvmap))
            self._later = Later(monitor.jobs, shares, task, monitor)
            self._later.begin()

    def told(self, found: Verification) -> Verification:
        """A verification of that layout which knows the figure, where another process looked or time is up.

        Else it is found when it is asked for: a caller of the library may never ask.
        """
        if self._later is not None and self._later.begun:
            return replace(found, seen=Known(self._later.result()))
        return replace(found, seen=Known(None)) if self._late() else found

    def _late(self) -> bool:
        """Whether looking would end after the moment at which all work has to."""
        last = self._monitor.last
        cost = COST * self._monitor.seconds.get("repair", 0.0)
        return last is not None and time.monotonic() + cost > last


__all__ = ["Known", "SeenBeside", "shares"]
