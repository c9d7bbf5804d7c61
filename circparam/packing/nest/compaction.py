"""Compact a layout: grow all charts at once until they lock, by linear programs.

Near a layout that is free of overlap the distance between two outlines is, to first order, linear in the
moves, the turns and the common growth of the charts. The largest growth that keeps all distances is then a
linear program (compaction after Li and Milenkovic 1995, "Compaction and separation algorithms for
non-convex polygons", here with turns and growth); a few steps in a shrinking trust region reach the lock.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sps
from scipy.optimize import linprog

from circparam.core.arrays import FloatArray
from circparam.packing.budget import Budget
from circparam.packing.nest.contacts import (
    Contacts,
    Outline,
    find_contacts,
    least_distance,
    sample_outline,
    to_world,
)
from circparam.packing.options import PackOptions, strip_gap
from circparam.packing.outlines import Shapes
from circparam.packing.placement import Placement

# Contacts closer to each other than this share of the trust region count once.
THIN = 0.5

# Rows of one linear program; layouts of real charts have some ten thousand at most.
MOST_ROWS = 60_000

# Contacts within so many trust regions beyond the gap count: 3 cover as much of the page as 4 with a quarter
# fewer rows; with 2, steps are taken back too often.
REACH = 3.0

# Share of the gap below which charts have come so near that a tip may be through a neighbour.
CROSSED = 0.2

# Room in texels for what the linear programs leave out: curvature of the outlines and of the turns.
_SLACK = 0.02

# Trust regions in texels of a page of 2048: the first one; the one below which steps gain nothing that the
# raster could show; and those of the last steps after an early end, which take back what was overshot.
FIRST_TRUST = 32.0
LEAST_TRUST = 0.25
LAST_TRUSTS = (1.0, 0.5)

# A step that gains less than this share of what its trust region allows is followed by a shorter one.
LITTLE_GAIN = 0.2


@dataclass(frozen=True, eq=False)
class Growth:
    """What stays the same while charts grow. strict: keep the full gap in all directions."""

    shapes: Shapes
    options: PackOptions
    budget: Budget
    strict: bool = False

    @property
    def unit(self) -> float:
        """Texels of the page in one texel of a page of 2048."""
        return self.options.resolution / 2048

    def outlines(self, step: float) -> list[Outline]:
        """Samples of all outlines at most ``step`` apart, in the units of the uv given."""
        return [sample_outline(*self.shapes.outline(c), step) for c in range(self.shapes.n)]

    def near(self, placement: Placement, outlines: list[Outline], trust: float) -> Contacts:
        """The contacts that a step in a trust region (texels of a page of 2048) has to know of."""
        reach = self.options.gap + _SLACK + REACH * trust * self.unit
        return find_contacts(placement, outlines, reach)

    def crossed(self, found: Contacts) -> bool:
        """Whether charts have come so near that a tip may be through a neighbour."""
        return least_distance(found) < CROSSED * self.options.gap


def _program(
    placement: Placement,
    outlines: list[Outline],
    found: Contacts,
    growth: Growth,
) -> tuple[sps.csr_matrix, FloatArray]:
    """Rows A z <= b with z = (moves x, moves y, turns, growth): 3n + 1 unknowns."""
    n, options = len(outlines), growth.options
    border, side = options.border + _SLACK, float(options.resolution)
    d = found.p - found.q
    distance = np.sqrt((d * d).sum(1))
    normal = d / np.maximum(distance, 1e-12)[:, None]
    rp, rq = found.p - placement.offset[found.i], found.q - placement.offset[found.j]
    k = len(distance)
    rows = np.arange(k)

    def cross(r: FloatArray) -> FloatArray:
        return np.asarray(normal[:, 1] * r[:, 0] - normal[:, 0] * r[:, 1])

    entries = [
        (rows, found.i, -normal[:, 0]),
        (rows, found.j, normal[:, 0]),
        (rows, n + found.i, -normal[:, 1]),
        (rows, n + found.j, normal[:, 1]),
        (rows, 2 * n + found.i, -cross(rp)),
        (rows, 2 * n + found.j, cross(rq)),
        (rows, np.full(k, 3 * n), -(normal * (rp - rq)).sum(1)),
    ]
    width = options.gap if growth.strict else strip_gap(options.padding, normal)
    bounds = [distance - (width + _SLACK)]
    own = np.repeat(np.arange(n), [len(o.hull) for o in outlines])
    r = np.concatenate([to_world(placement, c, o.hull) for c, o in enumerate(outlines)])
    r -= placement.offset[own]
    at, h = k, len(own)
    for axis, sign in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        rows = at + np.arange(h)
        lever = -r[:, 1] if axis == 0 else r[:, 0]
        entries += [
            (rows, axis * n + own, np.full(h, sign)),
            (rows, 2 * n + own, sign * lever),
            (rows, np.full(h, 3 * n), sign * r[:, axis]),
        ]
        here = placement.offset[own, axis] + r[:, axis]
        bounds.append(here - border if sign < 0 else side - border - here)
        at += h
    data = np.concatenate([e[2] for e in entries])
    row = np.concatenate([e[0] for e in entries])
    column = np.concatenate([e[1] for e in entries])
    return sps.csr_matrix((data, (row, column)), shape=(at, 3 * n + 1)), np.concatenate(bounds)


def _thinned(found: Contacts, side: float) -> Contacts:
    """The nearest of the contacts of two charts in each square of a side (texels): the others say the same."""
    distance = ((found.p - found.q) ** 2).sum(1)
    x, y = np.floor(found.p / side).astype(np.int64).T
    order = np.lexsort((distance, y, x, found.j, found.i))
    keys = np.stack([found.i, found.j, x, y])[:, order]
    new = np.ones(len(order), bool)
    new[1:] = (keys[:, 1:] != keys[:, :-1]).any(0)
    keep = np.sort(order[new])
    return Contacts(found.i[keep], found.j[keep], found.p[keep], found.q[keep])


def compaction_step(
    growth: Growth,
    placement: Placement,
    outlines: list[Outline],
    found: Contacts,
    trust: float,
) -> Placement | None:
    """One linear program: the largest growth within the trust region; None where it fails.

    found: contacts of the outlines as they are placed. trust: in texels of a page of 2048. It fails too where
    the program would be too large: a bundle of needles touches itself in every direction.
    """
    n = len(outlines)
    trust = trust * growth.unit
    found = _thinned(found, max(THIN * trust, 1.0))
    matrix, bound = _program(placement, outlines, found, growth)
    keep = bound < REACH * trust
    if keep.sum() > MOST_ROWS:
        return None
    growth.budget.spend(float(keep.sum()))
    reach = np.maximum(growth.shapes.radius * placement.scale, 1e-9)
    turn = trust / reach * (growth.options.rotate == "free")
    most = np.concatenate([np.full(2 * n, trust), turn, [trust / reach.max()]])
    cost = np.zeros(3 * n + 1)
    cost[-1] = -1.0
    # unknowns in units of the trust region, so that the solver sees numbers near 1
    scaled = matrix[np.flatnonzero(keep)] @ sps.diags_array(most)
    answer = linprog(
        cost, A_ub=scaled / trust, b_ub=bound[keep] / trust, bounds=(-1, 1), method="highs"
    )
    if answer.x is None:
        return None
    z = answer.x * most
    return replace(
        placement,
        scale=placement.scale * (1 + z[-1]),
        angle=placement.angle + z[2 * n : 3 * n],
        offset=placement.offset + np.stack([z[:n], z[n : 2 * n]], 1),
    )


def compact(
    shapes: Shapes,
    placement: Placement,
    options: PackOptions,
    steps: int,
    budget: Budget,
    trust: float = FIRST_TRUST,
    strict: bool = False,
) -> Placement:
    """Grow a layout free of overlap until it locks, by at most ``steps`` linear programs.

    trust: first trust region in texels of a page of 2048; it is halved when a step gains little of what the
    region allows, down to a quarter of a texel. A step that brings charts so near that a tip may be through a
    neighbour, or to where no step keeps all distances, is taken back. strict: keep the full gap in all
    directions, where the width of straight strips would do; for layouts that the check refuses. budget: counts
    the rows of the programs. The result keeps the distances but for the error of the last step: the caller
    checks.
    """
    growth = Growth(shapes, options, budget, strict)
    earlier, placement, trust = _grown(growth, placement, steps, trust)
    if trust >= LAST_TRUSTS[-1] and not budget.late:
        placement = _cut_short(growth, earlier, placement)
    return placement


def _grown(
    growth: Growth, placement: Placement, steps: int, trust: float
) -> tuple[Placement | None, Placement, float]:
    """(placement one step before, None where that is taken back; placement; trust region) at the end."""
    outlines: list[Outline] = []
    sampled = np.inf
    earlier: Placement | None = None
    widest = growth.shapes.radius.max()
    for _ in range(steps):
        step = max(trust * growth.unit / 2, 0.75)
        if step < sampled / 1.5:
            sampled = step
            outlines = growth.outlines(step / placement.scale)
        found = growth.near(placement, outlines, trust)
        after = None
        if earlier is None or not growth.crossed(found):
            after = compaction_step(growth, placement, outlines, found, trust)
        if after is None:
            if earlier is None:
                break
            # the last step was too long: again, half as long
            placement, earlier, trust = earlier, None, trust / 2
            continue
        gain = after.scale / placement.scale - 1
        earlier, placement = placement, after
        if gain < LITTLE_GAIN * trust * growth.unit / (widest * placement.scale):
            trust /= 2
        if trust < LEAST_TRUST or growth.budget.over:
            break
    return earlier, placement, trust


def _cut_short(growth: Growth, earlier: Placement | None, placement: Placement) -> Placement:
    """Last small steps after an early end: they take back what the linear programs overshot."""
    outlines = growth.outlines(1 / placement.scale)
    for trust in LAST_TRUSTS:
        found = growth.near(placement, outlines, trust)
        if earlier is not None and growth.crossed(found):
            placement, earlier = earlier, None
            found = growth.near(placement, outlines, trust)
        after = compaction_step(growth, placement, outlines, found, trust)
        placement = placement if after is None else after
    return placement
