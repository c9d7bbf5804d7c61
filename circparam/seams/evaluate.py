"""Whether moves of seams are good: one ladder of questions, from the cheapest to the dearest.

A move glues two charts, or hands faces over from one to the other. All charts that a batch of moves leaves are
laid out in one block system. A chart that fails a question is not asked the next one:

1. One linear solve: which layout comes closest to the Jacobians that the faces had? It must not be flipped.
2. Does its boundary cross itself?
3. Two Newton steps: do they leave a lower bound of the energy that is above the bound?
4. Newton steps to convergence: is the energy below the bound?
5. Do parts of the boundary keep apart, or can they be pushed apart?

Topology comes before all of them (``mesh.cut_mesh.not_disks``), since the caller has to leave such moves out.
"""

from dataclasses import fields, replace

import numpy as np

from circparam.core.arrays import (
    cross2,
    first_of_groups,
    group_sum,
    mask_of,
    next_half_edge,
    numbered,
)
from circparam.core.graph import components
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.core.workers import in_parts, in_processes
from circparam.geometry.overlap import crossings, overlaps, self_overlapping
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.accuracy import AIMED, TRIAL
from circparam.seams.hard.unroll import transported
from circparam.solvers import dirichlet
from circparam.solvers.newton import relax
from circparam.solvers.objective import chart_energies
from circparam.solvers.poisson import Poisson
from circparam.solvers.separate import push_apart

MARGIN = 0.004  # share of the root of its area that parts of one chart keep apart
# pairs of boundary edges that may cross before any Newton step: of some 400 unions of six meshes with more all
# overlapped when they had converged
SHALLOW = 2
FIRST_STEPS = 2  # of Newton, which leave a lower bound of the energy


@dataclass(frozen=True)
class Demands:
    """bound: no chart's energy exceeds it. margin: parts of one chart keep this share of the root of its area
    apart."""

    bound: float
    margin: float = MARGIN


@dataclass(frozen=True, eq=False)
class Moves:
    """What charts would be, put together from parts of charts that have layouts.

    corners: (m, 3, 2) the layout each face has, parts turned. part: (m,) part that joins its chart, −1 on the
    largest part of each, which stays. targets: (2, 2, m) Jacobians that the faces should have. most: (n,)
    energy from which on a chart is not wanted, whatever the bound.
    """

    cut_mesh: CutMesh
    corners: FloatArray
    part: IntArray
    targets: FloatArray
    most: FloatArray

    @staticmethod
    def joining(cut_mesh: CutMesh, corners: FloatArray, before: IntArray) -> "Moves":
        """Parts are turned so that their side of the glued arcs lies on the other. before: (m,) chart each face
        was in."""
        stays = main_parts(cut_mesh.chart, before, cut_mesh.areas)
        f, g = cut_mesh.edges.T // 3
        same = (before[f] == before[g]) & ~stays[f]
        _, part = components(len(stays), f[same], g[same])
        part[stays] = -1
        part = numbered(part + 1)[1] - 1
        cosine, sine = _turns(cut_mesh, corners, part).T[:, part]
        x, y = corners.transpose(2, 1, 0)
        turned = np.stack([cosine * x - sine * y, sine * x + cosine * y]).transpose(2, 1, 0)
        corners = np.where((part >= 0)[:, None, None], turned, corners)
        no_limit = np.full(cut_mesh.n_charts, np.inf)
        return Moves(cut_mesh, corners, part, jacobians(cut_mesh, corners), no_limit)

    @property
    def moving(self) -> BoolArray:
        """(m,) bool: faces of parts that join."""
        return self.part >= 0

    def subset(self, which: BoolArray) -> tuple["Moves", IntArray]:
        """(some moves ((n,) bool), their vertices)."""
        sub, vid, fid = self.cut_mesh.subset(which)
        part = Moves(
            sub, self.corners[fid], self.part[fid], self.targets[..., fid], self.most[which]
        )
        return part, vid


@dataclass(frozen=True, eq=False)
class Trial:
    """Moves laid out: uv (nv, 2), and of each (n,) its energy, a lower bound of it, and whether it overlaps."""

    uv: FloatArray
    energy: FloatArray
    floor: FloatArray
    overlapping: BoolArray

    @staticmethod
    def unknown(cut_mesh: CutMesh) -> "Trial":
        """Of moves that nothing is known of."""
        n = cut_mesh.n_charts
        uv = np.zeros((cut_mesh.n_vertices, 2))
        return Trial(uv, np.full(n, np.inf), np.ones(n), np.zeros(n, bool))

    def put(self, some: BoolArray, vertices: IntArray, part: "Trial") -> None:
        """Take over what is known of some moves ((n,) bool) with those vertices."""
        self.uv[vertices] = part.uv
        for field in fields(self)[1:]:
            getattr(self, field.name)[some] = getattr(part, field.name)

    def good(self, most: FloatArray) -> BoolArray:
        """(n,) bool: not above those energies, without flips or overlaps."""
        return (self.energy <= most) & ~self.overlapping


def try_moves(moves: Moves, demands: Demands, monitor: Monitor) -> Trial:
    """Lay the charts of a batch of moves out, as far as they are good; many faces by all processes."""
    shares = in_parts(moves.cut_mesh.chart)
    if len(shares) == 1:
        return _tried(moves, demands, monitor)
    chart, n = moves.cut_mesh.chart, moves.cut_mesh.n_charts
    groups = [mask_of(n, chart[faces]) for faces in shares]
    parts = [moves.subset(group) for group in groups]
    tasks = [(part, demands) for part, _ in parts]
    done = in_processes(_tried, tasks, monitor)
    trial = Trial.unknown(moves.cut_mesh)
    for group, (_, vid), of_part in zip(groups, parts, done, strict=True):
        trial.put(group, vid, of_part)
    return trial


def _tried(moves: Moves, demands: Demands, monitor: Monitor) -> Trial:
    """The ladder for moves that are worked on together."""
    trial = _started(moves, demands.bound)
    _drop_crossed(moves, trial)
    live = np.isfinite(trial.energy) & ~trial.overlapping
    if live.any():
        _relax(moves, trial, live, demands)
    _keep_apart(moves, trial, demands, monitor)
    return trial


def _started(moves: Moves, bound: float) -> Trial:
    """The layout with the Jacobians that are wanted; where that is above the bound, smaller parts bend
    round the largest one, if that comes closer. The energy is infinite where faces are flipped."""
    cut_mesh = moves.cut_mesh
    system, trial = Poisson(cut_mesh), Trial.unknown(cut_mesh)
    trial.uv[:] = system.layout(moves.targets)
    trial.energy[:] = chart_energies(cut_mesh, trial.uv)
    poor = ~(trial.energy <= bound)
    if not poor.any():
        return trial
    wanted = transported(cut_mesh, moves.targets, moves.moving & poor[cut_mesh.chart])
    uv = system.layout(wanted)
    energy = chart_energies(cut_mesh, uv)
    better = poor & (energy < trial.energy)
    trial.uv[:] = np.where(better[cut_mesh.vertex_chart][:, None], uv, trial.uv)
    trial.energy[better] = energy[better]
    return trial


def _drop_crossed(moves: Moves, trial: Trial) -> None:
    """Charts whose boundary crosses itself more than a few times overlap."""
    sound = np.isfinite(trial.energy)
    if not sound.any():
        return
    sub, vid, _ = moves.cut_mesh.subset(sound)
    pairs = crossings(trial.uv[vid], sub)
    crossed = np.bincount(sub.chart[pairs[:, 0] // 3], minlength=sub.n_charts)
    trial.overlapping[sound] = crossed > SHALLOW


def _relax(moves: Moves, trial: Trial, live: BoolArray, demands: Demands) -> None:
    """Relax some charts ((n,) bool). After two steps those are left whose energy cannot come as low as wanted,
    or that overlap: of 160 unions of two meshes that did, 158 overlapped when they had converged."""
    cut_mesh = moves.cut_mesh
    enough = 1 + AIMED * (demands.bound - 1)
    steps = replace(TRIAL, bound=enough, give_up=demands.bound)
    sub, vid, _ = cut_mesh.subset(live)
    first = relax(sub, trial.uv[vid], replace(steps, max_iterations=FIRST_STEPS))
    trial.uv[vid], trial.energy[live], trial.floor[live] = first.uv, first.energy, first.floor
    trial.energy[np.flatnonzero(live)[np.array(first.stopped) == "gave up"]] = np.inf
    trial.energy[live & (trial.floor > moves.most)] = np.inf
    # what is as good as it needs to be is looked at once, when its margins are
    live = live & np.isfinite(trial.energy) & (trial.energy > enough)
    if live.any():
        sub, vid, _ = cut_mesh.subset(live)
        trial.overlapping[live] = self_overlapping(sub, trial.uv[vid])
        live &= ~trial.overlapping
    if live.any():
        sub, vid, _ = cut_mesh.subset(live)
        rest = relax(sub, trial.uv[vid], steps)
        trial.uv[vid], trial.energy[live] = rest.uv, rest.energy
        trial.floor[live] = np.maximum(trial.floor[live], rest.floor)


def _keep_apart(moves: Moves, trial: Trial, demands: Demands, monitor: Monitor) -> None:
    """Push parts of good charts apart that cross or come too near each other; where that fails, they overlap.

    Without pushing those that cross, 12 drafts and searches cost 1.02 to 1.035 times as much.
    """
    cut_mesh = moves.cut_mesh
    good = trial.good(np.minimum(moves.most, demands.bound))
    if not good.any():
        return
    sub, vid, _ = cut_mesh.subset(good)
    contacts = overlaps(sub, trial.uv[vid])
    over = contacts.self_overlapping.copy()
    if demands.margin > 0:
        over |= contacts.near(demands.margin, ~over, chamfers=True) > 0
    number = np.flatnonzero(good)[over]
    trial.overlapping[number] = True
    if not len(number):
        return
    sub, vid, _ = cut_mesh.subset(trial.overlapping & good)
    pushed, fine = push_apart(
        sub, trial.uv[vid], demands.margin, demands.bound, monitor, chamfers=True
    )
    kept = fine[sub.vertex_chart]
    trial.uv[vid[kept]] = pushed[kept]
    trial.overlapping[number[fine]] = False


def jacobians(cut_mesh: CutMesh, corners: FloatArray) -> FloatArray:
    """(2, 2, m) Jacobians of faces with those corners (m, 3, 2)."""
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    return dirichlet.jacobians(gradients, corners.transpose(2, 1, 0))


def _turns(cut_mesh: CutMesh, corners: FloatArray, part: IntArray) -> FloatArray:
    """(parts + 1, 2) cosine and sine of the turn that lays each part's side of its glued arcs onto the other.

    The last row, of −1, turns nothing.
    """
    i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
    glued = (part[i // 3] >= 0) != (part[j // 3] >= 0)
    i, j = i[glued], j[glued]
    swap = part[i // 3] >= 0
    p, q = np.where(swap, j, i), np.where(swap, i, j)
    flat = corners.reshape(-1, 2)
    ep = flat[next_half_edge(p)] - flat[p]
    eq = flat[q] - flat[next_half_edge(q)]
    of, n = part[q // 3], int(part.max(initial=-1)) + 2
    cosine, sine = group_sum((ep * eq).sum(1), of, n), group_sum(cross2(eq, ep), of, n)
    length = np.hypot(cosine, sine)
    ok = length > 0
    safe = np.where(ok, length, 1.0)
    return np.stack([np.where(ok, cosine / safe, 1.0), np.where(ok, sine / safe, 0.0)], 1)


def main_parts(chart: IntArray, before: IntArray, areas: FloatArray) -> BoolArray:
    """(m,) bool: the face was in that earlier chart from which its chart has most of its area."""
    width = int(before.max()) + 1
    pairs, inverse = numbered(chart * width + before)
    area = group_sum(areas, inverse, len(pairs))
    return mask_of(len(pairs), first_of_groups(pairs // width, -area))[inverse]
