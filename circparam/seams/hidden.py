"""What seams cost where they are hardly seen: the less, the fewer directions see an edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.geometry.visibility import PARTS, edge_shares
from circparam.mesh.surface import Surface
from circparam.seams.options import SeamOptions

DIRECTIONS = 64
FEWER, LARGE = 24, 20_000  # directions for surfaces of more faces than that
PIXELS = 128
TYPICAL = 0.5  # of the directions see an edge of a convex shape
LEAST = 0.2  # of that: what is seen from fewer is as good as hidden
VISIBLE = 30.0  # seconds over those of the repair: with less left there are no prices, charts need the time
FREE = 1e-3  # least price of an edge, in its lengths
POWER = 4.0  # of the share in the price, at full strength


def shares_of_part(
    surface: Surface, count: int, part: int, parts: int, monitor: Monitor
) -> FloatArray:
    """(e,) what one of so many parts of the directions has in the share of each edge. monitor: not asked."""
    return edge_shares(surface, count, PIXELS, turn=slice(part, None, parts))


def hiding_prices(surface: Surface, strength: float, monitor: Monitor | None = None) -> FloatArray:
    """(e,) price of every edge, in its lengths: (share / TYPICAL) to the power POWER · strength.

    share: of all directions from which the edge is seen, and no less than LEAST · TYPICAL. strength: from 0,
    where all edges are alike, to 1. An edge on a convex place costs its length; one down a groove that half as
    many directions see costs a quarter of it at a strength of ½. monitor: its processes look along half of
    the directions each (None: this one along all).
    """
    count = DIRECTIONS if len(surface.faces) <= LARGE else FEWER
    parts = 1 if monitor is None else PARTS
    tasks = [(surface, count, part, parts) for part in range(parts)]
    worker = Worker(1 if monitor is None else monitor.jobs)
    share = sum(worker.map(shares_of_part, tasks, monitor or Monitor()))
    price: FloatArray = np.maximum(share / TYPICAL, LEAST) ** (POWER * strength)
    return price


def with_prices(
    surface: Surface, options: SeamOptions, monitor: Monitor, most: int | None = None
) -> Surface:
    """The surface with the prices of its edges by visibility, where they are asked for.

    most: faces, beyond which there are none (those of a level are found there).
    """
    large = most is not None and len(surface.faces) > most
    if large or not options.hide_seams or not _wanted(surface, options, monitor):
        return surface
    with monitor.stage("visibility"):
        return replace(surface, price=hiding_prices(surface, options.hide_seams, monitor))


def weighted(surface: Surface, weights: FloatArray) -> Surface:
    """The surface with its prices times weights (e,) of the user; what they forbid is locked, not priced.

    Nothing is cheaper than FREE: seams that cost nothing would take any detour.
    """
    factor = np.where(np.isfinite(weights), np.maximum(weights, FREE), 1.0)
    price = factor if surface.price is None else factor * surface.price
    return replace(surface, price=price, weighted=True)


def _wanted(surface: Surface, options: SeamOptions, monitor: Monitor) -> bool:
    """Whether prices by visibility are asked for, there are none yet, and there is time for them."""
    short = monitor.short(VISIBLE * monitor.seconds.get("repair", 0.0))
    return bool(options.hide_seams) and surface.price is None and not short
