"""Plans of cuts for a fuller page: chords of the charts, weighed on sketches of the page they would leave.

The best chord is taken, then the best one after it, for as long as what follows may pay. What a plan is worth
is log s − RATE log L, with the covered share s and the length L of all boundaries (see ``fuller_page``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import FloatArray, next_half_edge
from circparam.geometry.distortion import best_chart_scales
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing.nest.sketch import Easel, least_side
from circparam.packing.options import PackOptions
from circparam.pipeline.chords import Chords, split
from circparam.pipeline.pieces import Carver, Piece

RATE = 0.5  # the exchange rate: log of the growth of the covered share over that of the seams
CELLS = 32  # squared: cells that all charts cover together on the sketches
LARGE, LEAST = 20, 0.005  # charts that are sketched, those of more than this share of the area
# share of the area that a chart must have to be cut, and either part of it
CUT, PIECE = 0.06, 0.012
GOOD = 0.7  # covered share of a sketch, from which on nothing is cut: packing makes 0.7 of it
REACHED = 0.76  # covered share of a sketch that no cut is expected to get beyond
# or so much of the side of the page; share of a chart that either part must have
LONG, PART = 0.6, 0.2
WEIGHED = 14  # chords that are sketched
MADE = 8  # of those, the best that are tried along edges until one can be made
COMPARED = 3  # where none is worth it by itself the best of so many is taken
NEAR = 0.06  # what a chord may be worth less than the best so far, and be kept for that
TRIES, MORE = 5, 10  # of each sketch, and of what was made
APART = 3.0  # cells by which chords that are sketched lie apart, both ends together
AHEAD = 3  # cuts that may pay nothing before one that does
WORSE = 2  # cells by which a page with one cut more may seem larger: the search is coarse
ZIGZAG = 1.08  # length of a path along edges over that of its chord


@dataclass(frozen=True, eq=False)
class Plan:
    """Charts with some cuts: the pieces that are sketched, the length of their boundaries (halved, as seams
    have two sides) and the side in cells of the page that holds them. cuts: how many were made."""

    pieces: list[Piece]
    length: float
    side: int
    cuts: int = 0

    @property
    def value(self) -> float:
        """What is gained by a fuller page less what seams cost."""
        return _value(self.side, self.length)

    @property
    def share(self) -> float:
        """The covered share, about."""
        return CELLS**2 / self.side**2


@dataclass(frozen=True, eq=False)
class Planner:
    """What all plans for one layout have in common.

    carver: makes the cuts. area: of all charts. longest: length of boundaries that is not exceeded. most: cuts.
    stop: whether there is no more time.
    """

    carver: Carver
    area: float
    longest: float
    most: int
    stop: Callable[[], bool]

    @property
    def cell(self) -> float:
        """Side of a cell of the sketches in uv."""
        return self.carver.easel.cell

    def best(self, first: Plan, count: int = 1) -> list[Plan]:
        """The plans of the highest value, cut by cut, at most so many; all worth more than ``first``."""
        best = plan = first
        found: list[Plan] = []
        while plan.cuts < min(best.cuts + AHEAD, self.most) and plan.share < GOOD:
            after = self._next(plan, best.value)
            if after is None:
                break
            plan = after
            best = plan if plan.value > best.value else best
            found += [plan] if plan.value > first.value else []
        return sorted(found, key=lambda p: -p.value)[:count]

    def _next(self, plan: Plan, best: float) -> Plan | None:
        """The plan with the cut more that is worth most; None where none can lead to more than ``best``."""
        weighed: list[tuple[float, _Trial]] = []
        highest = -np.inf
        for trial in self._trials(plan, best):
            if self.stop():
                break
            side = self._sketched(plan, trial, highest - NEAR, TRIES)
            if side is not None:
                value = _value(side, plan.length + ZIGZAG * trial.length)
                weighed.append((value, trial))
                highest = max(highest, value)
        weighed.sort(key=lambda w: -w[0])
        made: list[Plan] = []
        for _, trial in weighed[:MADE]:
            after = None if self.stop() else self._made(plan, trial)
            made += [] if after is None else [after]
            if after is not None and (after.value > plan.value or len(made) == COMPARED):
                break
        return max(made, key=lambda p: p.value, default=None)

    def _made(self, plan: Plan, trial: _Trial) -> Plan | None:
        """The plan with one cut more, made along edges; None where it cannot be, or the page gets no better."""
        made = self.carver.cut(plan.pieces[trial.n], trial.k)
        if made is None or plan.length + made[1] > self.longest:
            return None
        pieces = [*plan.pieces[: trial.n], *plan.pieces[trial.n + 1 :], *made[0]]
        sketches = [p.sketch for p in pieces]
        side = least_side(sketches, plan.side + WORSE + 1, MORE, self.stop)
        if side is None:
            return None
        return Plan(pieces, plan.length + made[1], side, plan.cuts + 1)

    def _trials(self, plan: Plan, best: float) -> list[_Trial]:
        """Chords worth a sketch, the most promising first."""
        longest = min(self.longest, float(np.exp((np.log(REACHED / CELLS**2) - best) / RATE)))
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
            ok = (found.least > least) & (length < longest)
            trials += [_Trial(n, found, k, float(promise[k])) for k in np.flatnonzero(ok).tolist()]
        trials.sort(key=lambda t: -t.promise)
        return self._apart(trials)

    def _apart(self, trials: list[_Trial]) -> list[_Trial]:
        """The first of the trials that do not say the same."""
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
            if len(kept) == WEIGHED:
                break
        return kept

    def _sketched(self, plan: Plan, trial: _Trial, value: float, tries: int) -> int | None:
        """Side of the page with one chord more; None where its value is not above ``value``."""
        n, o = trial.n, trial.chords.outline
        length = plan.length + ZIGZAG * trial.length
        below = float(np.exp(min(-(value + RATE * np.log(length)) / 2, 20.0)))
        i, j = int(trial.chords.i[trial.k]), int(trial.chords.j[trial.k])
        parts = [self.carver.easel.sketch(*part.edges) for part in split(o, i, j)]
        sketches = [p.sketch for p in (*plan.pieces[:n], *plan.pieces[n + 1 :])] + parts
        below = min(int(np.ceil(below)), plan.side + WORSE + 1)
        return least_side(sketches, below, tries, self.stop)


@dataclass(frozen=True, eq=False)
class _Trial:
    """Chord k of piece n of a plan; promise: what it may be worth, told from boxes."""

    n: int
    chords: Chords
    k: int
    promise: float

    @property
    def length(self) -> float:
        """Of the chord."""
        return float(self.chords.length[self.k])


def _value(side: int, length: float) -> float:
    return -2 * float(np.log(side)) - RATE * float(np.log(length))


def easel_of(cut_mesh: CutMesh, options: PackOptions) -> Easel:
    """The easel on which all charts together cover CELLS squared."""
    root = float(np.sqrt(cut_mesh.chart_areas.sum()))
    return Easel(root / CELLS, options.gap / 2 * CELLS / options.resolution)


def first_plan(carver: Carver, stop: Callable[[], bool]) -> Plan | None:
    """The plan without a cut; None where no sketch is found."""
    area = carver.cut_mesh.chart_areas
    large = np.argsort(-area, kind="stable")[:LARGE]
    pieces = carver.pieces(large[area[large] > LEAST * area.sum()])
    sketches = [p.sketch for p in pieces]
    widest = max((s.least for s in sketches), default=0)
    side = least_side(sketches, max(2 * CELLS, widest + 2), MORE, stop) if pieces else None
    if side is None:
        return None
    cut_mesh = carver.cut_mesh
    uv = carver.uv * best_chart_scales(cut_mesh, carver.uv)[cut_mesh.vertex_chart][:, None]
    return Plan(pieces, boundary_length(cut_mesh, uv), side)


def boundary_length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    """Half the length of the boundaries of all charts in uv: a seam has two sides."""
    h = cut_mesh.boundary
    corner = cut_mesh.faces.ravel()
    d = uv[corner[next_half_edge(h)]] - uv[corner[h]]
    return float(np.sqrt((d**2).sum(1)).sum()) / 2
