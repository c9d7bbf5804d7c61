"""Merge charts: glue one arc of a pair of neighbours, lay the union out, keep it if it is good.

Every round glues at most one arc of every chart and lays all unions out in one block system, so a round costs
about one relaxation of the surface however many charts there are.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from circparam.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    cross2,
    group_max,
    group_min,
    group_sum,
    next_half_edge,
)
from circparam.helper import Helper
from circparam.injectivity import crossings, self_overlapping
from circparam.mesh import Patches
from circparam.progress import Monitor
from circparam.seams.cutting import CONE, Arcs, Cutting, main_parts, matching, not_disks
from circparam.seams.relayout import chart_halves
from circparam.solve import dirichlet
from circparam.solve.apart import push_apart
from circparam.solve.newton import RelaxOptions, relax
from circparam.solve.poisson import from_jacobians

MANY = 300  # of more trials at once those that cross before any relaxation are left out, and none is pushed
PATIENCE = 3  # rounds in a row, after which merging ends
SHALLOW = 2  # pairs of border edges that may cross before a union is relaxed
HARDLY = 50  # if fewer than one in so many charts was merged in them
SLACK = 0.3  # share by which shorter seams may lower the distortion of a union


@dataclass(frozen=True)
class MergeOptions:
    """bound: no chart's energy exceeds it. tolerance: of the relaxation of a trial. untangle: rounds of the
    Poisson start. rounds: at most so many. margin: parts of one chart keep this share of the root of its area
    apart. cone: curvature of a vertex above which arcs end there. faces: no union has more (None: any may).
    """

    bound: float
    tolerance: float = 1e-3
    untangle: int = 12
    rounds: int = 80
    cone: float = CONE
    margin: float = 0.004
    faces: int | None = None


@dataclass(frozen=True, eq=False)
class _Glues:
    """Candidates for gluing: every arc, then every pair of neighbouring charts with all its arcs.

    left, right: charts. key: what was tried is remembered by it. score: the best are tried first. may: bool.
    pair: (arcs,) pair of each arc.
    """

    left: IntArray
    right: IntArray
    key: npt.NDArray[np.uint64]
    score: FloatArray
    may: BoolArray
    pair: IntArray

    def glued(self, arcs: Arcs, chosen: IntArray, n_edges: int) -> BoolArray:
        """(n_edges,) bool: edges that the chosen candidates glue."""
        n = len(arcs.left)
        arc = np.zeros(n, bool)
        arc[chosen[chosen < n]] = True
        arc |= np.isin(self.pair, chosen[chosen >= n] - n)
        out = np.zeros(n_edges, bool)
        out[arcs.edge[arc[arcs.arc]]] = True
        return out


class Merger:
    """Merges the charts of a cutting in rounds and remembers what was tried."""

    def __init__(
        self,
        cutting: Cutting,
        options: MergeOptions,
        fixed: BoolArray,
        helper: Helper | None = None,
    ) -> None:
        self.cutting = cutting
        self.helper = helper  # lays half of the unions out
        self.options = options
        self.fixed = fixed  # (e,) bool: seams that must stay
        self.tried = np.zeros(0, np.uint64)
        self.toll = np.zeros(len(cutting.cut))  # (e,) see _charge
        self.tally = {"trials": 0, "topology": 0, "distortion": 0, "overlap": 0, "merged": 0}

    def run(self, monitor: Monitor) -> None:
        """Merge until no pair is left to try."""
        merged: list[int] = []
        for turn in range(self.options.rounds):
            before = self.tally["merged"]
            if monitor.expired or not self.round(monitor):
                break
            merged.append(self.tally["merged"] - before)
            few = (sum(merged[-PATIENCE:]) + 1) * HARDLY < self.cutting.charts()[0]
            if few and turn >= PATIENCE:
                break
            monitor.update(turn / self.options.rounds)

    def round(self, monitor: Monitor) -> bool:
        """One round; False when there was nothing to try."""
        c = self.cutting
        n, chart = c.charts()
        arcs = c.arcs(chart, self.options.cone)
        if len(arcs.left) == 0:
            return False
        glues = self._glues(arcs, chart, n)
        open_glues = np.flatnonzero(glues.may & ~np.isin(glues.key, self.tried))
        if len(open_glues) == 0:
            return False
        pick = matching(glues.score[open_glues], glues.left[open_glues], glues.right[open_glues], n)
        chosen = open_glues[pick]
        self.tried = np.union1d(self.tried, glues.key[chosen])
        self._try(arcs, chart, n, glues, chosen, monitor)
        return True

    def _glues(self, arcs: Arcs, chart: IntArray, n: int) -> _Glues:
        """What may be glued: single arcs, and all arcs between two charts at once where there are several.

        Several at once are tried only when each alone has failed: two charts that close a flat ring overlap
        with one arc glued, and not with both.
        """
        c = self.cutting
        size = np.bincount(chart, minlength=n)
        first_face = np.full(n, len(chart))
        np.minimum.at(first_face, chart, np.arange(len(chart)))
        first_edge = np.full(len(arcs.left), len(c.cut))
        np.minimum.at(first_edge, arcs.arc, arcs.edge)
        held = np.zeros(len(arcs.left), bool)
        held[arcs.arc[self.fixed[arcs.edge]]] = True
        pairs, pair = np.unique(arcs.left * n + arcs.right, return_inverse=True)
        pair = pair.reshape(-1)
        left, right = np.r_[arcs.left, pairs // n], np.r_[arcs.right, pairs % n]
        several = (np.bincount(pair) > 1) & (pairs // n != pairs % n)
        length = np.r_[arcs.length, group_sum(arcs.length, pair, len(pairs))]
        key = np.zeros(len(left), np.uint64)
        mark = np.r_[first_edge, np.full(len(pairs), len(c.cut) + 1)]
        for part in (first_face[left], size[left], first_face[right], size[right], mark):
            key = (key ^ part.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
            key ^= key >> np.uint64(29)
        alone = key[: len(arcs.left)]
        waiting = np.zeros(len(pairs), bool)
        waiting[pair[~np.isin(alone, self.tried) | held]] = True
        may = np.r_[((arcs.left != arcs.right) | arcs.tip) & ~held, several & ~waiting]
        if self.options.faces is not None:
            may &= size[left] + np.where(left == right, 0, size[right]) <= self.options.faces
        may &= ~self._hopeless(arcs, chart, left, right, pair)
        rim = self._perimeters(arcs, chart, n)
        # zipping a chart up uses distortion that gluing another chart on may need: it comes last
        score = length / np.minimum(rim[left], rim[right]) - (left == right)
        return _Glues(left, right, key, score, may, pair)

    def _hopeless(
        self, arcs: Arcs, chart: IntArray, left: IntArray, right: IntArray, pair: IntArray
    ) -> BoolArray:
        """(candidates,) bool: a part of the union is known to be distorted too much for it.

        A map of a chart is one of each of its parts, so its distortion times its area is no less than that of
        a part, and arcs and charts only grow.
        """
        area = group_sum(self.cutting.surface.areas, chart, len(np.bincount(chart)))
        union = np.where(left == right, area[left], area[left] + area[right])
        toll = group_max(self.toll[arcs.edge], arcs.arc, len(arcs.left))
        toll = np.r_[toll, group_max(toll, pair, len(left) - len(toll))]
        result: BoolArray = 1 + toll / union > self.options.bound
        return result

    def _charge(self, arcs: Arcs, chosen: IntArray, toll: FloatArray) -> None:
        """Keep (energy − 1) · area of the unions that failed, on the edges of their arcs.

        Where all arcs of a pair were glued nothing is known of each alone.
        """
        alone = chosen < len(arcs.left)
        of_arc = np.zeros(len(arcs.left))
        of_arc[chosen[alone]] = toll[alone]
        self.toll[arcs.edge] = np.maximum(self.toll[arcs.edge], of_arc[arcs.arc])

    def seams_moved(self, before: IntArray, arcs: Arcs) -> None:
        """Carry what was learnt over to seams that were shortened.

        before: (m,) charts when ``arcs`` were taken. What is known of all arcs of a pair of charts holds,
        less SLACK, for the arcs that the same pair has now.
        """
        c = self.cutting
        n, chart = c.charts()
        width = int(before.max()) + 1
        toll = group_max(self.toll[arcs.edge], arcs.arc, len(arcs.left))
        pairs, pair = np.unique(arcs.left * width + arcs.right, return_inverse=True)
        least = group_min(toll, pair.reshape(-1), len(pairs))
        main = main_parts(chart, before, c.surface.areas)
        was = np.zeros(n, np.int64)
        was[chart[main]] = before[main]
        now = c.arcs(chart, self.options.cone)
        left, right = was[now.left], was[now.right]
        key = np.minimum(left, right) * width + np.maximum(left, right)
        at = np.minimum(np.searchsorted(pairs, key), len(pairs) - 1)
        known = np.where(pairs[at] == key, least[at], 0.0)
        self.toll[:] = 0
        self.toll[now.edge] = (1 - SLACK) * known[now.arc]

    def _perimeters(self, arcs: Arcs, chart: IntArray, n: int) -> FloatArray:
        """(n,) length of the border of every chart."""
        c = self.cutting
        rim = group_sum(arcs.length, arcs.left, n) + group_sum(arcs.length, arcs.right, n)
        return rim + group_sum(c.border_lengths, chart[c.surface.border // 3], n)

    def _try(
        self,
        arcs: Arcs,
        chart: IntArray,
        n: int,
        glues: _Glues,
        chosen: IntArray,
        monitor: Monitor,
    ) -> None:
        """Lay out the unions of the chosen arcs and keep the good ones."""
        c = self.cutting
        while True:
            cut = c.cut & ~glues.glued(arcs, chosen, len(c.cut))
            union = np.full(n, -1)
            union[glues.left[chosen]] = union[glues.right[chosen]] = np.arange(len(chosen))
            label = union[chart]
            patches, fid = c.surface.some_patches(cut, label >= 0, label)
            bad = not_disks(patches)
            if not bad.any():
                break
            self.tally["topology"] += int(bad.sum())
            chosen = chosen[~bad]
            if len(chosen) == 0:
                return
        self.tally["trials"] += len(chosen)
        right = glues.right[chosen][patches.chart]
        in_right = (chart[fid] == right) & (glues.left[chosen] != glues.right[chosen])[
            patches.chart
        ]
        unions = Unions(patches, c.corners[fid], in_right)
        tried = self._lay_out(unions, monitor)
        self._charge(arcs, chosen, (tried.floor - 1) * patches.chart_areas)
        self.tally["distortion"] += int(tried.distorted.sum())
        self.tally["overlap"] += int(tried.overlapping.sum())
        good = ~tried.distorted & ~tried.overlapping
        self.tally["merged"] += int(good.sum())
        kept = good[patches.chart]
        c.corners[fid[kept]] = tried.uv[patches.faces[kept]]
        c.cut &= ~glues.glued(arcs, chosen[good], len(c.cut))

    def _lay_out(self, unions: Unions, monitor: Monitor) -> Tried:
        """Lay unions out; many faces in two halves, one of them by the helper where there is one."""
        patches = unions.patches
        crowd = patches.n_charts > MANY
        if self.helper is None:
            return lay_out(unions, self.options, crowd, monitor)
        tried = Tried.nothing(patches)
        halves = chart_halves(patches)
        tasks = [
            (Unions(sub, unions.corners[fid], unions.in_right[fid]), self.options, crowd)
            for _, sub, _, fid in halves
        ]
        done = self.helper.map(lay_out, tasks, monitor)
        for (part, _, vid, _), of_part in zip(halves, done, strict=True):
            tried.put(part, vid, of_part)
        return tried


@dataclass(frozen=True, eq=False)
class Unions:
    """What may become one chart each. corners: (m, 3, 2) layouts as they are; in_right: (m,) bool, faces of the
    chart that is turned onto the other one."""

    patches: Patches
    corners: FloatArray
    in_right: BoolArray


@dataclass(frozen=True, eq=False)
class Tried:
    """Unions laid out: uv (nv, 2), and of each (n,) its energy, a floor of that, what is wrong."""

    uv: FloatArray
    energy: FloatArray
    floor: FloatArray
    distorted: BoolArray
    overlapping: BoolArray

    @staticmethod
    def nothing(patches: Patches) -> Tried:
        """Of unions that nothing is known of."""
        n = patches.n_charts
        none = np.zeros(n, bool)
        uv = np.zeros((patches.n_vertices, 2))
        return Tried(uv, np.full(n, np.inf), np.ones(n), none, none.copy())

    def put(self, some: BoolArray, vertices: IntArray, part: Tried) -> None:
        """Take over what is known of some unions ((n,) bool) with those vertices."""
        self.uv[vertices] = part.uv
        for mine, theirs in (
            (self.energy, part.energy),
            (self.floor, part.floor),
            (self.distorted, part.distorted),
            (self.overlapping, part.overlapping),
        ):
            mine[some] = theirs


def lay_out(unions: Unions, options: MergeOptions, crowd: bool, monitor: Monitor) -> Tried:
    """Start from both layouts, the right one turned onto the left; relax; push apart what only touches.

    crowd: there are so many that those that cross before any relaxation are left out, and none is pushed.
    """
    patches = unions.patches
    turn = _turns(patches, unions.corners, unions.in_right)
    gradients = np.ascontiguousarray(patches.gradients.transpose(1, 2, 0))
    jacobian = dirichlet.jacobians(gradients, unions.corners.transpose(2, 1, 0))
    cosine, sine = turn[:, 0][patches.chart], turn[:, 1][patches.chart]
    turned = np.stack(
        [cosine * jacobian[0] - sine * jacobian[1], sine * jacobian[0] + cosine * jacobian[1]]
    )
    targets = np.where(unions.in_right, turned, jacobian)
    # unions that stay flipped are given up: of 169 that were embedded anew 9 came out under the bound
    uv, _ = from_jacobians(patches, targets, options.untangle)
    tried = _relax(patches, uv, options, crowd)
    good = ~tried.distorted & ~tried.overlapping
    if good.any():
        sub, vid, _ = patches.subset(good)
        over = np.zeros(len(good), bool)
        over[good] = self_overlapping(sub, tried.uv[vid], margin=options.margin)
        if over.any() and not crowd:
            sub, vid, _ = patches.subset(over)
            pushed, fine = push_apart(sub, tried.uv[vid], options.margin, options.bound)
            kept = fine[sub.vertex_chart]
            tried.uv[vid[kept]] = pushed[kept]
            over[np.flatnonzero(over)[fine]] = False
        tried.overlapping[over] = True
    return tried


def _relax(patches: Patches, uv: FloatArray, options: MergeOptions, crowd: bool) -> Tried:
    """Relax the unions; those that overlap deep, or still do after two steps, are given up.

    Of 160 unions of two meshes that overlapped after two steps, 158 overlapped when they had converged; of
    some 400 of six meshes whose borders crossed more than twice before any step, all did.
    """
    steps = RelaxOptions(tolerance=options.tolerance, max_iterations=2, give_up=options.bound)
    tried = Tried.nothing(patches)
    tried.uv[:] = uv
    pairs = crossings(uv, patches)
    crossed = np.bincount(patches.chart[pairs[:, 0] // 3], minlength=patches.n_charts)
    tried.overlapping[:] = crossed > (0 if crowd else SHALLOW)
    live = ~tried.overlapping
    if live.any():
        sub, vid, _ = patches.subset(live)
        first = relax(sub, uv[vid], steps)
        tried.uv[vid] = first.uv
        tried.floor[live] = first.floor
        tried.energy[live] = first.energy
        live[live] = np.isfinite(first.energy) & np.array([r != "gave up" for r in first.stopped])
    if live.any():
        sub, vid, _ = patches.subset(live)
        tried.overlapping[live] = self_overlapping(sub, tried.uv[vid])
        live &= ~tried.overlapping
    if live.any():
        sub, vid, _ = patches.subset(live)
        rest = relax(sub, tried.uv[vid], dataclasses.replace(steps, max_iterations=23))
        tried.uv[vid] = rest.uv
        tried.energy[live] = rest.energy
        tried.floor[live] = np.maximum(tried.floor[live], rest.floor)
    tried.distorted[:] = ~tried.overlapping & ~(tried.energy <= options.bound)
    return tried


def _turns(patches: Patches, corners: FloatArray, in_right: BoolArray) -> FloatArray:
    """(n, 2) cosine and sine of the rotation that lays the right chart's side of the glued arc onto the left's.

    in_right: (m,) bool, faces of the right chart.
    """
    i, j = patches.edges[:, 0], patches.edges[:, 1]
    glued = in_right[i // 3] != in_right[j // 3]
    i, j = i[glued], j[glued]
    swap = in_right[i // 3]
    p, q = np.where(swap, j, i), np.where(swap, i, j)
    flat = corners.reshape(-1, 2)
    ep = flat[next_half_edge(p)] - flat[p]
    eq = flat[q] - flat[next_half_edge(q)]
    union = patches.chart[p // 3]
    cosine = group_sum((ep * eq).sum(1), union, patches.n_charts)
    sine = group_sum(cross2(eq, ep), union, patches.n_charts)
    length = np.hypot(cosine, sine)
    ok = length > 0
    safe = np.where(ok, length, 1.0)
    return np.stack([np.where(ok, cosine / safe, 1.0), np.where(ok, sine / safe, 0.0)], 1)
