"""Plans of cuts for a fuller page: chords of the charts, weighed on sketches of the page they would leave.

The best chord is taken, then the best one after it, for as long as what follows may pay. What a plan is worth
is log s − RATE log L, with the covered share s and the length L of all boundaries (see ``fuller_page``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import FloatArray, next_half_edge
from circparam.geometry.distortion import best_chart_scales
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing.budget import Budget
from circparam.packing.nest.lock import locked
from circparam.packing.nest.sketch import Easel, least_page
from circparam.packing.options import PackOptions
from circparam.packing.placement import Placement
from circparam.pipeline.chords import Chords
from circparam.pipeline.pieces import Carver, Piece

RATE = 0.4  # the exchange rate: log of the growth of the covered share over that of the seams
CELLS = 32  # squared: cells that all charts cover together on the sketches
LARGE, LEAST = 14, 0.01  # charts that are sketched, those of more than this share of the area
ALL = 12  # charts up to which all are sketched, so that packing may go on from where they lie
TOLD = 0.85  # share of the area that is sketched at least: else what is not decides how full the page gets
# share of the area that a chart must have to be cut, and either part of it
CUT, PIECE = 0.06, 0.012
GOOD = 0.74  # covered share of a sketch from which on nothing is cut
REACHED = 0.76  # covered share of a sketch that no cut is expected to get beyond
# or so much of the side of the page; share of a chart that either part must have
LONG, PART = 0.6, 0.2
ALIKE = 1e-9  # of its length: plans whose seams are as long are the same
SAME = 0.01  # what the pages and values of two plans differ by that are much the same
NEAR = 0.1  # what a chord may be worth less than the best so far, and be kept for that
LOCKED = PackOptions(resolution=512, padding=1)  # page on which outlines are grown until they lock
APART = 3.0  # cells by which chords that are sketched lie apart, both ends together
WORSE = 2  # cells by which a page with one cut more may seem larger: the search is coarse
# work of a search in cells that are transformed, and for each face; what locking a page counts as, and making a
# cut for each face of its chart (150 million are about half a second)
WORK, WORK_OF_FACE, LOCKING, CUTTING = 2.9e8, 6400.0, 2e6, 1000.0
ZIGZAG = 1.08  # length of a path along edges over that of its chord


@dataclass(frozen=True)
class Effort:
    """How much is looked at. tries, more: of each sketch, and of what was made. breadth: plans of as many cuts
    that are gone on with. ahead: cuts that may pay nothing before one that does. weighed: chords that are
    sketched; of those the best ``tried`` are tried along edges until ``made`` of them are made. packed: plans
    that are packed as they will be, beside the one without a cut."""

    tries: int
    more: int
    breadth: int
    ahead: int
    weighed: int
    tried: int
    made: int
    packed: int


# of few pieces and of more than MANY: a sketch takes the longer the more there are, and tells less of each; and
# of surfaces of more faces, where a cut takes longer than its sketches: its parts are relaxed
MANY, COSTLY = 9, 30_000
THOROUGH = Effort(3, 4, 2, 3, 12, 6, 3, 2)
THRIFTY, SPARING = Effort(1, 2, 1, 2, 8, 4, 2, 2), Effort(3, 4, 1, 2, 12, 4, 2, 2)


@dataclass(frozen=True, eq=False)
class Plan:
    """Charts with some cuts.

    pieces: those that are sketched. length: of their boundaries (halved, as seams have two sides). side: in
    cells, of the page that holds their outlines; layout: where they lie there, with offsets of the origin of
    their uv. sketched: side of the one that holds their cells. cuts: how many. stretched: area of faces that
    they stretch too much.
    """

    pieces: list[Piece]
    length: float
    side: float
    layout: Placement
    sketched: int
    cuts: int = 0
    stretched: float = 0.0

    @property
    def value(self) -> float:
        """What is gained by a fuller page less what seams cost."""
        return _value(self.side, self.length)

    @property
    def share(self) -> float:
        """The covered share, about."""
        return CELLS**2 / self.side**2

    def like(self, other: Plan) -> bool:
        """Whether the page of another plan is as full, for as much seam: to pack both would tell little."""
        return bool(
            abs(np.log(self.side / other.side)) < SAME and abs(self.value - other.value) < SAME
        )


@dataclass(frozen=True, eq=False)
class Planner:
    """What all plans for one layout have in common.

    carver: makes the cuts. area: of all charts. longest: length of boundaries that is not exceeded. most: cuts.
    budget: of cells that sketches transform; making a cut counts as well. spared: area of faces that may be
    stretched too much besides.
    """

    carver: Carver
    area: float
    longest: float
    most: int
    budget: Budget
    spared: float = np.inf

    @property
    def cell(self) -> float:
        """Side of a cell of the sketches in uv."""
        return self.carver.easel.cell

    def effort(self, plan: Plan) -> Effort:
        """How much is looked at for what follows a plan."""
        return effort_of(plan.pieces, self.carver)

    def best(self, first: Plan) -> list[Plan]:
        """The plans worth more than ``first``, those of the highest value first."""
        best, kept, effort = first, [first], self.effort(first)
        found: list[Plan] = []
        while kept and kept[0].cuts < min(best.cuts + effort.ahead, self.most):
            made = [after for plan in kept for after in self._following(plan, best.value)]
            made.sort(key=lambda p: -p.value)
            kept = _distinct(made, effort.breadth)
            found += [p for p in kept if p.value > first.value]
            best = max([best, *kept], key=lambda p: p.value)
            kept = [p for p in kept if p.share < GOOD]
        return sorted(found, key=lambda p: -p.value)

    def _following(self, plan: Plan, best: float) -> list[Plan]:
        """Plans with one cut more: of the chords that sketches rank first those that can be made."""
        weighed: list[tuple[float, int, _Trial]] = []
        highest, effort = -np.inf, self.effort(plan)
        for number, trial in enumerate(self._trials(plan, best)):
            if self.budget.over:
                break
            side = self._sketched(plan, trial, highest - NEAR)
            if side is not None:
                value = _value(side, plan.length + ZIGZAG * trial.length)
                weighed.append((-value, number, trial))
                highest = max(highest, value)
        weighed.sort(key=lambda w: w[:2])
        made: list[Plan] = []
        for _, _, trial in weighed[: effort.tried]:
            after = None if self.budget.over else self._made(plan, trial)
            made += [] if after is None else [after]
            if len(made) == effort.made:
                break
        return made

    def _made(self, plan: Plan, trial: _Trial) -> Plan | None:
        """The plan with one cut more, made along edges; None where it cannot be, or the page gets no better."""
        piece = plan.pieces[trial.n]
        if trial.k not in piece.known:
            self.budget.spend(CUTTING * self.carver.size(piece))
        made = self.carver.cut(piece, trial.k)
        if made is None:
            return None
        parts, length, stretched = made
        length, stretched = plan.length + length, plan.stretched + stretched
        if length > self.longest or stretched > self.spared:
            return None
        pieces = [*plan.pieces[: trial.n], *plan.pieces[trial.n + 1 :], *parts]
        sides = page_sides(pieces, self.carver, plan.sketched + WORSE + 1, self.budget)
        if sides is None:
            return None
        return Plan(pieces, length, *sides, plan.cuts + 1, stretched)

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

    def _sketched(self, plan: Plan, trial: _Trial, value: float) -> int | None:
        """Side of the page with one chord more; None where its value is not above ``value``."""
        n = trial.n
        length = plan.length + ZIGZAG * trial.length
        below = CELLS * float(np.exp(min(-(value + RATE * np.log(length)) / 2, 20.0)))
        parts = self.carver.halves(plan.pieces[n], trial.k)
        sketches = [p.sketch for p in (*plan.pieces[:n], *plan.pieces[n + 1 :])] + parts
        below = min(int(np.ceil(below)), plan.sketched + WORSE + 1)
        page = least_page(sketches, below, self.effort(plan).tries, self.budget)
        return None if page is None else page.side


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


def effort_of(pieces: list[Piece], carver: Carver) -> Effort:
    """How much is looked at for a plan of some pieces."""
    if len(pieces) > MANY:
        return THRIFTY
    return SPARING if len(carver.atlas.surface.faces) > COSTLY else THOROUGH


def _distinct(plans: list[Plan], most: int) -> list[Plan]:
    """The first of the plans, at most so many, that are not the same cuts in another order."""
    kept: list[Plan] = []
    for plan in plans:
        if len(kept) < most and all(abs(plan.length - k.length) > ALIKE * k.length for k in kept):
            kept.append(plan)
    return kept


def page_sides(
    pieces: list[Piece], carver: Carver, below: int, budget: Budget
) -> tuple[float, Placement, int] | None:
    """(side in cells of the page of some pieces whose outlines lock, where they lie there, side of the page
    that holds their cells); None where none is below so many."""
    sketches = [p.sketch for p in pieces]
    page = least_page(sketches, below, effort_of(pieces, carver).more, budget)
    if page is None:
        return None
    cell = carver.easel.cell
    budget.spend(LOCKING)
    layout = locked(sketches, page, cell, LOCKED, lambda: budget.late)
    inner = LOCKED.resolution - 2 * LOCKED.border + LOCKED.gap
    return inner / (layout.scale * cell), layout, page.side


def _value(side: float, length: float) -> float:
    return 2 * float(np.log(CELLS / side)) - RATE * float(np.log(length))


def easel_of(cut_mesh: CutMesh, options: PackOptions) -> Easel:
    """The easel on which all charts together cover CELLS squared."""
    root = float(np.sqrt(cut_mesh.chart_areas.sum()))
    return Easel(root / CELLS, options.gap / 2 * CELLS / options.resolution)


def first_plan(carver: Carver, budget: Budget, told: float) -> Plan | None:
    """The plan without a cut; None where no sketch is found, or where sketches would tell of less than the
    share ``told`` of the area."""
    area = carver.cut_mesh.chart_areas
    large = np.argsort(-area, kind="stable")[:LARGE]
    least = 0.0 if len(area) <= ALL else LEAST
    large = large[area[large] > least * area.sum()]
    if area[large].sum() < told * area.sum():
        return None
    pieces = carver.pieces(large)
    widest = max((p.sketch.least for p in pieces), default=0)
    sides = page_sides(pieces, carver, max(2 * CELLS, widest + 2), budget) if pieces else None
    if sides is None:
        return None
    cut_mesh = carver.cut_mesh
    uv = carver.uv * best_chart_scales(cut_mesh, carver.uv)[cut_mesh.vertex_chart][:, None]
    return Plan(pieces, boundary_length(cut_mesh, uv), *sides)


def boundary_length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    """Half the length of the boundaries of all charts in uv: a seam has two sides."""
    h = cut_mesh.boundary
    corner = cut_mesh.faces.ravel()
    d = uv[corner[next_half_edge(h)]] - uv[corner[h]]
    return float(np.sqrt((d**2).sum(1)).sum()) / 2
