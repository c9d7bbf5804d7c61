"""Compact a layout: grow all charts at once until they lock, by linear programs.

Near a layout without overlap the distance between two outlines is linear to first order. Its variables are the
moves, the turns and the common growth of the charts. The largest growth that keeps all distances is then a
linear program. It is the compaction of Li and Milenkovic 1995 ("Compaction and separation algorithms for
non-convex polygons") with turns and growth. A few steps in a shrinking trust region reach the lock.
"""

from dataclasses import replace

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import FloatArray, IntArray, dot2, norms2
from circparam.core.linear_program import INTERIOR, SIMPLEX, least
from circparam.core.records import dataclass
from circparam.packing.nest.contacts import Contacts, to_world
from circparam.packing.nest.growth import REACH_TRUSTS, SLACK_TEXELS, STEP_LEAST_TEXELS, Growth
from circparam.packing.options import strip_gap
from circparam.packing.placement import Placement

# Rows of one linear program; real charts have some ten thousand, a bundle of needles touches itself everywhere.
ROWS_MOST = 60_000

# Pivots for each chart, after which the simplex counts as stalled: others take a tenth.
PIVOTS_MOST = 60

# Trust regions in texels of a page of 2048: the first; and the last, below which the raster shows no gain.
TRUST_FIRST = 32.0
TRUST_LEAST = 0.5

# A step that gains less than this share of the scale is followed by one half as long.
GAIN_LEAST = 2e-3


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
    bound = distance - (width + SLACK_TEXELS)
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
    border, side = options.border + SLACK_TEXELS, float(options.resolution)
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
    full gap in all directions. The budget counts rows times charts.
    """
    n = growth.shapes.n
    trust = trust * growth.unit
    matrix, bound = _program(growth, placement, found, REACH_TRUSTS * trust, strict)
    if len(bound) > ROWS_MOST:
        return None
    growth.budget.spend(float(len(bound) * n))
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
    solved = least(cost, columns, right, 1.0, SIMPLEX, PIVOTS_MOST * (n + 10))
    if solved.stalled:
        solved = least(cost, columns, right, 1.0, INTERIOR, PIVOTS_MOST)
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
    growth: Growth, placement: Placement, trust: float = TRUST_FIRST, strict: bool = False
) -> Placement:
    """Grow a layout free of overlap until it locks, or until the budget of ``growth`` is used up.

    trust: first trust region in texels of a page of 2048. strict: keep the full gap in all directions, for
    layouts that the check refuses. The result keeps the distances up to the error of the last step: the caller
    checks.
    """
    ascent = Ascent(placement, trust, strict)
    ascent.climb(growth)
    return ascent.placement


@dataclass(eq=False)
class Ascent:
    """A layout that grows.

    placement: the layout now. trust: the trust region of the next step, in texels of a page of 2048. strict:
    as in ``compact``. earlier: the layout one step before; None at first, and after a step was taken back.
    """

    placement: Placement
    trust: float = TRUST_FIRST
    strict: bool = False
    earlier: Placement | None = None

    def climb(self, growth: Growth, steps: float = np.inf, reached: float = 0.0) -> None:
        """Make steps until charts lock, at most ``steps``; stop where the scale ``reached`` is out of reach.

        A step with next to no gain is followed by one half as long. A step that makes charts
        overlap on a coarse raster is not made. A step is taken back if a tip may be through a neighbour, or if
        no further step keeps all distances.
        """
        while steps > 0 and self.trust >= TRUST_LEAST and not growth.budget.late:
            if (
                growth.budget.over
            ):  # the last steps are short: they correct the error of the programs
                self.trust = min(self.trust, 2 * TRUST_LEAST)
            most = self._largest_gain(growth)
            if self.placement.scale * (1 + most) ** steps < reached:
                break
            steps -= 1
            contacts = self._contacts(growth)
            if self.earlier is not None and growth.crossed(contacts):
                self._take_back()
                continue
            after = compaction_step(growth, self.placement, contacts, self.trust, self.strict)
            if after is None:
                if self.earlier is None:
                    break
                self._take_back()
            elif growth.overlaps(after):
                self.trust /= 2
            else:
                gain = after.scale / self.placement.scale - 1
                self.earlier, self.placement = self.placement, after
                if gain < GAIN_LEAST or growth.budget.over:
                    self.trust /= 2
        if self.earlier is not None and growth.crossed(self._contacts(growth)):
            self._take_back()

    def _take_back(self) -> None:
        """Undo the last step; the next one is half as long."""
        self.placement, self.earlier = self.earlier or self.placement, None
        self.trust /= 2

    def _largest_gain(self, growth: Growth) -> float:
        """Largest relative gain of scale in the trust region."""
        widest = growth.shapes.radius.max() * self.placement.scale
        return float(self.trust * growth.unit / max(widest, 1e-9))

    def _contacts(self, growth: Growth) -> Contacts:
        """The contacts that matter to a step in the trust region."""
        step = max(self.trust * growth.unit, STEP_LEAST_TEXELS) / self.placement.scale
        return growth.near(self.placement, growth.outlines(step), self.trust)
