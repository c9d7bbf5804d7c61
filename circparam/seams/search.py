"""One local search for all moves of seams.

A family of moves proposes candidates: seams that would go and come, the one or two charts they change, and how
much less the seams would cost. A round has four steps, all of them array operations:

1. Choose a batch of independent moves: a greedy matching, in which no chart is changed by two moves.
2. Lay all charts of the batch out in one block system (``seams.evaluate``), from cheap questions to dear ones.
3. Make the moves whose charts are good and that lower the cost: ΔC = 26 ΔD + 100 ΔT − gain < 0.
4. Tell the family, which forgets what failed until one of the charts changes.

The search ends when the family proposes nothing, or when its trials have had as many faces as it may spend.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from circparam.core.arrays import group_sum, mask_of, numbered
from circparam.core.graph import components, matching
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.seams.cost import COST
from circparam.seams.evaluate import Demands, Moves, jacobians, try_moves
from circparam.solvers import dirichlet
from circparam.solvers.pattern import eliminate_as, elimination_ranks

MERGING_SHARE = 0.5  # of the search for charts that merging is
WORK_PER_FACE = 16.0  # faces of all trials, in faces of the surface, where nothing else ends them


@dataclass(frozen=True, eq=False)
class Candidates(ABC):
    """Moves that a family proposes for an atlas.

    left, right: (k,) charts that each changes, the same where it changes one. score: (k,) the highest are tried
    first, those of −∞ never. gain: (k,) how much less the seams and the charts cost.
    """

    left: IntArray
    right: IntArray
    score: FloatArray
    gain: FloatArray

    @abstractmethod
    def seams(self, chosen: IntArray) -> BoolArray:
        """(e,) seams of the atlas after some of the moves (their numbers), no chart in two of them."""


Some = TypeVar("Some", bound=Candidates)


class Family(Protocol[Some]):
    """A kind of move, and what it remembers of an atlas."""

    def propose(self, atlas: Atlas) -> Some:
        """Its moves, with their scores."""
        ...

    def learn(self, tried: Some, outcome: "Outcome") -> None:
        """What came of a batch."""
        ...


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of a batch of moves.

    chosen: (k,) numbers of the candidates. made: (k,) bool. cut_mesh, uv: layout of the charts that the moves
    leave. faces: (f,) of the surface that they hold.
    """

    chosen: IntArray
    made: BoolArray
    cut_mesh: CutMesh
    uv: FloatArray
    faces: IntArray

    def stretch(self, m: int) -> FloatArray:
        """(m,) stretch of each face of the surface in the layout, 1 where nothing was laid out."""
        out = np.ones(m)
        out[self.faces] = face_stretch(self.cut_mesh, self.uv)
        return out


@dataclass(frozen=True)
class Effort:
    """How long a search goes on.

    work: faces of all trials together. rounds: at most so many. ordered: systems take the order of elimination
    of the surface, so that none looks for its own.
    """

    work: float = np.inf
    rounds: float = np.inf
    ordered: bool = True


def search(
    atlas: Atlas,
    family: Family[Some],
    demands: Demands,
    effort: Effort,
    monitor: Monitor,
) -> float:
    """Make moves of a family until none is left to try or the work is spent; returns what is left of it."""
    monitor.keep(atlas)
    work, turn = effort.work, 0
    while turn < effort.rounds and work >= 0 and not monitor.expired:
        candidates = family.propose(atlas)
        left, right, score = candidates.left, candidates.right, candidates.score
        number = np.flatnonzero(score > -np.inf)
        if len(number) == 0:
            break
        n, _ = atlas.charts()
        chosen = number[matching(score[number], left[number], right[number], n)]
        outcome = _tried(atlas, candidates, chosen, demands, effort, monitor)
        atlas.cut = candidates.seams(chosen[outcome.made])
        family.learn(candidates, outcome)
        monitor.keep(atlas)
        work, turn = work - len(outcome.faces), turn + 1
        monitor.update(MERGING_SHARE * turn / (turn + 8))
    return work


@dataclass(frozen=True, eq=False)
class _Batch:
    """What charts some moves leave. faces: (f,) of the surface. move: (charts,) that leaves each chart.

    part: (f,) of each face. No seam, old or new, runs inside a part, so its layout stays as it is. glued:
    (charts,) bool, parts of the chart are glued; others have only lost faces, and stay laid out.
    """

    cut_mesh: CutMesh
    faces: IntArray
    move: IntArray
    part: IntArray
    glued: BoolArray

    def subset(self, which: BoolArray) -> "_Batch":
        """Some of the charts ((charts,) bool)."""
        if which.all():
            return self
        cut_mesh, _, faces = self.cut_mesh.subset(which)
        move, part = self.move[which], self.part[faces]
        return _Batch(cut_mesh, self.faces[faces], move, part, self.glued[which])

    def energies(self, atlas: Atlas) -> FloatArray:
        """(charts,) mean energy of each chart, laid out as its faces are in the atlas."""
        energy = dirichlet.energy(jacobians(self.cut_mesh, atlas.corners[self.faces]))
        return self.of_charts(energy) / self.cut_mesh.chart_areas + self.cut_mesh.chart_roughness

    def of_charts(self, value: FloatArray) -> FloatArray:
        """(charts,) integral of a value of faces over each chart."""
        cut_mesh = self.cut_mesh
        return group_sum(value * cut_mesh.areas, cut_mesh.chart, cut_mesh.n_charts)

    def of_moves(self, value: FloatArray | BoolArray, n: int) -> FloatArray:
        """(n,) sum of a value of charts for each move."""
        return group_sum(value.astype(np.float64), self.move, n)


def _tried(
    atlas: Atlas,
    candidates: Candidates,
    chosen: IntArray,
    demands: Demands,
    effort: Effort,
    monitor: Monitor,
) -> Outcome:
    """Lay out what the chosen moves leave, and keep the layouts of those that are good."""
    n = len(chosen)
    batch = _batch(atlas, candidates, chosen, np.ones(n, bool))
    before = 1 + (candidates.left[chosen] != candidates.right[chosen])
    sound = np.bincount(batch.move, minlength=n) <= before
    sound &= batch.of_moves(not_disks(batch.cut_mesh), n) == 0
    if not sound.all():
        batch = _batch(atlas, candidates, chosen, sound)
    rest, batch = batch.subset(~batch.glued), batch.subset(batch.glued)
    # faces that left may have held the mean below the bound
    sound &= rest.of_moves(rest.energies(atlas) > demands.bound, n) == 0
    cut_mesh, faces = batch.cut_mesh, batch.faces
    if not len(faces):
        return Outcome(chosen, sound, cut_mesh, np.zeros((0, 2)), faces)
    if effort.ordered:
        vertices = atlas.surface.corner_vertex[faces]
        eliminate_as(cut_mesh, elimination_ranks(atlas.surface), vertices)
    moves = Moves.joining(cut_mesh, atlas.corners[faces], batch.part)
    # costs times the area of the surface
    gain = candidates.gain[chosen] * atlas.surface.unit**2
    loss = batch.of_charts(COST.loss(moves.targets))
    moves = replace(
        moves, most=1 + (loss + gain[batch.move]) / COST.distortion / cut_mesh.chart_areas
    )
    trial = try_moves(moves, demands, monitor)
    good = trial.good(np.minimum(moves.most, demands.bound))
    with np.errstate(invalid="ignore"):
        added = batch.of_charts(COST.loss(jacobians(cut_mesh, trial.uv[cut_mesh.faces]))) - loss
        made = sound & (batch.of_moves(~good, n) == 0) & (batch.of_moves(added, n) < gain)
    kept = made[batch.move][cut_mesh.chart]
    atlas.corners[faces[kept]] = trial.uv[cut_mesh.faces[kept]]
    return Outcome(chosen, made, cut_mesh, trial.uv, faces)


def _batch(atlas: Atlas, candidates: Candidates, chosen: IntArray, sound: BoolArray) -> _Batch:
    """The charts that sound moves ((chosen,) bool) leave."""
    n, chart = atlas.charts()
    number = np.flatnonzero(sound)
    move = np.full(n, -1)
    for side in (candidates.left, candidates.right):
        move[side[chosen[number]]] = np.arange(len(number))
    label = move[chart]
    cut = candidates.seams(chosen[number])
    cut_mesh, faces = atlas.surface.part_cut_mesh(cut, label >= 0, label)
    whole = atlas.surface.inner_edges(label >= 0)[~cut]  # the edges of the cut mesh
    was_cut = atlas.cut[~cut][whole]
    _, part = components(len(faces), *(cut_mesh.edges[~was_cut].T // 3))
    count, new = components(len(faces), *(cut_mesh.edges.T // 3))
    if count > len(number):
        key = cut_mesh.chart * count + new
        charts, new = numbered(key)
        cut_mesh, number = replace(cut_mesh, chart=new), number[charts // count]
    glued = mask_of(cut_mesh.n_charts, cut_mesh.chart[cut_mesh.edges[was_cut, 0] // 3])
    return _Batch(cut_mesh, faces, number, part, glued)
