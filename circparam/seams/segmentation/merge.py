"""Merge charts: glue one arc of a pair of neighbours, lay the union out, keep it if it is good.

Every round glues at most one arc of every chart and lays all unions out in one block system, so a round costs
about one relaxation of the surface however many charts there are.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    group_sum,
)
from circparam.core.graph import matching
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.seams.segmentation.glues import (
    Glues,
    known_excess,
    perimeters,
    rings_of,
)
from circparam.seams.segmentation.layout import chart_parts
from circparam.seams.segmentation.state import Arcs, arcs_of
from circparam.seams.segmentation.unions import (
    MANY,
    MergeOptions,
    Tried,
    Unions,
    keep_cheapest,
    lay_out,
)
from circparam.solvers.objective import chart_energies
from circparam.solvers.pattern import eliminate_as, elimination_ranks

PATIENCE = 3  # rounds in a row, after which merging ends
HARDLY = 50  # if fewer than one in so many charts was merged in them
FREE_WORK = 60_000  # faces: what trials on small surfaces hold costs little
MIX, RING = np.uint64(0x9E3779B97F4A7C15), np.uint64(0x5851F42D4C957F2D)
SHARE = 0.5  # of the search for charts that merging is
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
        self.work = 0  # faces of all unions that were tried
        self.limit = np.inf
        if options.work is not None:
            self.limit = options.work * len(atlas.surface.faces) + FREE_WORK
        self.room = np.inf  # energy times area that all unions together may still add
        self.dear = np.zeros(0, np.uint64)  # those of ``tried`` that there was no room for
        if options.rise is not None:
            cut_mesh, uv = atlas.open()
            self.room = options.rise * float(chart_energies(cut_mesh, uv) @ cut_mesh.chart_areas)
        self.tally = {"trials": 0, "topology": 0, "distortion": 0, "overlap": 0, "merged": 0}

    def run(self, monitor: Monitor) -> None:
        """Merge until no pair is left to try."""
        merged: list[int] = []
        monitor.keep(self.atlas)
        most = min(DRAFT_ROUNDS, self.options.rounds)
        for turn in range(most if self.options.search.draft else self.options.rounds):
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
        pick = matching(glues.score[open_glues], glues.left[open_glues], glues.right[open_glues], n)
        chosen = open_glues[pick]
        self.tried = np.union1d(self.tried, glues.key[chosen])
        if len(chosen):
            self._try(arcs, chart, n, glues, chosen, monitor)
        return True

    def more_room(self, room: float) -> None:
        """Let unions add so much energy times area from now on; what there was no room for is tried again."""
        self.room, self.work = room, 0
        self.tried = np.setdiff1d(self.tried, self.dear)
        self.dear = np.zeros(0, np.uint64)

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
        if not self.options.zip:
            may &= left != right
        least = known_excess(c, arcs, chart, self.lower_bound, (left, right, pair))
        may &= ~(1 + least > self.options.bound)
        rim = perimeters(c, arcs, chart, n)
        # zipping a chart up uses distortion that gluing another chart on may need: it comes last
        score = length / np.minimum(rim[left], rim[right]) * _luck(key, self.options.search.draw)
        score -= left == right
        return Glues(left, right, key, score, may, pair, rings)

    def _charge(self, arcs: Arcs, chosen: IntArray, lower_bound: FloatArray) -> None:
        """Keep (energy − 1) · area of the unions that failed, on the edges of their arcs.

        Where all arcs of a pair were glued nothing is known of each alone.
        """
        alone = chosen < len(arcs.left)
        of_arc = np.zeros(len(arcs.left))
        of_arc[chosen[alone]] = lower_bound[alone]
        self.lower_bound[arcs.edge] = np.maximum(self.lower_bound[arcs.edge], of_arc[arcs.arc])

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
