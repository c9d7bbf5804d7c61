"""Splits for packing: a chart like a hub with arms wastes the page; cut where the arms begin, it may not.

Candidates are shortest paths across a chart between points of its boundary. They are ranked by the area that
the bounding boxes of both parts leave free beside what the chart's leaves free, and the best are packed: a
split stays only if the page is covered much better with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    cross2,
    group_sum,
    next_half_edge,
)
from circparam.core.monitor import Monitor
from circparam.errors import CircparamError
from circparam.geometry.distortion import best_chart_scales
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing import pack
from circparam.packing.options import PackOptions
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.chords import boxes, extents, turned
from circparam.pipeline.cut_along import cheapest_way, two_disks

ANCHORS = 48  # points of a boundary between which paths are tried
# a corner of a boundary that turns in by nearly a right angle: an arm may begin there
REFLEX = np.pi * 4 / 9
SNAP = 1e-9  # share of a boundary's length by which a point may lie before its anchor's place: rounding
HUBS = 2  # charts that are tried for a split, those that waste most
TRIED = 3  # paths of each that are packed
ALIKE = 0.01  # paths whose gain and smaller part differ by less are the same one on another arm: one is packed
SLACK = 0.1  # share of the area that boxes may lose where the page gains: a cross fits its box best when turned
GAIN = 1.05  # factor on the covered share that each split must bring
AHEAD = 3  # splits that may bring nothing before one that does
LEAST = 0.03  # share of the chart that either part must have
CHORD = 0.05  # worth of a cut as long as the root of the chart's area, as a share of that area
EFFORT = 0.1  # of the search for a layout that only serves to compare
COARSE = 512  # texels a side of its page, about


@dataclass(frozen=True, eq=False)
class _Candidate:
    """score: higher is better. atlas: the charts with one of them split along a path."""

    score: float
    atlas: Atlas


def split_for_packing(
    cascade: Cascade, most: int, options: PackOptions, monitor: Monitor
) -> Cascade:
    """Split at most so many charts where each split raises the covered share by GAIN; a note tells what it did.

    The parts keep the layout they had, so nothing overlaps; a split that would lift one above the bound of the
    cascade (its distortion at its own best scale) is not made.
    """
    cascade = fallback.settle(cascade, monitor)
    coarse = max(options.resolution // COARSE, 1)
    quick = replace(
        options,
        effort=min(options.effort, EFFORT),
        resolution=max(options.resolution // coarse, 2 * (options.padding // coarse) + 1),
        padding=options.padding // coarse,
    )
    before = cascade.atlas
    # an arm alone often frees nothing while its opposite stays: go on, then take what was worth its splits
    steps: list[tuple[float, Atlas]] = [(_share(before, quick, monitor), before)]
    done = 0
    while len(steps) <= most and len(steps) - done <= AHEAD and not monitor.expired:
        found = _candidates(steps[-1][1], cascade.rules.bound)
        tried = [(_share(c.atlas, quick, monitor), c.atlas) for c in found]
        if not tried:
            break
        steps.append(max(tried, key=lambda t: t[0]))
        done = int(np.argmax([share / GAIN**k for k, (share, _) in enumerate(steps)]))
    after = steps[done][1]
    if done:
        # the quick layouts only rank the splits: what counts is the page as it will be packed
        first, last = (_share(atlas, options, monitor) for atlas in (before, after))
        if last >= GAIN**done * first:
            longer = after.seam_length - before.seam_length
            return replace(cascade, atlas=after).noted(
                f"--pack-splits: {done} charts split, covered share {first:.2f} before and {last:.2f} "
                f"after, seams longer by {longer:.2f} times the root of the area"
            )
    return cascade.noted("--pack-splits: no split raises the covered share by 5 %")


def _share(atlas: Atlas, options: PackOptions, monitor: Monitor) -> float:
    """Covered share of the pages with these seams; 0 where they cannot be packed."""
    cut_mesh, uv = atlas.open()
    uv = uv * best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]
    try:
        packed = pack(cut_mesh.faces, uv, cut_mesh.chart, options, monitor)
    except CircparamError:
        return 0.0
    return float(packed.share[: int(packed.page.max()) + 1].mean())


def _candidates(atlas: Atlas, bound: float) -> list[_Candidate]:
    """The best paths across the charts that waste most, without those that break the bound."""
    cut_mesh, uv = atlas.open()
    loops = cut_mesh.loops
    if len(loops.chart) == 0:
        return []
    start = cut_mesh.faces.ravel()[loops.half_edges]
    along = turned(uv[start])
    high = np.maximum.reduceat(along, loops.start[:-1])
    low = np.minimum.reduceat(along, loops.start[:-1])
    waste = np.where(loops.outer, boxes(low, high), 0.0)
    waste -= group_sum(_fans(uv, start, loops.half_edges, cut_mesh), loops.loop_of, len(waste))
    found: list[_Candidate] = []
    for loop in np.argsort(-waste, kind="stable")[:HUBS].tolist():
        if loops.outer[loop] and waste[loop] > 0:
            found += _paths(atlas, cut_mesh, uv, loop, bound)
    return found


def _fans(uv: FloatArray, start: IntArray, half_edges: IntArray, cut_mesh: CutMesh) -> FloatArray:
    """(b,) signed areas between the origin and boundary half-edges; a loop's sum is the area inside."""
    end = cut_mesh.faces.ravel()[next_half_edge(half_edges)]
    return cross2(uv[start], uv[end]) / 2


def _paths(
    atlas: Atlas, cut_mesh: CutMesh, uv: FloatArray, loop: int, bound: float
) -> list[_Candidate]:
    """Paths across one chart between points of its outer boundary, the best first."""
    loops = cut_mesh.loops
    part = slice(int(loops.start[loop]), int(loops.start[loop + 1]))
    h = loops.half_edges[part]
    v = cut_mesh.faces.ravel()[h]
    p = uv[v]
    step = np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1)
    at = np.cumsum(step) - step
    even = np.searchsorted(at, (np.arange(ANCHORS) / ANCHORS - SNAP) * step.sum())
    anchor = np.unique(np.r_[even[even < len(v)], _reflex(p)])
    k = len(anchor)
    if k < 4:
        return []
    i, j, score, least = _ranked(p, anchor, _fans(uv, v, h, cut_mesh))
    found: list[_Candidate] = []
    taken = np.zeros((0, 2), np.int64)
    kinds = np.zeros((0, 2))
    for a, b, *kind in zip(i.tolist(), j.tolist(), score.tolist(), least.tolist(), strict=True):
        if len(found) == TRIED or len(taken) == 4 * TRIED:
            break
        alike = (np.abs(kinds - kind) <= ALIKE).all(1)
        if alike.any() or (np.abs(taken - [a, b]).max(1, initial=0) <= 2).any():
            continue
        taken = np.vstack([taken, [a, b]])
        chart = int(loops.chart[loop])
        split = _cut_across(atlas, cut_mesh, chart, int(v[anchor[a]]), int(v[anchor[b]]))
        if split is not None and _allowed(split, cut_mesh.chart == chart, bound):
            found.append(_Candidate(kind[0], split))
            kinds = np.vstack([kinds, kind])
    return found


def _reflex(p: FloatArray) -> IntArray:
    """The corners (at most ANCHORS) of a boundary p (b, 2) that turn in most: where arms begin."""
    ahead, behind = np.roll(p, -1, axis=0) - p, p - np.roll(p, 1, axis=0)
    turn = np.arctan2(cross2(behind, ahead), (behind * ahead).sum(1))
    sharp = np.flatnonzero(turn < -REFLEX)
    return sharp[np.argsort(turn[sharp], kind="stable")[:ANCHORS]]


def _ranked(
    p: FloatArray, anchor: IntArray, fans: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Pairs of anchors i < j of a boundary p by what a cut there saves, and the area of the smaller part, both
    as shares of the area inside."""
    k = len(anchor)
    box, _ = extents(p, anchor)
    along = turned(p)
    total = float(fans.sum())
    inside = np.r_[0.0, np.cumsum(fans)][np.r_[anchor, len(p)]]
    i, j = np.triu_indices(k, 2)
    ends = p[anchor]
    first = inside[j] - inside[i] + cross2(ends[j], ends[i]) / 2
    second = total - first
    free = box[i, j - i - 1] + box[j, k - (j - i) - 1] - total
    saved = (float(boxes(along.min(0), along.max(0))) - total - free) / total
    chord = np.linalg.norm(ends[i] - ends[j], axis=1) / np.sqrt(total)
    score = saved - CHORD * chord
    least = np.minimum(first, second) / total
    ok = (least > LEAST) & (score > -SLACK)
    order = np.flatnonzero(ok)[np.argsort(-score[ok], kind="stable")]
    return i[order], j[order], score[order], least[order]


def _cut_across(atlas: Atlas, cut_mesh: CutMesh, chart: int, start: int, end: int) -> Atlas | None:
    """The atlas with the shortest path in a chart between two vertices of its boundary as a seam."""
    s = atlas.surface
    usable = ~atlas.cut & ~s.locked & (cut_mesh.chart[s.edges[:, 0] // 3] == chart)
    edge = np.flatnonzero(usable)
    flat = cut_mesh.faces.ravel()
    h = s.edges[edge, 0]
    a, b = flat[h], flat[next_half_edge(h)]
    way = cheapest_way(
        cut_mesh, edge, (a, b), s.edge_lengths[edge], np.array([start]), np.array([end])
    )
    if way is None:
        return None
    cut = atlas.cut.copy()
    cut[way] = True
    return Atlas(s, cut, atlas.corners)


def _allowed(atlas: Atlas, faces: BoolArray, bound: float) -> bool:
    """Whether these faces ((m,) bool, a chart before) are two disks now, neither above the bound."""
    after, uv = atlas.open()
    return two_disks(after, uv, np.unique(after.chart[faces]), bound)
