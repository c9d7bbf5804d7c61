"""The search for plans of cuts: level by level, each in tasks that processes share.

The division of a level, and its budget, do not depend on the number of processes. A look at a chord needs only
sketches; a real cut needs its chart.
"""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.workers import Worker
from circparam.packing.budget import Budget
from circparam.packing.nest.sketch import Sketch, least_page
from circparam.pipeline.chords import Chords
from circparam.pipeline.cut_along import Chord
from circparam.pipeline.cut_plan import (
    ALIKE,
    APART,
    CELLS,
    CUT,
    CUTTING,
    GOOD,
    LONG,
    NEAR,
    PART,
    PIECE,
    RATE,
    REACHED,
    WORSE,
    ZIGZAG,
    Effort,
    Plan,
    Sides,
    effort_of,
    page_sides,
    value_of,
)
from circparam.pipeline.pieces import AtlasCutter, ChartCutter, Cut, Ground, Halves


@dataclass(frozen=True, eq=False)
class Planner:
    """State that all plans for one layout share.

    cutter: makes the cuts. area: of all charts. longest: length of boundaries that is not exceeded. most: cuts.
    budget: of cells that sketches transform; real cuts spend from it too. monitor: gives the number of
    processes. spared: further area of faces that may be stretched too much.
    """

    cutter: AtlasCutter
    area: float
    longest: float
    most: int
    budget: Budget
    monitor: Monitor
    spared: float = np.inf

    @property
    def cell(self) -> float:
        """Side of a cell of the sketches in uv."""
        return self.cutter.grid.cell

    def effort(self, plan: Plan) -> Effort:
        """Effort for the plans that follow a plan."""
        return effort_of(len(plan.pieces), self.cutter)

    def best(self, first: Plan) -> list[Plan]:
        """The plans worth more than ``first``, those of the highest value first."""
        best, kept, effort = first, [first], self.effort(first)
        found: list[Plan] = []
        while kept and kept[0].cuts < min(best.cuts + effort.lookahead, self.most):
            made = self._following(kept, best.value)
            made.sort(key=lambda p: -p.value)
            kept = _distinct(made, effort.breadth)
            found += [p for p in kept if p.value > first.value]
            best = max([best, *kept], key=lambda p: p.value)
            kept = [p for p in kept if p.share < GOOD]
        return sorted(found, key=lambda p: -p.value)

    def _following(self, plans: list[Plan], best: float) -> list[Plan]:
        """Plans with one more cut. Sketches rank the chords, and the first chords that can be cut are taken."""
        queues = self._ranked(plans, best)
        made: list[list[Plan]] = [[] for _ in plans]
        while not self.budget.over:
            # no more tasks at once than cuts wanted: the tried chords are then the same as one after another
            wanted = [self.effort(p).made - len(m) for p, m in zip(plans, made, strict=True)]
            turns = [(k, t) for k, queue in enumerate(queues) for t in queue[: wanted[k]]]
            queues = [queue[n:] for queue, n in zip(queues, wanted, strict=True)]
            if not turns:
                break
            share = self.budget.left / len(turns)
            tasks = [(self._making(plans[k], trial), share) for k, trial in turns]
            done = Worker(self.monitor.jobs).map(made_cut, tasks, self.monitor)
            for (k, trial), (cut, sides, spent) in zip(turns, done, strict=True):
                self.budget.spend(spent)
                plans[k].pieces[trial.n].known[trial.k] = cut
                if cut is not None and sides is not None:
                    made[k].append(_after(plans[k], trial, cut, sides))
        return [after for of_plan in made for after in of_plan]

    def _ranked(self, plans: list[Plan], best: float) -> list[list[_Trial]]:
        """The chords of each plan in the order of their sketches, best first."""
        # All chords of one plan go together. Two turns, each with its own best value, find other cuts
        # (tower_holes: 0.65 to 0.58 of the page) in nine tenths of the time.
        trials_of = [self._trials(plan, best) for plan in plans]
        share = self.budget.left / len(plans)
        tasks = [(self._look(p, t), share) for p, t in zip(plans, trials_of, strict=True)]
        done = Worker(self.monitor.jobs).map(looked_at, tasks, self.monitor)
        ranked: list[list[tuple[float, float, _Trial]]] = [[] for _ in plans]
        for queue, plan, trials, (look, _), (sides, sketches, spent) in zip(
            ranked, plans, trials_of, tasks, done, strict=True
        ):
            self.budget.spend(spent)
            for halves, found in zip(look.halves, sketches, strict=True):
                halves.found = found
            for trial, side in zip(trials, sides, strict=False):
                if side is not None:
                    value = value_of(side, plan.length + ZIGZAG * trial.length)
                    queue.append((-value, -trial.promise, trial))
        return [
            [t for *_, t in sorted(queue, key=lambda w: w[:2])][: self.effort(plan).tried]
            for queue, plan in zip(ranked, plans, strict=True)
        ]

    def _look(self, plan: Plan, trials: list[_Trial]) -> Look:
        return Look(
            self.cutter.chart_cutter,
            [p.sketch for p in plan.pieces],
            [t.n for t in trials],
            [self.cutter.halves(plan.pieces[t.n], t.k) for t in trials],
            [plan.length + ZIGZAG * t.length for t in trials],
            plan.sketched + WORSE + 1,
            self.effort(plan).tries,
        )

    def _making(self, plan: Plan, trial: _Trial) -> Making:
        piece = plan.pieces[trial.n]
        known = trial.k in piece.known
        return Making(
            self.cutter.chart_cutter,
            None if known else self.cutter.task(piece, trial.k),
            piece.known.get(trial.k),
            [p.sketch for n, p in enumerate(plan.pieces) if n != trial.n],
            (self.longest - plan.length, self.spared - plan.stretched),
            plan.sketched + WORSE + 1,
            effort_of(len(plan.pieces) + 1, self.cutter).more,
        )

    def _trials(self, plan: Plan, best: float) -> list[_Trial]:
        """Chords worth a sketch, the most promising first."""
        longest = min(self.longest, float(np.exp((np.log(REACHED) - best) / RATE)))
        sketches = [p.sketch for p in plan.pieces]
        boxes = np.array([float(s.masks.size.prod(1).min()) for s in sketches])
        squares = np.array([float(s.least) for s in sketches])
        trials = []
        for n, piece in enumerate(plan.pieces):
            outline = piece.outline
            if boxes[n] < CUT * CELLS**2 and squares[n] < LONG * plan.side:
                continue
            found = piece.chords
            others = np.delete(squares, n).max(initial=0.0)
            square = np.maximum(found.square / self.cell, others)
            box = boxes.sum() - boxes[n] + found.box / self.cell**2
            length = plan.length + ZIGZAG * found.length
            promise = -np.log(np.maximum(square**2, (box + CELLS**2) / 2))
            promise = (promise - np.log(square**2 + box)) / 2 - RATE * np.log(length)
            least = min(PIECE * self.area, PART * outline.area)
            large = found.least > least
            ok = large & (length < longest)
            # straight along an edge, as those of a cube, they may be short enough
            if plan.cuts == 0 and not ok.any():
                ok = large & (plan.length + found.length < longest)
            trials += [_Trial(n, found, k, float(promise[k])) for k in np.flatnonzero(ok).tolist()]
        trials.sort(key=lambda t: -t.promise)
        return self._apart(trials, self.effort(plan).weighed)

    def _apart(self, trials: list[_Trial], most: int) -> list[_Trial]:
        """The first of the trials that do not say the same, at most so many."""
        kept: list[_Trial] = []
        ends: dict[int, FloatArray] = {}
        for trial in trials:
            here = np.concatenate(trial.chords.ends(trial.k))
            before = ends.get(trial.n, np.zeros((0, 4)))
            d = (before - here).reshape(-1, 2, 2)
            if (np.sqrt((d**2).sum(2)).sum(1) < APART * self.cell).any():
                continue
            ends[trial.n] = np.vstack([before, here])
            kept.append(trial)
            if len(kept) == most:
                break
        return kept


@dataclass(frozen=True, eq=False)
class _Trial:
    """Chord k of piece n of a plan; promise: upper estimate of its worth from boxes."""

    n: int
    chords: Chords
    k: int
    promise: float

    @property
    def length(self) -> float:
        """Length of the chord."""
        return float(self.chords.length[self.k])


@dataclass(frozen=True, eq=False)
class Look:
    """Chords of one plan that are sketched one after another.

    sketches: of the pieces of the plan. piece: number of the piece that each chord cuts; halves: both parts of
    the piece. length: of all boundaries then. below, tries: as for ``least_page``.
    """

    chart_cutter: ChartCutter
    sketches: list[Sketch]
    piece: list[int]
    halves: list[Halves]
    length: list[float]
    below: int
    tries: int


def looked_at(
    look: Look, operations: float, monitor: Monitor
) -> tuple[list[int | None], list[list[Sketch]], float]:
    """(side of the page with each chord, None for chords worth much less than the best so far or beyond the
    budget; sketches of both parts; operations spent)."""
    budget = Budget(operations, lambda: monitor.expired)
    highest, sides, known = -np.inf, [], look.chart_cutter.grid.cache
    known.keep(look.sketches)
    for n, halves, length in zip(look.piece, look.halves, look.length, strict=True):
        if budget.over:
            break
        side = CELLS * float(np.exp(min(-(highest - NEAR + RATE * np.log(length)) / 2, 20.0)))
        below = min(int(np.ceil(side)), look.below)
        rest = look.sketches[:n] + look.sketches[n + 1 :]
        sketches = rest + halves.sketches(look.chart_cutter)
        page = least_page(sketches, below, look.tries, budget, known)
        sides.append(None if page is None else page.side)
        if page is not None:
            highest = max(highest, value_of(page.side, length))
    return sides, [halves.found for halves in look.halves], operations - budget.left


@dataclass(frozen=True, eq=False)
class Making:
    """A cut along edges that is planned.

    task: arguments of ``ChartCutter.cut``; None if ``known`` is the outcome. rest: sketches of the pieces
    that stay. room: length of the seam, and area of faces that it may stretch too much. below, tries: as for
    ``least_page``.
    """

    chart_cutter: ChartCutter
    task: tuple[Ground, Chord] | None
    known: Cut | None
    rest: list[Sketch]
    room: tuple[float, float]
    below: int
    tries: int


def made_cut(
    making: Making, operations: float, monitor: Monitor
) -> tuple[Cut | None, Sides | None, float]:
    """(the cut, None if it is impossible; the page with the cut, None if the page gets no better or there is no
    room; operations spent)."""
    budget = Budget(operations, lambda: monitor.expired)
    chart_cutter, cut = making.chart_cutter, making.known
    if making.task is not None:
        budget.spend(CUTTING * len(making.task[0].faces))
        cut = chart_cutter.cut(*making.task)
    sides = None
    if cut is not None and cut[1] <= making.room[0] and cut[2] <= making.room[1]:
        sketches = making.rest + [p.sketch for p in cut[0]]
        sides = page_sides(sketches, chart_cutter.grid, making.below, making.tries, budget)
    return cut, sides, operations - budget.left


def _after(plan: Plan, trial: _Trial, cut: Cut, sides: Sides) -> Plan:
    """The plan with one cut more."""
    parts, length, stretched = cut
    pieces = [*plan.pieces[: trial.n], *plan.pieces[trial.n + 1 :], *parts]
    return Plan(pieces, plan.length + length, *sides, plan.cuts + 1, plan.stretched + stretched)


def _distinct(plans: list[Plan], most: int) -> list[Plan]:
    """The first of the plans, at most so many, that are not the same cuts in another order."""
    kept: list[Plan] = []
    for plan in plans:
        if len(kept) < most and all(abs(plan.length - k.length) > ALIKE * k.length for k in kept):
            kept.append(plan)
    return kept
