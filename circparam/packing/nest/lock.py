"""Sketched pages grown until their outlines lock: the covered share to 1 %.

Sketches resolve 4 % of the covered share, one cell. A few linear programs on the sketched outlines take 30 ms
and predict the packed share to about 1 %.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from circparam.core.arrays import cross2
from circparam.packing.budget import Budget
from circparam.packing.nest.compaction import roughly
from circparam.packing.nest.growth import Growth
from circparam.packing.nest.sketch import Sketch, SketchedPage
from circparam.packing.options import PackOptions
from circparam.packing.outlines import Shapes
from circparam.packing.placement import Placement

STEPS = 3  # linear programs; more tell no better which of two pages is the fuller one
ROWS = 30_000  # of all of them together


def locked(
    sketches: Sequence[Sketch],
    page: SketchedPage,
    cell: float,
    options: PackOptions,
    late: Callable[[], bool],
) -> Placement:
    """Where outlines lie when they lock: with offsets of the origin of their uv.

    cell: of the page, in uv units. options: of a coarse page with the padding of the fine one.
    """
    inner = options.resolution - 2 * options.border + options.gap
    texels = inner / page.side
    at = list(zip(sketches, page.mask.tolist(), strict=True))
    angle = np.array([s.masks.angle[k] for s, k in at])
    low = np.array([s.masks.low[k] for s, k in at])
    corner = np.stack([page.column, page.row], 1) - low
    offset = corner * texels + options.border - options.gap / 2
    placed = Placement(texels / cell, angle, offset, np.zeros(len(at), np.int64))
    shapes = _shapes(sketches)
    growth = Growth(shapes, options, Budget(ROWS, late))
    grown = roughly(growth, placed, STEPS, 0.0)
    c, s = np.cos(grown.angle) * grown.scale, np.sin(grown.angle) * grown.scale
    x, y = np.array([k.middle for k in sketches]).T
    return replace(grown, offset=grown.offset - np.stack([c * x - s * y, s * x + c * y], 1))


def _shapes(sketches: Sequence[Sketch]) -> Shapes:
    """Outlines alone as charts: every edge has two vertices of its own."""
    count = np.array([len(s.start) for s in sketches])
    edge_start = np.r_[0, np.cumsum(count)].astype(np.int64)
    points = np.concatenate([p for s in sketches for p in (s.start, s.end)])
    start = np.arange(edge_start[-1]) + np.repeat(edge_start[:-1], count)
    none = np.zeros(0, np.int64)
    return Shapes(
        none.reshape(0, 3),
        points,
        none,
        np.repeat(np.arange(len(count)), 2 * count),
        np.array([abs(float(cross2(s.start, s.end).sum())) / 2 for s in sketches]),
        start,
        start + np.repeat(count, count),
        edge_start,
    )
