"""Seams that are decided, before the charts are relaxed on the surface itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from circparam.core.arrays import BoolArray
from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import FINAL
from circparam.seams.cost import COST
from circparam.seams.segmentation.grow import DualGraph
from circparam.solvers.newton import RelaxOptions


class Decided(NamedTuple):
    """An atlas whose seams are decided: its dual graph, and how far its layout is from relaxed."""

    atlas: Atlas
    graph: DualGraph
    relaxing: RelaxOptions = FINAL
    plain: Callable[[Monitor], Decided] | None = None  # as it was before charts were merged on
    most: float = 0.0  # seams and charts up to which one from a level stays, if more break
    # parts (``in_parts``), the largest first, whose layout is relaxed on the surface itself
    relaxed: int = 0


def beside(flat: Decided, bent: BoolArray, part: Decided) -> Decided:
    """An atlas of components that need no seam, with what was decided for the others (bent: (m,) bool).

    Of those from a level the next best is kept at hand.
    """
    atlas = flat.atlas
    atlas.put(bent, part.atlas)
    flat = flat._replace(relaxing=part.relaxing)
    if part.plain is None:
        return flat
    pieces = int(np.unique(atlas.surface.components[1][~bent]).size)
    plain = partial(_with_part, flat, bent, part.plain)
    return flat._replace(plain=plain, most=part.most + COST.chart * pieces)


def _with_part(
    flat: Decided, faces: BoolArray, make: Callable[[Monitor], Decided], monitor: Monitor
) -> Decided:
    """Another atlas with what is made put in for some faces ((m,) bool)."""
    atlas = flat.atlas
    out = Atlas(atlas.surface, atlas.cut, atlas.corners, atlas.prices)
    out.put(faces, make(monitor).atlas)
    return flat._replace(atlas=out)
