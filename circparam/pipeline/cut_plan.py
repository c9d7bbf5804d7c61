"""Plans of cuts for a fuller page: chords of the charts, weighed on sketches of the page they would leave.

The best chord is taken, then the best one after it, for as long as what follows may pay. What a plan is worth
is log s − RATE log L, with the covered share s and the length L of all boundaries (see ``fuller_page``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from circparam.core.arrays import FloatArray, next_half_edge
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing.nest.sketch import Easel, Sketch, least_side
from circparam.packing.options import PackOptions
from circparam.pipeline.chords import Chords, Outline, chords, outlines, split

RATE = 1.0  # the exchange rate: log of the growth of the covered share over that of the seams
CELLS = 32  # squared: cells that all charts cover together on the sketches
STEP = 0.6  # cells between the corners of an outline
REACH = 16  # of these cells: what is longer is a sliver, for which no page is sketched
LARGE, LEAST = 12, 0.005  # charts that are sketched, those of more than this share of the area
CUT, PIECE = (
    0.06,
    0.012,
)  # share of the area that a chart must have to be cut, and either part of it
GOOD = 0.64  # covered share of a sketch, from which on nothing is cut: packing makes 0.7 of it
REACHED = 0.7  # covered share of a sketch that no cut is expected to get beyond
LONG, PART = (
    0.6,
    0.2,
)  # or so much of the side of the page; share of a chart that either part must have
WEIGHED, AGAIN = (
    14,
    2,
)  # chords that are sketched, and of those the ones that are sketched with more effort
TRIES, MORE = 3, 10  # of each sketch, and of those
APART = 3.0  # cells by which chords that are sketched lie apart, both ends together
AHEAD = 2  # cuts that may pay nothing before one that does
WORSE = 2  # cells by which a page with one cut more may seem larger: the search is coarse
ZIGZAG = 1.08  # length of a path along edges over that of its chord


@dataclass(frozen=True)
class Cut:
    """A chord of a chart of the layout given, from vertex ``start`` to vertex ``end`` of its cut mesh.

    least: area of the smaller part that it leaves.
    """

    chart: int
    start: int
    end: int
    least: float


@dataclass(frozen=True, eq=False)
class Plan:
    """Charts with some cuts: their outlines and sketches, the length of their boundaries (halved, as seams
    have two sides) and the side in cells of the page that holds them."""

    outlines: list[Outline]
    sketches: list[Sketch]
    length: float
    side: int
    cuts: tuple[Cut, ...] = ()

    @property
    def value(self) -> float:
        """What is gained by a fuller page less what seams cost."""
        return -2 * float(np.log(self.side)) - RATE * float(np.log(self.length))

    @property
    def share(self) -> float:
        """The covered share, about."""
        return CELLS**2 / self.side**2


@dataclass(frozen=True, eq=False)
class Planner:
    """What all plans for one layout have in common.

    easel: of the sketches. area: of all charts. longest: length of boundaries that is not exceeded. most: cuts.
    stop: whether there is no more time.
    """

    easel: Easel
    area: float
    longest: float
    most: int
    stop: Callable[[], bool]

    def best(self, first: Plan) -> Plan:
        """The plan of the highest value, cut by cut; ``first`` where no cut is worth its seam."""
        best = plan = first
        while len(plan.cuts) < min(len(best.cuts) + AHEAD, self.most) and plan.share < GOOD:
            after = self._next(plan, best.value)
            if after is None:
                break
            plan = after
            best = plan if plan.value > best.value else best
        return best

    def _next(self, plan: Plan, best: float) -> Plan | None:
        """The plan with the chord more that is worth most; None where none can lead to more than ``best``."""
        trials = self._trials(plan, best)
        value = -np.inf
        found: Plan | None = None
        weighed = []
        for trial in trials:
            if self.stop():
                break
            after = self._sketched(plan, trial, value, TRIES)
            if after is not None:
                weighed.append((after, trial))
                value, found = after.value, after
        for _, trial in weighed[::-1][:AGAIN]:
            after = self._sketched(plan, trial, value, MORE)
            if after is not None:
                value, found = after.value, after
        return found

    def _trials(self, plan: Plan, best: float) -> list[_Trial]:
        """Chords worth a sketch, the most promising first."""
        longest = min(self.longest, float(np.exp((np.log(REACHED / CELLS**2) - best) / RATE)))
        boxes = np.array([float(s.masks.size.prod(1).min()) for s in plan.sketches])
        squares = np.array([float(s.least) for s in plan.sketches])
        trials = []
        for n, outline in enumerate(plan.outlines):
            if outline.area < CUT * self.area and squares[n] < LONG * plan.side:
                continue
            found = chords(outline)
            others = np.delete(squares, n).max(initial=0.0)
            square = np.maximum(found.square / self.easel.cell, others)
            box = boxes.sum() - boxes[n] + found.box / self.easel.cell**2
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
            if (np.sqrt((d**2).sum(2)).sum(1) < APART * self.easel.cell).any():
                continue
            ends[trial.n] = np.vstack([before, here])
            kept.append(trial)
            if len(kept) == WEIGHED:
                break
        return kept

    def _sketched(self, plan: Plan, trial: _Trial, value: float, tries: int) -> Plan | None:
        """The plan with one chord more, sketched; None where its value is not above ``value``."""
        n, o = trial.n, trial.chords.outline
        length = plan.length + ZIGZAG * float(trial.chords.length[trial.k])
        below = float(np.exp(min(-(value + RATE * np.log(length)) / 2, 20.0)))
        if not trial.parts:
            i, j = int(trial.chords.i[trial.k]), int(trial.chords.j[trial.k])
            trial.parts.extend((part, self.easel.sketch(*part.edges)) for part in split(o, i, j))
        sketches = [*plan.sketches[:n], *plan.sketches[n + 1 :], *(s for _, s in trial.parts)]
        side = least_side(
            sketches, min(int(np.ceil(below)), plan.side + WORSE + 1), tries, self.stop
        )
        if side is None:
            return None
        left = [*plan.outlines[:n], *plan.outlines[n + 1 :], *(part for part, _ in trial.parts)]
        start, end = (int(o.vertex[c[trial.k]]) for c in (trial.chords.i, trial.chords.j))
        cut = Cut(o.chart, start, end, float(trial.chords.least[trial.k]))
        return Plan(left, sketches, length, side, (*plan.cuts, cut))


@dataclass(frozen=True, eq=False)
class _Trial:
    """Chord k of outline n of a plan; promise: what it may be worth, told from boxes. parts: once sketched."""

    n: int
    chords: Chords
    k: int
    promise: float
    parts: list[tuple[Outline, Sketch]] = field(default_factory=list)


def sketch_of(
    cut_mesh: CutMesh, uv: FloatArray, options: PackOptions, stop: Callable[[], bool]
) -> tuple[Plan, Easel] | None:
    """The plan without a cut, and its easel: uv (nv, 2) at one scale. None where no sketch is found."""
    area = cut_mesh.chart_areas
    total = float(area.sum())
    large = np.argsort(-area, kind="stable")[:LARGE]
    large = large[area[large] > LEAST * total]
    easel = Easel(float(np.sqrt(total)) / CELLS, options.gap / 2 * CELLS / options.resolution)
    shown = outlines(cut_mesh, uv, large, STEP * easel.cell)
    longest = max((float(np.ptp(o.edges[0], axis=0).max()) for o in shown), default=0.0)
    if longest > REACH * CELLS * easel.cell:
        return None
    sketches = [easel.sketch(*outline.edges) for outline in shown]
    widest = max((s.least for s in sketches), default=0)
    side = least_side(sketches, max(2 * CELLS, widest + 2), MORE, stop) if shown else None
    if side is None:
        return None
    return Plan(shown, sketches, boundary_length(cut_mesh, uv), side), easel


def boundary_length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    """Half the length of the boundaries of all charts in uv: a seam has two sides."""
    h = cut_mesh.boundary
    corner = cut_mesh.faces.ravel()
    d = uv[corner[next_half_edge(h)]] - uv[corner[h]]
    return float(np.sqrt((d**2).sum(1)).sum()) / 2
