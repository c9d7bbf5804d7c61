"""Compact a layout: grow all charts at once until they lock, by linear programs.

Near a layout without overlap the distance between two outlines is linear to first order. Its variables are the
moves, the turns and the common growth of the charts. The largest growth that keeps all distances is then a
linear program. It is the compaction of Li and Milenkovic 1995 ("Compaction and separation algorithms for
non-convex polygons") with turns and growth. A few steps in a shrinking trust region reach the lock.
"""

from dataclasses import field, replace

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import cross2, dot2, norms2
from circparam.core.linear_program import INTERIOR, least
from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.packing.budget import Budget
from circparam.packing.nest.contacts import (
    Contacts,
    Outlines,
    find_contacts,
    sample_outlines,
    to_world,
)
from circparam.packing.options import MARGIN_TEXELS, PackOptions, strip_gap
from circparam.packing.outlines import Shapes
from circparam.packing.placement import Placement
from circparam.packing.straight import Straight

# Trust regions in texels of a page of 2048, the first and the last. Pages over those of these values, of 89
# layouts: first 4: 0.995 [0.993, 0.997], 8: 0.999 [0.997, 1.001], 32: 0.998 [0.995, 1.000], and 0.98 for 400
# strips; last 2 and 0.5: 0.999 [0.996, 1.000].
TRUST_FIRST = 16.0
TRUST_LEAST = 1.0

# A step that gains less than this share of the scale is followed by one half as long. Pages, 89 layouts: 0.002
# covers 0.997 [0.995, 0.998], 0.001 covers 0.999, 0.0002 covers 1.001.
GAIN_LEAST = 5e-4

# Trust regions beyond the gap within which contacts count: two charts may move towards each other.
REACH_TRUSTS = 2.0

# Room in texels for the error of the linear programs: curvature of the outlines and of the turns.
SLACK_TEXELS = 2 * MARGIN_TEXELS


@dataclass(frozen=True, eq=False)
class Growth:
    """Data of charts that growth does not change, for all layouts of the same charts.

    straight: charts that stay along the axes where they lie so, None for none. sampled: outlines that were
    sampled already, by their step.
    """

    shapes: Shapes
    options: PackOptions
    budget: Budget
    straight: Straight | None = None
    sampled: dict[float, Outlines] = field(default_factory=dict)

    @property
    def unit(self) -> float:
        """Texels of the page in one texel of a page of 2048."""
        return self.options.resolution / 2048

    def turning(self, placement: Placement) -> FloatArray:
        """(n,) 1 for charts that may be turned, 0 for fixed ones and for those that stay along the axes."""
        free = np.full(self.shapes.n, float(self.options.rotate == "free"))
        if self.straight is not None:
            free[self.straight.lying(placement.angle)] = 0.0
        return free

    def contacts(self, placement: Placement, trust: float) -> Contacts:
        """The contacts that matter to a step in a trust region (texels of a page of 2048).

        Outlines are sampled a trust region apart, at least a texel. Steps are rounded down to powers of √2, so
        that layouts of nearly one scale share their samples.
        """
        step = max(trust * self.unit, 1.0)
        rung = float(2 ** (np.floor(2 * np.log2(step / placement.scale)) / 2))
        if rung not in self.sampled:
            self.sampled[rung] = sample_outlines(self.shapes, rung)
        reach = self.options.gap + SLACK_TEXELS + REACH_TRUSTS * trust * self.unit
        return find_contacts(placement, self.sampled[rung], reach, step)


def compaction_step(
    growth: Growth, placement: Placement, found: Contacts, trust: float, grow: bool = True
) -> Placement | None:
    """One linear program: the largest growth within the trust region; None if it fails.

    found: contacts of the outlines as they are placed. trust: in texels of a page of 2048. grow: whether charts
    may grow, or only shrink. The budget counts rows; a larger program is not tried.
    """
    n = growth.shapes.n
    trust = trust * growth.unit
    matrix, bound = _program(growth, placement, found, REACH_TRUSTS * trust)
    if len(bound) > growth.budget.total:
        return None
    growth.budget.spend(len(bound))
    reach = np.maximum(growth.shapes.radius * placement.scale, 1e-9)
    turn = trust / reach * growth.turning(placement)
    most = np.concatenate([np.full(2 * n, trust), turn, [trust / reach.max()]])
    cost = np.zeros(3 * n + 1)
    cost[-1] = -1.0
    # unknowns in units of the trust region, so that the solver sees numbers near 1
    matrix.data *= most[matrix.indices] / trust
    right = bound / trust
    upper = np.ones(3 * n + 1)
    upper[-1] = float(grow)
    # charts with room end at no wall of it; presolving takes longer than it saves
    unknown = least(cost, matrix.tocsc(), right, (-np.ones(3 * n + 1), upper), INTERIOR)
    if unknown is None:
        return None
    z = unknown * most
    return replace(
        placement,
        scale=placement.scale * (1 + z[-1]),
        angle=placement.angle + z[2 * n : 3 * n],
        offset=placement.offset + np.stack([z[:n], z[n : 2 * n]], 1),
    )


def _program(
    growth: Growth, placement: Placement, found: Contacts, reach: float
) -> tuple[sps.csr_matrix, FloatArray]:
    """Rows A z <= b, b < reach, with z = (moves x, moves y, turns, growth): 3n + 1 unknowns.

    Rows keep two charts apart at each contact, and charts from the four sides of their page.
    """
    shapes, options, n = growth.shapes, growth.options, growth.shapes.n
    d = found.p - found.q
    distance = norms2(d)
    normal = d / np.maximum(distance, 1e-12)[:, None]
    rp, rq = found.p - placement.offset[found.i], found.q - placement.offset[found.j]
    x, y = normal.T
    i, j, last = found.i, found.j, np.full(len(d), 3 * n)
    columns = np.stack([i, j, n + i, n + j, 2 * n + i, 2 * n + j, last], 1)
    levers = cross2(normal, rp), -cross2(normal, rq), -dot2(normal, rp - rq)
    values = np.stack([-x, x, -y, y, *levers], 1)
    width = strip_gap(options.padding, normal)
    blocks = [(columns, values, distance - (width + SLACK_TEXELS))]
    corner = shapes.start
    own = shapes.owner[corner]
    here = to_world(placement, own, shapes.points[corner])
    r = here - placement.offset[own]
    border = options.border + SLACK_TEXELS
    last, ones = np.full(len(own), 3 * n), np.ones(len(own))
    for axis, lever in ((0, -r[:, 1]), (1, r[:, 0])):
        columns = np.stack([axis * n + own, 2 * n + own, last], 1)
        values = np.stack([ones, lever, r[:, axis]], 1)
        blocks.append((columns, -values, here[:, axis] - border))
        blocks.append((columns, values, options.resolution - border - here[:, axis]))
    blocks = [(c[b < reach], v[b < reach], b[b < reach]) for c, v, b in blocks]
    column, value = (np.concatenate([x[k].ravel() for x in blocks]) for k in (0, 1))
    bounds = np.concatenate([b for _, _, b in blocks])
    begin = np.r_[0, np.cumsum(np.concatenate([np.full(len(b), c.shape[1]) for c, _, b in blocks]))]
    return sps.csr_matrix((value, column, begin), shape=(len(bounds), 3 * n + 1)), bounds


@dataclass(eq=False)
class Ascent:
    """A layout that grows.

    placement: the layout now. trust: the trust region of the next step, in texels of a page of 2048. earlier:
    the layout one step before; None at first, and after a step was taken back.
    """

    placement: Placement
    trust: float = TRUST_FIRST
    earlier: Placement | None = None

    def climb(self, growth: Growth, steps: float = np.inf, reached: float = 0.0) -> Placement:
        """Make steps until charts lock, at most ``steps``; stop where the scale ``reached`` is out of reach.

        A step with next to no gain is followed by one half as long. A step is taken back if outlines cross
        afterwards, or if no further step keeps all distances. The result keeps the distances up to the error of
        the last step: the caller checks.
        """
        widest = max(float(growth.shapes.radius.max()) / growth.unit, 1e-9)
        while steps > 0 and self.trust >= TRUST_LEAST and not growth.budget.late:
            if growth.budget.over:  # the last steps correct the error of the programs
                self.trust = min(self.trust, 2 * TRUST_LEAST)
            most = self.trust / (widest * self.placement.scale)
            if self.placement.scale * (1 + most) ** steps < reached:
                break
            steps -= 1
            contacts = growth.contacts(self.placement, self.trust)
            if self.earlier is not None and contacts.crossing:
                self._take_back()
                continue
            after = compaction_step(growth, self.placement, contacts, self.trust)
            if after is None:
                self._take_back()
            else:
                gain = after.scale / self.placement.scale - 1
                self.earlier, self.placement = self.placement, after
                if gain < GAIN_LEAST or growth.budget.over:
                    self.trust /= 2
        if self.earlier is not None and growth.contacts(self.placement, self.trust).crossing:
            self._take_back()
        return self.placement

    def settle(self, growth: Growth) -> Placement:
        """Correct the error that the last steps left in the distances; nothing grows.

        The width of a gap changes with its direction on the raster, so each step is half as long as the last.
        """
        for trust in TRUST_LEAST / 2 ** np.arange(3):
            contacts = growth.contacts(self.placement, trust)
            after = compaction_step(growth, self.placement, contacts, trust, grow=False)
            self.placement = after or self.placement
        return self.placement

    def _take_back(self) -> None:
        """Undo the last step; the next one is half as long."""
        self.placement, self.earlier = self.earlier or self.placement, None
        self.trust /= 2
