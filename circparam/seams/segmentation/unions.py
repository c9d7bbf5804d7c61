"""Unions of two charts laid out together: all of a round in one block system."""

import dataclasses

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2, group_sum, next_half_edge
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.geometry.overlap import SelfContacts, crossings, self_overlapping
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.hard.fit import better_start, composed, hardly_near
from circparam.seams.options import USUAL, Search
from circparam.seams.segmentation.state import CONE
from circparam.solvers import dirichlet
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.poisson import Poisson, from_jacobians
from circparam.solvers.separate import push_apart

MANY = 300  # of more trials at once those that cross before any relaxation are left out, and none is pushed
SHALLOW = 2  # pairs of boundary edges that may cross before a union is relaxed
# of the excess of the bound: unions of hard surfaces and charts of drafts are not relaxed further at once
ENOUGH = 0.8
# times the excess of the bound: by how much (Frobenius, squared) the Jacobians of a start with flipped faces
# may be off in the mean. Of 190 unions of seven meshes with more one was good.
HOPELESS = 3.0
# faces that the first linear solve of a union flips, and share of them, from which it is not untangled: of 488
# unions with flips of eight meshes the 34 that came to anything had 11 at most, 250 others more than 16
MANY_FLIPS, FLIPPED = 16, 0.01
# times the room that is left: by how much, in area, the Jacobians of a start may be off. Of 256 unions of ten
# meshes all 18 that there was room for were below 1.9, and none of them had a flipped face.
AFAR = 6.0
FITS = 1e-3  # of the excess of the bound: what two layouts may lose by fitting together as they are


@dataclass(frozen=True)
class MergeOptions:
    """bound: no chart's energy exceeds it. tolerance: of the relaxation of a trial. untangle: rounds of the
    Poisson start. rounds: at most so many. margin: parts of one chart keep this share of the root of its area
    apart. cone: curvature of a vertex above which arcs end there. faces: no union has more (None: any may).
    rigid: layouts that fit together as they are stay so; nothing is solved for them.
    zip: whether the two sides of one chart are glued too. work: how many faces all trials may have, in those of
    the surface, besides FREE_WORK (None: any number). rise: how much larger all merging may leave the mean
    energy of the surface, as a share of it (None: any union below the bound will do). room: what is left of
    that, energy times area (infinite where nothing is asked for). patient: unions are untangled however many
    faces their start flips. search: how much is tried, and in which order near
    ties are, see ``Search``.
    """

    bound: float
    tolerance: float = 1e-3
    untangle: int = 12
    rounds: int = 80
    cone: float = CONE
    margin: float = 0.004
    faces: int | None = None
    rigid: bool = False
    zip: bool = True
    work: float | None = None
    rise: float | None = None
    room: float = np.inf
    patient: bool = False
    search: Search = USUAL


@dataclass(frozen=True, eq=False)
class Unions:
    """What may become one chart each. corners: (m, 3, 2) layouts as they are; in_right: (m,) bool, faces of the
    chart that is turned onto the other one."""

    cut_mesh: CutMesh
    corners: FloatArray
    in_right: BoolArray


@dataclass(frozen=True, eq=False)
class Tried:
    """Unions laid out: uv (nv, 2), and of each (n,) its energy, a floor of that, what is wrong.

    dear: it differs from its parts by more than there was room for, which says nothing of where there is more.
    """

    uv: FloatArray
    energy: FloatArray
    floor: FloatArray
    distorted: BoolArray
    overlapping: BoolArray
    dear: BoolArray

    @staticmethod
    def nothing(cut_mesh: CutMesh) -> "Tried":
        """Of unions that nothing is known of."""
        n = cut_mesh.n_charts
        none = [np.zeros(n, bool) for _ in range(3)]
        uv = np.zeros((cut_mesh.n_vertices, 2))
        return Tried(uv, np.full(n, np.inf), np.ones(n), *none)

    def put(self, some: BoolArray, vertices: IntArray, part: "Tried") -> None:
        """Take over what is known of some unions ((n,) bool) with those vertices."""
        self.uv[vertices] = part.uv
        for mine, theirs in (
            (self.energy, part.energy),
            (self.floor, part.floor),
            (self.distorted, part.distorted),
            (self.overlapping, part.overlapping),
            (self.dear, part.dear),
        ):
            mine[some] = theirs


def keep_cheapest(unions: Unions, tried: Tried, good: BoolArray, room: float) -> float:
    """Of the good unions ((n,) bool, in place) those that add least energy times area to that of their parts,
    as many as there is room for; returns what they add."""
    cut_mesh = unions.cut_mesh
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    was = dirichlet.energy(dirichlet.jacobians(gradients, unions.corners.transpose(2, 1, 0)))
    parts = group_sum(was * cut_mesh.areas, cut_mesh.chart, cut_mesh.n_charts)
    added = np.where(good, tried.energy * cut_mesh.chart_areas - parts, np.inf)
    order = np.argsort(added, kind="stable")
    good[order] = np.cumsum(added[order]) <= room
    return float(added[good].sum())


def lay_out(unions: Unions, options: MergeOptions, crowd: bool, monitor: Monitor) -> Tried:
    """Start from both layouts, the right one turned onto the left; relax; push apart what only touches.

    crowd: there are so many that those that cross before any relaxation are left out, and none is pushed.
    """
    if options.rigid:
        return lay_out_rigid(unions, options, crowd, monitor)
    tried = _bent(unions, options, crowd)
    _keep_apart(unions.cut_mesh, tried, options, crowd)
    return tried


def lay_out_rigid(unions: Unions, options: MergeOptions, crowd: bool, monitor: Monitor) -> Tried:
    """As ``lay_out``; layouts that fit together are taken as they are, and only the others are relaxed."""
    cut_mesh = unions.cut_mesh
    uv, energy, parts = composed(
        cut_mesh,
        unions.corners,
        unions.in_right,
        _turns(cut_mesh, unions.corners, unions.in_right),
    )
    fits = energy <= np.minimum(parts + FITS * (options.bound - 1), options.bound)
    tried = Tried.nothing(cut_mesh)
    tried.uv[:], tried.energy[:] = uv, energy
    if fits.any():
        sub, vid, _ = cut_mesh.subset(fits)
        pairs = crossings(uv[vid], sub)
        crossed = np.bincount(sub.chart[pairs[:, 0] // 3], minlength=sub.n_charts)
        tried.overlapping[fits] = crossed > SHALLOW
    if not fits.all():
        sub, vid, fid = cut_mesh.subset(~fits)
        rest = Unions(sub, unions.corners[fid], unions.in_right[fid])
        tried.put(~fits, vid, _bent(rest, options, crowd))
    _keep_apart(cut_mesh, tried, options, crowd)
    return tried


def _bent(unions: Unions, options: MergeOptions, crowd: bool) -> Tried:
    """Start from both layouts as far as one Poisson solve can have both, and relax."""
    cut_mesh = unions.cut_mesh
    jacobian, targets = _wanted(unions)
    if np.isfinite(options.room):
        uv, near, dear = _start_within(cut_mesh, targets, options.room)
        tried = _relax_some(cut_mesh, uv, near, options, crowd)
        tried.dear[:] = dear
        return tried
    if options.rigid:
        uv, energy = better_start(cut_mesh, targets, jacobian, unions.in_right, options.bound)
        return _relax_some(cut_mesh, uv, np.isfinite(energy), options, crowd)
    # unions that stay flipped are given up: of 169 that were embedded anew 9 came out under the bound
    few = np.maximum(MANY_FLIPS, FLIPPED * np.bincount(cut_mesh.chart))
    hopeless = HOPELESS * (options.bound - 1), np.inf if options.patient else few
    uv, _ = from_jacobians(cut_mesh, targets, options.untangle, hopeless=hopeless)
    return _relax(cut_mesh, uv, options, crowd)


def _wanted(unions: Unions) -> tuple[FloatArray, FloatArray]:
    """(Jacobians of both layouts, the same with the right part turned onto the left one), (2, 2, m) each."""
    cut_mesh = unions.cut_mesh
    turn = _turns(cut_mesh, unions.corners, unions.in_right)
    gradients = np.ascontiguousarray(cut_mesh.gradients.transpose(1, 2, 0))
    jacobian = dirichlet.jacobians(gradients, unions.corners.transpose(2, 1, 0))
    cosine, sine = turn[:, 0][cut_mesh.chart], turn[:, 1][cut_mesh.chart]
    turned = np.stack(
        [cosine * jacobian[0] - sine * jacobian[1], sine * jacobian[0] + cosine * jacobian[1]]
    )
    return jacobian, np.where(unions.in_right, turned, jacobian)


def _start_within(
    cut_mesh: CutMesh, targets: FloatArray, room: float
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """(uv, unions that hardly differ from the layouts of their parts, those that cost more than the room).

    One linear solve tells: how far its Jacobians are off bounds about what the union adds.
    """
    system = Poisson(cut_mesh)
    uv = system.layout(targets)
    jacobian, flipped = system.judged(uv)
    off = group_sum(
        ((jacobian - targets) ** 2).sum((0, 1)) * cut_mesh.areas, cut_mesh.chart, len(flipped)
    )
    little = off <= AFAR * room
    return uv, ~flipped & little, ~flipped & ~little


def _relax_some(
    cut_mesh: CutMesh, uv: FloatArray, which: BoolArray, options: MergeOptions, crowd: bool
) -> Tried:
    """Relax some unions ((n,) bool); the others are distorted."""
    tried = Tried.nothing(cut_mesh)
    tried.uv[:], tried.distorted[:] = uv, True
    if which.any():
        sub, vid, _ = cut_mesh.subset(which)
        tried.put(which, vid, _relax(sub, uv[vid], options, crowd))
    return tried


def _keep_apart(cut_mesh: CutMesh, tried: Tried, options: MergeOptions, crowd: bool) -> None:
    """Push apart what only touches; the others overlap."""
    good = ~tried.distorted & ~tried.overlapping
    if not good.any():
        return
    sub, vid, _ = cut_mesh.subset(good)
    contacts = SelfContacts.of(sub, tried.uv[vid])
    over = good.copy()
    over[good] = contacts.meets
    if options.margin > 0:
        over[good] |= contacts.near(options.margin, ~contacts.meets, options.rigid) > 0
    tried.overlapping[over] = True
    if options.rigid:
        over[good] = hardly_near(contacts, over[good], options.margin)
    if over.any() and not crowd:
        sub, vid, _ = cut_mesh.subset(over)
        pushed, fine = push_apart(
            sub, tried.uv[vid], options.margin, options.bound, chamfers=options.rigid
        )
        kept = fine[sub.vertex_chart]
        tried.uv[vid[kept]] = pushed[kept]
        tried.overlapping[np.flatnonzero(over)[fine]] = False


def _relax(cut_mesh: CutMesh, uv: FloatArray, options: MergeOptions, crowd: bool) -> Tried:
    """Relax the unions; those that overlap deep, or still do after two steps, are given up.

    Of 160 unions of two meshes that overlapped after two steps, 158 overlapped when they had converged; of
    some 400 of six meshes whose boundaries crossed more than twice before any step, all did. Where there is
    room for hardly any change, so did all 19 of four meshes that crossed at all.
    """
    hasty = options.rigid or options.search.draft
    enough = 1 + ENOUGH * (options.bound - 1) if hasty else None
    steps = RelaxOptions(options.tolerance, 2, bound=enough, give_up=options.bound)
    tried = Tried.nothing(cut_mesh)
    tried.uv[:] = uv
    pairs = crossings(uv, cut_mesh)
    crossed = np.bincount(cut_mesh.chart[pairs[:, 0] // 3], minlength=cut_mesh.n_charts)
    tried.overlapping[:] = crossed > (0 if crowd or np.isfinite(options.room) else SHALLOW)
    live = ~tried.overlapping
    if live.any():
        sub, vid, _ = cut_mesh.subset(live)
        first = relax(sub, uv[vid], steps)
        tried.uv[vid] = first.uv
        tried.floor[live] = first.floor
        tried.energy[live] = first.energy
        live[live] = np.isfinite(first.energy) & np.array([r != "gave up" for r in first.stopped])
    # what is as good as it needs to be is looked at once, when its margins are
    later = live & (tried.energy > (enough or 0.0))
    if later.any():
        sub, vid, _ = cut_mesh.subset(later)
        tried.overlapping[later] = self_overlapping(sub, tried.uv[vid])
        live &= ~tried.overlapping
    if live.any():
        sub, vid, _ = cut_mesh.subset(live)
        rest = relax(sub, tried.uv[vid], dataclasses.replace(steps, max_iterations=23))
        tried.uv[vid] = rest.uv
        tried.energy[live] = rest.energy
        tried.floor[live] = np.maximum(tried.floor[live], rest.floor)
    tried.distorted[:] = ~tried.overlapping & ~(tried.energy <= options.bound)
    return tried


def _turns(cut_mesh: CutMesh, corners: FloatArray, in_right: BoolArray) -> FloatArray:
    """(n, 2) cosine and sine of the rotation that lays the right chart's side of the glued arc onto the left's.

    in_right: (m,) bool, faces of the right chart.
    """
    i, j = cut_mesh.edges[:, 0], cut_mesh.edges[:, 1]
    glued = in_right[i // 3] != in_right[j // 3]
    i, j = i[glued], j[glued]
    swap = in_right[i // 3]
    p, q = np.where(swap, j, i), np.where(swap, i, j)
    flat = corners.reshape(-1, 2)
    ep = flat[next_half_edge(p)] - flat[p]
    eq = flat[q] - flat[next_half_edge(q)]
    union = cut_mesh.chart[p // 3]
    cosine = group_sum((ep * eq).sum(1), union, cut_mesh.n_charts)
    sine = group_sum(cross2(eq, ep), union, cut_mesh.n_charts)
    length = np.hypot(cosine, sine)
    ok = length > 0
    safe = np.where(ok, length, 1.0)
    return np.stack([np.where(ok, cosine / safe, 1.0), np.where(ok, sine / safe, 0.0)], 1)
