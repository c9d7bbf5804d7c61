"""Merge charts: glue one arc of a pair of neighbours, lay the union out, keep it if it is good.

Every round glues at most one arc of every chart and lays all unions out in one block system, so a round costs
about one relaxation of the surface however many charts there are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_keys,
    group_max,
    group_min,
    group_sum,
)
from circparam.core.graph import matching
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.segmentation.failed import Failed
from circparam.seams.segmentation.glues import (
    Glues,
    known_excess,
    perimeters,
    rings_of,
    side_by_side,
)
from circparam.seams.segmentation.layout import chart_parts
from circparam.seams.segmentation.moved_on import crossings_as_they_are
from circparam.seams.segmentation.state import Arcs, arcs_of, main_parts
from circparam.seams.segmentation.unions import (
    MANY,
    MergeOptions,
    Tried,
    Unions,
    first_look,
    keep_cheapest,
    lay_out,
)
from circparam.solvers.objective import chart_energies
from circparam.solvers.pattern import eliminate_as, elimination_ranks

PATIENCE = 3  # rounds in a row, after which merging ends
HARDLY = 50  # if fewer than one in so many charts was merged in them
FREE_WORK = 60_000  # faces: what trials on small surfaces hold costs little
LOOKED_AT = 4_000  # faces of a surface up to which calls cost more than what unions hold
LOOK = 10_000  # faces of the unions that are looked at together
# pairs of boundary edges that cross where two charts are moved onto each other as they are, from which on they
# are no chart where there is room for hardly any change: of 693 such unions of 44 meshes none was, of 144 with
# two pairs 7 were
CROSSED = 3
MIX, RING = np.uint64(0x9E3779B97F4A7C15), np.uint64(0x5851F42D4C957F2D)
SHARE = 0.5  # of the search for charts that merging is
SLACK = 0.3  # share by which shorter seams may lower the distortion of a union
DRAFT_ROUNDS = 8  # of a draft: most charts that merge at all have done so by then
TIE = 0.2  # candidates whose scores differ by less are tried in another order by another draw


class Merger:
    """Merges the charts of an atlas in rounds and remembers what was tried."""

    def __init__(
        self,
        atlas: Atlas,
        options: MergeOptions,
        fixed: BoolArray,
        worker: Worker | None = None,
    ) -> None:
        self.atlas = atlas
        self.worker = worker  # lays unions out
        self.options = options
        self.fixed = fixed  # (e,) bool: seams that must stay
        self.tried = np.zeros(0, np.uint64)
        self.lower_bound = np.zeros(len(atlas.cut))  # (e,) see _charge
        self.failed = Failed(len(atlas.cut))
        self.work = 0  # faces of all unions that were tried
        self.limit = np.inf
        if options.work is not None:
            self.limit = options.work * len(atlas.surface.faces) + FREE_WORK
        self.room = np.inf  # energy times area that all unions together may still add
        self.dear = np.zeros(0, np.uint64)  # those of ``tried`` that there was no room for
        self.looked_at = np.zeros(0, np.uint64)  # candidates that a first look left
        if options.rise is not None:
            cut_mesh, uv = atlas.open()
            self.room = options.rise * float(chart_energies(cut_mesh, uv) @ cut_mesh.chart_areas)
        self.tally = {"trials": 0, "topology": 0, "distortion": 0, "overlap": 0, "merged": 0}

    def run(self, monitor: Monitor) -> None:
        """Merge until no pair is left to try."""
        merged: list[int] = []
        monitor.keep(self.atlas)
        for turn in range(DRAFT_ROUNDS if self.options.search.draft else self.options.rounds):
            before = self.tally["merged"]
            if monitor.expired or self.work > self.limit or not self.round(monitor):
                break
            monitor.keep(self.atlas)
            merged.append(self.tally["merged"] - before)
            few = (sum(merged[-PATIENCE:]) + 1) * HARDLY < self.atlas.charts()[0]
            if few and turn >= PATIENCE:
                break
            monitor.update(SHARE * turn / self.options.rounds)

    def round(self, monitor: Monitor) -> bool:
        """One round; False when there was nothing to try."""
        c = self.atlas
        n, chart = c.charts()
        arcs = arcs_of(c, chart, self.options.cone)
        if len(arcs.left) == 0:
            return False
        glues = self._glues(arcs, chart, n)
        open_glues = np.flatnonzero(glues.may & ~np.isin(glues.key, self.tried))
        if len(open_glues) == 0:
            return False
        if np.isfinite(self.room):
            open_glues = self._worth_trials(arcs, glues, open_glues, chart)
            if len(open_glues) == 0:
                return True
        pick = matching(glues.score[open_glues], glues.left[open_glues], glues.right[open_glues], n)
        chosen = open_glues[pick]
        self.tried = np.union1d(self.tried, glues.key[chosen])
        chosen = self._not_on_each_other(arcs, chart, glues, chosen[~glues.useless[chosen]])
        if len(chosen):
            self._try(arcs, chart, n, glues, chosen, monitor)
        return True

    def more_room(self, room: float) -> None:
        """Let unions add so much energy times area from now on; what there was no room for is tried again."""
        self.room, self.work = room, 0
        self.tried = np.setdiff1d(self.tried, self.dear)
        self.dear, self.looked_at = np.zeros(0, np.uint64), np.zeros(0, np.uint64)

    def _worth_trials(
        self, arcs: Arcs, glues: Glues, open_glues: IntArray, chart: IntArray
    ) -> IntArray:
        """The open candidates that a first look leaves, at the best few at once.

        Where there is room for hardly any change it refuses nine of ten, and a trial alone takes as long as
        what four hold. chart: (m,) of each face.
        """
        if self.atlas.prices is not None or len(self.atlas.surface.faces) > LOOKED_AT:
            return open_glues
        useless = glues.useless[open_glues]
        self.tried = np.union1d(self.tried, glues.key[open_glues[useless]])
        ask = open_glues[~useless]
        seen = np.isin(glues.key[ask], self.looked_at)
        if seen.any():
            return ask[seen]
        ask, size = ask[np.argsort(-glues.score[ask], kind="stable")], np.bincount(chart)
        while len(ask) and self.work <= self.limit:
            faces = np.cumsum(size[glues.left[ask]] + size[glues.right[ask]])
            number = max(int(np.searchsorted(faces, LOOK, side="right")), 1)
            look, ask = self._not_on_each_other(arcs, chart, glues, ask[:number]), ask[number:]
            good = self._looked_at(arcs, glues, look) if len(look) else np.zeros(0, bool)
            if good.any():
                return look[good]
        return ask[:0]

    def _not_on_each_other(
        self, arcs: Arcs, chart: IntArray, glues: Glues, asked: IntArray
    ) -> IntArray:
        """The candidates without those whose charts, moved onto each other as they are, cross so often that
        the hardly any change that there is room for will not part them. chart: (m,) of each face."""
        if not np.isfinite(self.room) or len(asked) == 0:
            return asked
        over = np.zeros(len(asked), bool)
        two = (glues.left[asked] != glues.right[asked]) & (asked < glues.rings)
        over[two] = crossings_as_they_are(self.atlas, arcs, glues, asked[two], chart) >= CROSSED
        lost, size = asked[over], np.bincount(chart)
        self.tried = np.union1d(self.tried, glues.key[lost])
        self.failed.remember(arcs, glues, lost, over[over])
        self.work += int(size[glues.left[lost]].sum() + size[glues.right[lost]].sum())
        self.tally["trials"] += len(lost)
        self.tally["overlap"] += len(lost)
        return asked[~over]

    def _looked_at(self, arcs: Arcs, glues: Glues, ask: IntArray) -> BoolArray:
        """(k,) bool: of those candidates, the ones that a first look leaves; the others have been tried."""
        unions = side_by_side(self.atlas, arcs, glues, ask, elimination_ranks(self.atlas.surface))
        good, dear, crossed = first_look(unions, self.room)
        good &= ~not_disks(unions.cut_mesh)
        self.looked_at = np.union1d(self.looked_at, glues.key[ask[good]])
        self.tried = np.union1d(self.tried, glues.key[ask[~good]])
        self.dear = np.union1d(self.dear, glues.key[ask[dear]])
        self.failed.remember(arcs, glues, ask[~good], crossed[~good])
        self.work += int(np.bincount(unions.cut_mesh.chart)[~good].sum())
        self.tally["trials"] += int((~good).sum())
        self.tally["overlap"] += int(crossed.sum())
        self.tally["distortion"] += int((~good & ~crossed).sum())
        return good

    def _glues(self, arcs: Arcs, chart: IntArray, n: int) -> Glues:
        """What may be glued: single arcs, and all arcs between two charts at once where there are several.

        Several at once are tried only when each alone has failed: two charts that close a flat ring overlap
        with one arc glued, and not with both.
        """
        c = self.atlas
        size = np.bincount(chart, minlength=n)
        first_face = np.full(n, len(chart))
        np.minimum.at(first_face, chart, np.arange(len(chart)))
        first_edge = np.full(len(arcs.left), len(c.cut))
        np.minimum.at(first_edge, arcs.arc, arcs.edge)
        held = np.zeros(len(arcs.left), bool)
        held[arcs.arc[self.fixed[arcs.edge]]] = True
        pairs, pair = np.unique(arcs.left * n + arcs.right, return_inverse=True)
        pair = pair.reshape(-1)
        left, right = (
            np.concatenate([arcs.left, pairs // n]),
            np.concatenate([arcs.right, pairs % n]),
        )
        several = (np.bincount(pair) > 1) & (pairs // n != pairs % n)
        length = np.concatenate([arcs.length, group_sum(arcs.length, pair, len(pairs))])
        key = np.zeros(len(left), np.uint64)
        mark = np.concatenate([first_edge, np.full(len(pairs), len(c.cut) + 1)])
        for part in (first_face[left], size[left], first_face[right], size[right], mark):
            key = (key ^ part.astype(np.uint64)) * MIX
            key ^= key >> np.uint64(29)
        alone = key[: len(arcs.left)]
        useless = np.zeros(len(left), bool)
        if not self.options.rigid:
            useless = np.concatenate(self.failed.useless(arcs, pair, len(pairs)))
        waiting = np.zeros(len(pairs), bool)
        waiting[pair[~np.isin(alone, self.tried) | held]] = True
        may = np.concatenate([((arcs.left != arcs.right) | arcs.tip) & ~held, several & ~waiting])
        if self.options.faces is not None:
            may &= size[left] + np.where(left == right, 0, size[right]) <= self.options.faces
        rings = 1 << 62
        if self.options.rigid:
            rings = len(left)
            ring = rings_of(arcs, pairs, n, length[len(arcs.left) :])
            left, right = np.concatenate([left, pairs // n]), np.concatenate([right, pairs % n])
            key = np.concatenate([key, (key[len(arcs.left) :] ^ RING) * MIX])
            length = np.concatenate([length, ring])
            may = np.concatenate([may, (ring > 0) & ~waiting])
            useless = np.concatenate([useless, np.zeros(len(ring), bool)])
        if not self.options.zip:
            may &= left != right
        least = known_excess(c, arcs, chart, self.lower_bound, (left, right, pair))
        may &= ~(1 + least > self.options.bound)
        rim = perimeters(c, arcs, chart, n)
        # zipping a chart up uses distortion that gluing another chart on may need: it comes last
        score = length / np.minimum(rim[left], rim[right]) * _luck(key, self.options.search.draw)
        score -= left == right
        return Glues(left, right, key, score, may, useless, pair, rings)

    def _charge(self, arcs: Arcs, chosen: IntArray, lower_bound: FloatArray) -> None:
        """Keep (energy − 1) · area of the unions that failed, on the edges of their arcs.

        Where all arcs of a pair were glued nothing is known of each alone.
        """
        alone = chosen < len(arcs.left)
        of_arc = np.zeros(len(arcs.left))
        of_arc[chosen[alone]] = lower_bound[alone]
        self.lower_bound[arcs.edge] = np.maximum(self.lower_bound[arcs.edge], of_arc[arcs.arc])

    def seams_moved(self, before: IntArray, arcs: Arcs) -> None:
        """Transfer what was learnt over to seams that were shortened.

        before: (m,) charts when ``arcs`` were taken. What is known of all arcs of a pair of charts holds,
        less SLACK, for the arcs that the same pair has now.
        """
        c = self.atlas
        n, chart = c.charts()
        width = int(before.max()) + 1
        lower_bound = group_max(self.lower_bound[arcs.edge], arcs.arc, len(arcs.left))
        pairs, pair = np.unique(arcs.left * width + arcs.right, return_inverse=True)
        least = group_min(lower_bound, pair.reshape(-1), len(pairs))
        main = main_parts(chart, before, c.surface.areas)
        was = np.zeros(n, np.int64)
        was[chart[main]] = before[main]
        now = arcs_of(c, chart, self.options.cone)
        left, right = was[now.left], was[now.right]
        key = edge_keys(left, right, width)
        at = np.minimum(np.searchsorted(pairs, key), len(pairs) - 1)
        known = np.where(pairs[at] == key, least[at], 0.0)
        self.failed.forget()
        self.lower_bound[:] = 0
        self.lower_bound[now.edge] = (1 - SLACK) * known[now.arc]

    def _try(
        self,
        arcs: Arcs,
        chart: IntArray,
        n: int,
        glues: Glues,
        chosen: IntArray,
        monitor: Monitor,
    ) -> None:
        """Lay out the unions of the chosen arcs and keep the good ones."""
        c = self.atlas
        while True:
            cut = c.cut & ~glues.glued(arcs, chosen, len(c.cut))
            union = np.full(n, -1)
            union[glues.left[chosen]] = union[glues.right[chosen]] = np.arange(len(chosen))
            label = union[chart]
            cut_mesh, fid = c.surface.part_cut_mesh(cut, label >= 0, label)
            bad = not_disks(cut_mesh)
            if not bad.any():
                # no union has to look for an order of elimination of its own
                ranks = elimination_ranks(c.surface)
                eliminate_as(cut_mesh, ranks, c.surface.corner_vertex[fid])
                break
            self.tally["topology"] += int(bad.sum())
            chosen = chosen[~bad]
            if len(chosen) == 0:
                return
        self.tally["trials"] += len(chosen)
        self.work += len(cut_mesh.faces)
        right = glues.right[chosen][cut_mesh.chart]
        in_right = (chart[fid] == right) & (glues.left[chosen] != glues.right[chosen])[
            cut_mesh.chart
        ]
        unions = Unions(cut_mesh, c.corners[fid], in_right)
        tried = self._lay_out(unions, monitor)
        self.failed.remember(arcs, glues, chosen, tried.deep)
        self._charge(arcs, chosen, (tried.floor - 1) * cut_mesh.chart_areas)
        self.tally["distortion"] += int(tried.distorted.sum())
        self.tally["overlap"] += int(tried.overlapping.sum())
        good = ~tried.distorted & ~tried.overlapping
        if np.isfinite(self.room):
            fine = good.copy()
            self.room -= keep_cheapest(unions, tried, good, self.room)
            dear = tried.dear | (fine & ~good)
            self.dear = np.union1d(self.dear, glues.key[chosen[dear]])
        self.tally["merged"] += int(good.sum())
        kept = good[cut_mesh.chart]
        c.corners[fid[kept]] = tried.uv[cut_mesh.faces[kept]]
        c.cut &= ~glues.glued(arcs, chosen[good], len(c.cut))

    def _lay_out(self, unions: Unions, monitor: Monitor) -> Tried:
        """Lay unions out; many faces in parts, by all processes."""
        cut_mesh = unions.cut_mesh
        crowd = cut_mesh.n_charts > MANY
        options = replace(self.options, room=self.room)
        if self.worker is None:
            return lay_out(unions, options, crowd, monitor)
        tried = Tried.nothing(cut_mesh)
        parts = chart_parts(cut_mesh)
        tasks = [
            (Unions(sub, unions.corners[fid], unions.in_right[fid]), options, crowd)
            for _, sub, _, fid in parts
        ]
        done = self.worker.map(lay_out, tasks, monitor)
        for (part, _, vid, _), of_part in zip(parts, done, strict=True):
            tried.put(part, vid, of_part)
        return tried


def _luck(key: npt.NDArray[np.uint64], draw: int) -> FloatArray:
    """(k,) factors of scores, 1 for the first draw and up to TIE above and below for others."""
    if draw == 0:
        return np.ones(len(key))
    mixed = (key ^ (np.full(1, draw, np.uint64) * RING)) * MIX
    mixed = (mixed ^ (mixed >> np.uint64(31))) * RING
    return 1 + TIE * ((mixed >> np.uint64(40)) / 2.0**23 - 1)
