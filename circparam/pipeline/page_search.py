"""The search for cuts that make a page so much fuller that the cost of the atlas falls.

A cut costs its seam and a chart, and a page that is fuller by Δ log s pays ``COST.page`` · Δ log s. Boxes
estimate the page that each chord of each chart would leave, without laying anything out. The chords that
promise most are cut straight and sketched by a short nesting. The best of these is cut along edges of the
mesh, and the search goes on from there. A cut that does not pay may prepare one that does, so a few cuts
without gain are made before the search ends.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.packing.budget import Budget
from circparam.packing.nest.sketch import SketchGrid, least_page
from circparam.packing.options import PackOptions
from circparam.pipeline.page_cuts import Cutter, Outline, Part, split
from circparam.seams.cost import COST

CELLS = 32  # squared: cells that all charts cover together on a sketch
TRIES = 2  # orders of charts without a smaller page after which a sketch is done
COARSE = 2  # cells by which a page with one cut more may seem larger
CHORDS = 8  # that are sketched for each cut
AHEAD = 2  # cuts without gain that are made before the search ends


@dataclass(frozen=True, eq=False)
class Plan:
    """Charts with some cuts. seam: length that the cuts add, in roots of the area. log_share: logarithm of the
    covered share, sketched or (up to a constant) estimated."""

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
class _Trial:
    """Chord k of part n of a plan, or of this part opened by a slit; log_share: of the page with it."""

    n: int
    part: Part
    k: int
    seam: float
    log_share: float

    @property
    def cost(self) -> float:
        """What the cut and the page cost together."""
        return self.seam + COST.chart - COST.page * self.log_share


@dataclass(frozen=True, eq=False)
class Search:
    """What all plans share. most: cuts. options: of packing. sketches: whether pages are sketched. budget: of
    the faces of charts that are cut."""

    cutter: Cutter
    most: int
    options: PackOptions
    sketches: bool
    budget: Budget
    monitor: Monitor

    def plans(self, log_share: float) -> list[Plan]:
        """The plan without a cut, and plans with one cut more each.

        log_share: of the page without cuts. Sketches are compared with its sketch, which is as coarse.
        """
        charts = self.cutter.charts
        plans = [Plan(charts, 0.0, 0, self._log_share(charts) if self.sketches else log_share)]
        best = plans[0]
        while plans[-1].cuts < min(best.cuts + AHEAD, self.most) and not self.budget.over:
            after = self._following(plans[-1])
            if after is None:
                break
            plans.append(after)
            best = min(best, after, key=lambda plan: plan.cost)
        return plans

    def _following(self, plan: Plan) -> Plan | None:
        """The plan with the best cut more; None if no chord is left that can be cut."""
        while trials := self._apart(self._trials(plan)):
            if self.sketches:
                trials = self._sketched(plan, trials)
            for trial in trials:
                self.budget.spend(self._faces(trial.part))
                done = self.cutter.cut(trial.part, trial.k)
                if done is not None:
                    parts = [*plan.parts[: trial.n], *plan.parts[trial.n + 1 :], *done[0]]
                    share = trial.log_share if self.sketches else self._log_share(parts)
                    seam = plan.seam + (trial.part.slit + done[1]) / self.cutter.root
                    return Plan(parts, seam, plan.cuts + 1, share)
            if not trials or self.budget.over:
                break
        return None

    def _faces(self, part: Part) -> float:
        """Faces of a part."""
        if part.ground is not None:
            return float(len(part.ground.faces))
        return float((self.cutter.whole.cut_mesh.chart == part.outline.chart).sum())

    def _log_share(self, parts: list[Part]) -> float:
        """Logarithm of the covered share of a page of some parts."""
        if self.sketches:
            return self._sketched_share([p.outline for p in parts], np.inf)
        box = sum(p.box for p in parts)
        return float(self._estimate(parts, box, max(p.square for p in parts)))

    @cached_property
    def _grid(self) -> SketchGrid:
        """The grid on which all charts together cover CELLS squared."""
        gap = self.options.gap / 2 * CELLS / self.options.resolution
        return SketchGrid(self.cutter.root / CELLS, gap)

    def _sketched_share(self, outlines: list[Outline], below: float) -> float:
        """Logarithm of the covered share of the smallest page that is found for some outlines; −∞ if it has not
        fewer cells a side than ``below``.

        Where that is ∞ some page is found: a quarter of most is covered, and squares fit into a square of twice
        their area (Moon and Moser 1967). Outlines smaller than a cell go into gaps, of which the sketch has too
        few.
        """
        cell = (self.cutter.root / CELLS) ** 2
        shown = [o for o in outlines if o.area > cell] or outlines
        sketches = [self._grid.sketch(*o.edges) for o in shown]
        budget = Budget(np.inf, lambda: self.monitor.expired)
        sides = [below]
        if below == np.inf:
            squares = sum((s.least + 1) ** 2 for s in sketches)
            widest = max(s.least for s in sketches)
            sides = [max(2 * CELLS, widest + 2), np.sqrt(2 * squares) + 2]
        for side in sides:
            page = least_page(sketches, int(side), TRIES, budget)
            if page is not None:
                return 2 * float(np.log(CELLS / page.side))
        return -np.inf

    def _estimate(
        self, parts: list[Part], box: FloatArray | float, square: FloatArray | float
    ) -> FloatArray:
        """Logarithm of the share of a page by the sum of all least boxes and the widest least square.

        Between two pages: the larger one of the square and of charts that interlock half, and the square with
        all boxes beside it. Pages of 2 to 70 charts lie at a quarter of the way, on a scale of logarithms.
        """
        area, pages = sum(p.outline.area for p in parts), self.options.pages
        low = np.maximum(np.square(square), (np.asarray(box) + area) / (2 * pages))
        high = np.square(square) + np.asarray(box) / pages
        return np.asarray(np.log(area / pages) - 0.75 * np.log(low) - 0.25 * np.log(high))

    def _trials(self, plan: Plan) -> Iterator[_Trial]:
        """All chords by their estimated cost, the best first; parts whose cuts cannot pay are left out."""
        boxes = np.array([p.box for p in plan.parts])
        squares = np.array([p.square for p in plan.parts])
        areas = np.array([p.outline.area for p in plan.parts])
        order = np.argsort(squares)
        others = np.full(len(squares), squares[order[-1]])
        second = squares[order[-2]] if len(squares) > 1 else 0.0
        # the second widest part is cut after the widest
        others[order[-1]] = second / 2
        now = self._estimate(plan.parts, boxes.sum(), squares.max())
        most = self._estimate(plan.parts, boxes.sum() - boxes + areas, others)
        promising = np.flatnonzero(COST.page * (most - now) > COST.chart).tolist()
        cut = [(n, p) for n in promising for p in self._ways(plan.parts[n])]
        found = []
        for at, (n, part) in enumerate(cut):
            chords = part.chords
            square = np.maximum(chords.square, others[n])
            share = self._estimate(plan.parts, boxes.sum() - boxes[n] + chords.box, square)
            seam = (part.slit + chords.length) / self.cutter.root
            k = np.arange(len(seam))
            found.append(np.stack([np.full(len(k), at), k, seam, share, seam - COST.page * share]))
        every = np.concatenate(found, axis=1) if found else np.zeros((5, 0))
        if not self.sketches:  # they show gains where boxes see none
            every = every[:, COST.page * (every[3] - now) > COST.chart]
        every = every[:, np.argsort(every[4], kind="stable")]
        return (_Trial(*cut[int(at)], int(k), seam, share) for at, k, seam, share, _ in every.T)

    def _ways(self, part: Part) -> list[Part]:
        """A part as it is and, if it is a ring, opened by a slit: no chord of a ring divides it."""
        opened = self.cutter.slit(part) if part.outline.ring else None
        return [part] if opened is None else [part, opened]

    def _apart(self, trials: Iterable[_Trial]) -> list[_Trial]:
        """The first of the trials that lie apart from each other and from failed ones."""
        kept: list[_Trial] = []
        ends: dict[Part, FloatArray] = {}
        for trial in trials:
            part = trial.part
            if part not in ends:
                known = [np.concatenate(part.chords.ends(k)) for k in sorted(part.failed)]
                ends[part] = np.reshape(known, (-1, 4))
            here = np.concatenate(part.chords.ends(trial.k))
            d = np.sqrt((np.reshape(ends[part] - here, (-1, 2, 2)) ** 2).sum(2)).sum(1)
            if (d < 2 * COARSE / CELLS * self.cutter.root).any() or not part.chords.inside(trial.k):
                continue
            ends[part] = np.vstack([ends[part], here])
            kept.append(trial)
            if len(kept) == CHORDS:
                break
        return kept

    def _sketched(self, plan: Plan, trials: list[_Trial]) -> list[_Trial]:
        """The trials by their sketched pages, the best first; those that one before them beats are left out."""
        found: list[_Trial] = []
        least = np.inf
        for trial in trials:
            part = trial.part
            halves = split(part.outline, int(part.chords.i[trial.k]), int(part.chords.j[trial.k]))
            rest = [p.outline for n, p in enumerate(plan.parts) if n != trial.n]
            wanted = max((trial.seam + COST.chart - least) / COST.page, plan.log_share)
            below = CELLS * np.exp(-wanted / 2) + COARSE
            share = self._sketched_share([*rest, *halves], below)
            if share > -np.inf:
                found.append(replace(trial, log_share=share))
                least = min(least, found[-1].cost)
        return sorted(found, key=lambda trial: trial.cost)
