"""Seams that only open the surface: none at all, or one disk for each component."""

from __future__ import annotations

import numpy as np

from circparam.errors import TopologyError
from circparam.progress import Monitor
from circparam.seams.options import SeamOptions, Seams
from circparam.topology import Surface


def none(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    """No seams. Raises TopologyError unless every component is a disk."""
    return Seams(np.zeros(len(surface.edges), bool))


def disk(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    """One disk for each component."""
    raise TopologyError("not built yet")
