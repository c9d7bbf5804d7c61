"""Compact a layout: grow all charts at once until they lock, by linear programs.

Near a layout without overlap the distance between two outlines is linear to first order. Its variables are the
moves, the turns and the common growth of the charts. The largest growth that keeps all distances is then a
linear program. It is the compaction of Li and Milenkovic 1995 ("Compaction and separation algorithms for
non-convex polygons") with turns and growth. A few steps in a shrinking trust region reach the lock.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import FloatArray, IntArray, dot2, norms2
from circparam.core.linear_program import INTERIOR, SIMPLEX, least
from circparam.core.records import dataclass
from circparam.packing.nest.contacts import Contacts, to_world
from circparam.packing.nest.growth import REACH, SLACK, Growth
from circparam.packing.options import strip_gap
from circparam.packing.placement import Placement

# Rows of one linear program; layouts of real charts have some ten thousand at most.
MOST_ROWS = 60_000

# Pivots for each chart, after which the simplex counts as stalled: others take a tenth.
PIVOTS = 60

# Samples lie at most this share of a trust region apart along the edges.
STEP = 0.7

# Trust regions in texels of a page of 2048: the first; the smallest, below which the raster shows no gain;
# and those of the last steps after an early end, which correct the error.
FIRST_TRUST = 32.0
LEAST_TRUST = 0.25
LAST_TRUSTS = (1.0, 0.5)

# A step with less than this share of the possible gain is followed by a shorter one.
LITTLE_GAIN = 0.2

# One that gains less than this share is followed by one a quarter as long: charts are locked, or nearly.
LOCKED = 0.02


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _program(
    growth: Growth, placement: Placement, found: Contacts, reach: float, strict: bool
) -> tuple[sps.csr_matrix, FloatArray]:
    """Rows A z <= b, b < reach, with z = (moves x, moves y, turns, growth): 3n + 1 unknowns."""
    n, options = growth.shapes.n, growth.options
    d = found.p - found.q
    distance = norms2(d)
    normal = d / np.maximum(distance, 1e-12)[:, None]
    rp, rq = found.p - placement.offset[found.i], found.q - placement.offset[found.j]
    width = options.gap if strict else strip_gap(options.padding, normal)
    i, j, k = found.i, found.j, len(distance)
    grow = np.full(k, 3 * n)
    columns = np.stack([i, j, n + i, n + j, 2 * n + i, 2 * n + j, grow], 1)
    values = np.stack(
        [
            -normal[:, 0],
            normal[:, 0],
            -normal[:, 1],
            normal[:, 1],
            _cross(normal, rp),
            -_cross(normal, rq),
            -dot2(normal, rp - rq),
        ],
        1,
    )
    bound = distance - (width + growth.slack)
    inside = bound < reach
    blocks = [(columns[inside], values[inside], bound[inside])]
    blocks += _border_rows(growth, placement, reach)
    entries = np.concatenate([np.full(len(c), c.shape[1]) for c, _, _ in blocks])
    column = np.concatenate([c.ravel() for c, _, _ in blocks])
    value = np.concatenate([v.ravel() for _, v, _ in blocks])
    bounds = np.concatenate([b for _, _, b in blocks])
    begin = np.r_[0, np.cumsum(entries)]
    return sps.csr_matrix((value, column, begin), shape=(len(bounds), 3 * n + 1)), bounds


def _border_rows(
    growth: Growth, placement: Placement, reach: float
) -> list[tuple[IntArray, FloatArray, FloatArray]]:
    """Rows that keep charts from the four sides of their page: (columns, values, bounds) of each."""
    n, options = growth.shapes.n, growth.options
    border, side = options.border + SLACK, float(options.resolution)
    corner, _ = growth.shapes.hull
    own = growth.shapes.owner[corner]
    here = to_world(placement, own, growth.shapes.points[corner])
    r = here - placement.offset[own]
    blocks = []
    for axis, sign in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        bound = here[:, axis] - border if sign < 0 else side - border - here[:, axis]
        near = np.flatnonzero(bound < reach)
        lever = -r[near, 1] if axis == 0 else r[near, 0]
        c = own[near]
        columns = np.stack([axis * n + c, 2 * n + c, np.full(len(c), 3 * n)], 1)
        ones = np.ones(len(c))
        blocks.append((columns, sign * np.stack([ones, lever, r[near, axis]], 1), bound[near]))
    return blocks


def compaction_step(
    growth: Growth, placement: Placement, found: Contacts, trust: float, strict: bool = False
) -> Placement | None:
    """One linear program: the largest growth within the trust region; None if it fails.

    found: contacts of the outlines as they are placed. trust: in texels of a page of 2048. strict: keep the
    full gap in all directions. A program that would be too large fails too: a bundle of needles touches itself
    in every direction.
    """
    n = growth.shapes.n
    trust = trust * growth.unit
    matrix, bound = _program(growth, placement, found, REACH * trust, strict)
    if len(bound) > MOST_ROWS:
        return None
    growth.budget.spend(float(len(bound)))
    reach = np.maximum(growth.shapes.radius * placement.scale, 1e-9)
    turn = trust / reach * growth.turning(placement)
    most = np.concatenate([np.full(2 * n, trust), turn, [trust / reach.max()]])
    cost = np.zeros(3 * n + 1)
    cost[-1] = -1.0
    # unknowns in units of the trust region, so that the solver sees numbers near 1
    matrix.data *= most[matrix.indices] / trust
    right = bound / trust
    # Presolving takes longer than it saves. The simplex stalls on a few programs; interior points solve them,
    # and take longer on all others.
    columns = matrix.tocsc()
    solved = least(cost, columns, right, 1.0, SIMPLEX, PIVOTS * (n + 10))
    if solved.stalled:
        solved = least(cost, columns, right, 1.0, INTERIOR, PIVOTS)
    if solved.x is None:
        return None
    z = solved.x * most
    return replace(
        placement,
        scale=placement.scale * (1 + z[-1]),
        angle=placement.angle + z[2 * n : 3 * n],
        offset=placement.offset + np.stack([z[:n], z[n : 2 * n]], 1),
    )


def compact(
    growth: Growth,
    placement: Placement,
    steps: int,
    trust: float = FIRST_TRUST,
    strict: bool = False,
) -> Placement:
    """Grow a layout free of overlap until it locks, by at most ``steps`` linear programs.

    trust: first trust region in texels of a page of 2048. Half of it follows a step with little of the possible
    gain, a quarter a step with next to no gain. The least region is a quarter of a texel. A step that makes
    charts overlap on a coarse raster is not made. A step is taken back if a tip may be through a neighbour, or
    if no further step keeps all distances. strict: keep the full gap in all directions, where the width of
    straight strips would do; for layouts that the check refuses. The budget counts the rows of the programs.
    The result keeps the distances up to the error of the last step: the caller checks.
    """
    ascent = Ascent(placement, trust, strict)
    ascent.climb(growth, steps)
    if ascent.trust >= LAST_TRUSTS[-1] and not growth.budget.late:
        return _cut_short(growth, ascent.earlier, ascent.placement, strict)
    return ascent.placement


def roughly(growth: Growth, placement: Placement, steps: int, reached: float) -> Placement:
    """As ``compact``, without the last small steps. The run ends early if it cannot exceed a scale that another
    layout has ``reached``."""
    ascent = Ascent(placement, FIRST_TRUST, reached=reached)
    ascent.climb(growth, steps)
    return ascent.placement


@dataclass(eq=False)
class Ascent:
    """A layout on its way up.

    placement: the current one; earlier: one step before, None at first or after a step was taken back. trust:
    the trust region now. strict, as in ``compact``; reached: scale that others have.
    """

    placement: Placement
    trust: float
    strict: bool = False
    reached: float = 0.0
    earlier: Placement | None = None

    def climb(self, growth: Growth, steps: int) -> None:
        """Make up to so many steps."""
        for number in range(steps):
            if self.outrun(growth, steps - number):
                break
            found = _looked_at(growth, self.placement, self.trust)
            after = None
            if self.earlier is None or not growth.crossed(found):
                after = compaction_step(growth, self.placement, found, self.trust, self.strict)
            if after is None:
                if self.earlier is None:
                    break
                # the last step was too long: again, half as long
                self.placement, self.earlier = self.earlier, None
                self.trust /= 2
                continue
            if growth.overlaps(after):
                self.trust /= 2
            else:
                self.take(growth, after)
            if self.trust < LEAST_TRUST or growth.budget.over:
                break
        if self.earlier is not None and growth.crossed(
            _looked_at(growth, self.placement, self.trust)
        ):
            self.placement, self.earlier = self.earlier, None

    def take(self, growth: Growth, after: Placement) -> None:
        """Make a step; its gain sets the next trust region."""
        gain = after.scale / self.placement.scale - 1
        self.earlier, self.placement = self.placement, after
        most = self.most(growth)
        if gain >= LITTLE_GAIN * most:
            return
        if abs(gain) > LOCKED * most or self.trust <= 2 * LEAST_TRUST:
            self.trust /= 2
        else:  # locked; final if the scale is below that of other layouts
            self.trust /= 4 if after.scale >= self.reached else np.inf

    def most(self, growth: Growth) -> float:
        """Largest gain of a step in the trust region."""
        widest = growth.shapes.radius.max() * self.placement.scale
        return float(self.trust * growth.unit / max(widest, 1e-9))

    def outrun(self, growth: Growth, steps: int) -> bool:
        """Whether no steps, so many, lead to the scale that others have reached."""
        return bool(self.placement.scale * (1 + self.most(growth)) ** steps < self.reached)


def _looked_at(growth: Growth, placement: Placement, trust: float) -> Contacts:
    """The contacts after a step in a trust region (texels of a page of 2048)."""
    step = max(trust * growth.unit * STEP, growth.finest)
    return growth.near(placement, growth.outlines(step / placement.scale), trust)


def _cut_short(
    growth: Growth, earlier: Placement | None, placement: Placement, strict: bool
) -> Placement:
    """Last small steps after an early end: they correct the error of the linear programs."""
    outlines = growth.outlines(max(1.0, growth.finest) / placement.scale)
    for trust in LAST_TRUSTS:
        found = growth.near(placement, outlines, trust)
        if earlier is not None and growth.crossed(found):
            placement, earlier = earlier, None
            found = growth.near(placement, outlines, trust)
        after = compaction_step(growth, placement, found, trust, strict)
        placement = placement if after is None else after
    return placement
