"""The search for cuts that make a page so much fuller that the cost of the atlas falls.

A cut costs its seam and a chart, and a page that is fuller by Δ log s pays ``COST.page`` · Δ log s. Boxes
estimate the page that each chord of each chart would leave, without laying anything out. The chord that
promises most is cut along edges of the mesh, and the search goes on from there. A cut that does not pay may
prepare one that does, so a few cuts without gain are made before the search ends.
"""

from collections.abc import Iterator

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.packing.budget import Budget
from circparam.pipeline.page_cuts import Cutter, Part
from circparam.seams.cost import COST

AHEAD = 4  # cuts without gain before the search ends: a ring lies well in four parts


@dataclass(frozen=True, eq=False)
class Plan:
    """Charts with some cuts. seam: length that the cuts add, in roots of the area. log_share: logarithm of the
    covered share, packed or estimated."""

    parts: list[Part]
    seam: float
    cuts: int
    log_share: float

    @property
    def cost(self) -> float:
        """What the cuts and the page cost together."""
        return self.packed_cost(self.log_share)

    @property
    def price(self) -> float:
        """What the cuts cost."""
        return self.seam + COST.chart * self.cuts

    def packed_cost(self, log_share: float) -> float:
        """What the cuts cost together with the page on which the charts were packed."""
        return self.price - COST.page * log_share

    def least(self, other: "Plan", scale: float) -> float:
        """The scale of charts at which this plan costs as much as another whose charts reach ``scale``."""
        return scale * float(np.exp((self.price - other.price) / (2 * COST.page)))


@dataclass(frozen=True, eq=False)
class Search:
    """What all plans share. most: cuts. pages: that are filled. budget: of the faces of charts that are cut.
    draft: whether plans are compared by their estimates alone."""

    cutter: Cutter
    most: int
    pages: int
    budget: Budget
    draft: bool

    def plans(self, log_share: float | None) -> list[Plan]:
        """The plan without a cut, and plans with one cut more each. log_share: of the page without cuts, None
        to estimate that one too."""
        if log_share is None:
            log_share = self._log_share(self.cutter.charts)
        plans = [Plan(self.cutter.charts, 0.0, 0, log_share)]
        best = plans[0]
        while plans[-1].cuts < min(best.cuts + AHEAD, self.most) and not self.budget.over:
            if self.draft and not self._promising(plans[-1], best):
                break
            after = self._following(plans[-1])
            if after is None:
                break
            plans.append(after)
            best = min(best, after, key=lambda plan: plan.cost)
        return plans

    def _promising(self, plan: Plan, best: Plan) -> bool:
        """Whether cuts along chords themselves, the best first, lead to less than the best plan costs."""
        while plan.cuts < min(best.cuts + AHEAD, self.most):
            trials = (t for t in self._trials(plan) if self.cutter.worth_trying(t[1], t[2]))
            trial = next(trials, None)
            if trial is None:
                return False
            n, part, k, _ = trial
            halves = self.cutter.straight_parts(part, k)
            plan = self._cut(plan, n, halves, part.slit + float(part.chords.length[k]))
            if plan.cost < best.cost:
                return True
        return False

    def _cut(self, plan: Plan, n: int, halves: list[Part], seam: float) -> Plan:
        """The plan with both halves in place of its part n. seam: length of what is cut."""
        parts = [*plan.parts[:n], *plan.parts[n + 1 :], *halves]
        seam = plan.seam + seam / self.cutter.root
        return Plan(parts, seam, plan.cuts + 1, self._log_share(parts))

    def _following(self, plan: Plan) -> Plan | None:
        """The plan with the best cut more; None if no chord is left that can be cut.

        A way along edges may cost more than its chord: other chords are cut too while they promise more than
        the best cut that was made.
        """
        best: Plan | None = None
        least, made = np.inf, []
        for n, part, k, cost in self._trials(plan):
            if self.budget.over or cost >= least:
                break
            if not self.cutter.worth_trying(part, k):
                continue
            self.budget.spend(float(len(self.cutter.ground_of(part).faces)))
            done = self.cutter.cut(part, k)
            if done is None:
                continue
            part.failed.add(k)  # none beside it is tried, until the best is known
            made.append((part, k))
            cost += (done[1] - float(part.chords.length[k])) / self.cutter.root
            if cost < least:
                best, least = self._cut(plan, n, done[0], part.slit + done[1]), cost
        for part, k in made:
            part.failed.discard(k)
        return best

    def _log_share(self, parts: list[Part]) -> float:
        """Logarithm of the covered share that is estimated for a page of some parts."""
        widest = max(parts, key=lambda p: p.square)
        boxes = np.array([p.box for p in parts])
        return float(self._estimate(parts, boxes.sum(), widest.square, widest.box))

    def _estimate(
        self,
        parts: list[Part],
        boxes: FloatArray | float,
        square: FloatArray | float,
        widest: FloatArray | float,
    ) -> FloatArray:
        """Logarithm of the share of a page by the sum of all least boxes, square and box of the widest part.

        The mean of two pages. One is the larger of the square and of charts that interlock half; the other is
        the square with all other boxes beside it. One chart fills its square.
        """
        area, pages, square = sum(p.outline.area for p in parts), self.pages, np.square(square)
        low = np.maximum(square, (np.asarray(boxes) + area) / (2 * pages))
        high = square + (np.asarray(boxes) - widest) / pages
        return np.asarray(np.log(area / pages) - np.log(low * high) / 2)

    def _trials(self, plan: Plan) -> Iterator[tuple[int, Part, int, float]]:
        """Chords by their estimated cost, the best first: (number of the part in the plan, the part as it is or
        opened by a slit, number of its chord, its seam without what the page gains).

        A cut that gains less than half a chart prepares none.
        """
        parts = plan.parts
        boxes = np.array([p.box for p in parts])
        squares = np.array([p.square for p in parts])
        areas = np.array([p.outline.area for p in parts])
        order = np.argsort(squares)
        # of all parts but one: square and box of the widest
        others = np.full(len(parts), squares[order[-1]])
        widest = np.full(len(parts), boxes[order[-1]])
        # the second widest part is cut after the widest
        others[order[-1]] = squares[order[-2]] / 2 if len(parts) > 1 else 0.0
        widest[order[-1]] = boxes[order[-2]] / 4 if len(parts) > 1 else 0.0
        rest, now = boxes.sum() - boxes, self._log_share(parts)
        most = self._estimate(parts, rest + areas, others, widest)
        promising = np.flatnonzero(COST.page * (most - now) > COST.chart).tolist()
        cut = []
        for n in promising:  # no chord of a ring divides it: a slit opens it
            ring = parts[n].outline.ring and not parts[n].drawn
            opened = self.cutter.slit(parts[n]) if ring else None
            cut += [(n, parts[n])] if opened is None else [(n, parts[n]), (n, opened)]
        found = []
        for at, (n, part) in enumerate(cut):
            chords = part.chords
            wider = chords.square > others[n]
            square = np.where(wider, chords.square, others[n])
            box = np.where(wider, chords.widest, widest[n])
            share = self._estimate(parts, rest[n] + chords.box, square, box)
            seam = (part.slit + chords.length) / self.cutter.root
            gain = COST.page * (share - now)
            k = np.arange(len(seam))
            found.append(np.stack([np.full(len(k), at), k, gain, seam - gain]))
        every = np.concatenate(found, axis=1) if found else np.zeros((4, 0))
        every = every[:, every[2] > COST.chart / 2]
        order = np.argsort(every[3], kind="stable")
        return ((*cut[int(at)], int(k), cost) for at, k, _, cost in every[:, order].T.tolist())
