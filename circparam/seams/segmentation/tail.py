"""The tail of the distortion: what the mean over a chart hides, at finger tips, ears and dents.

Most of it needs no seam: with more weight in the energy on the few faces that are stretched or shrunk too
much, the others, of which there are a hundred times as many, give way by little. Where that is not enough,
charts are split, and tips are cut off where no split helps. A draft only cuts tips off, unless a user asked
for the stretch.
"""

import numpy as np

from circparam.core.arrays import group_sum, mask_of
from circparam.core.graph import components, severed
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.distortion import chart_distortion, face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.accuracy import FINAL
from circparam.seams.cost import COST
from circparam.seams.evaluate import MARGIN
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.grow import DualGraph, make_disks, split_charts
from circparam.seams.segmentation.layout import judge, lay_out_sound
from circparam.seams.segmentation.weigh import (
    ROUNDS,
    Limits,
    relax_weighted,
    share_over,
    with_tails,
)
from circparam.solvers.newton import relax

# Times its weight in the cost that a tail counts for which no user asked, since the tool promises its length: a
# chart more has to take a ten-thousandth of the surface from it. Without a limit a rough scan of 330,000 faces
# got 1,694 charts for half a thousandth.
PROMISE_WEIGHT = 25.0


def limit_stretch(atlas: Atlas, limits: Limits, monitor: Monitor, seams: bool = True) -> None:
    """Bring the share of the surface that is stretched or shrunk too much below what is allowed.

    seams: whether seams may be added where weights do not help. No chart comes above the bound that was not;
    charts stay as they are where nothing helps. Deterministic.
    """
    cut_mesh, uv = atlas.open()
    atlas.scatter(cut_mesh, _weighed(cut_mesh, uv, limits, monitor))
    if seams and limits.cuts_off:
        _cut_off(atlas, limits, monitor)
    splits = seams and (limits.asked or not limits.cuts_off)
    last = np.inf  # share that is stretched too much where tips were cut off
    # as many rounds in which tips are cut off as of splits
    for _ in range(2 * ROUNDS if splits else 0):
        cut_mesh, uv = atlas.open()
        over = share_over(cut_mesh, face_stretch(cut_mesh, uv), limits.most)
        if over.sum() <= limits.enough or monitor.expired:
            return
        if _split(atlas, cut_mesh, over, limits, monitor):
            continue
        if over.sum() >= last:
            return
        last = over.sum()
        _cut_off(atlas, limits, monitor)


def _weighed(cut_mesh: CutMesh, uv: FloatArray, limits: Limits, monitor: Monitor) -> FloatArray:
    """The layout with a shorter tail, of as few charts as need it."""
    over = share_over(cut_mesh, face_stretch(cut_mesh, uv), limits.most)
    if over.sum() <= limits.allowed:
        return uv
    which = with_tails(over, limits)
    sub, vid, _ = cut_mesh.subset(which)
    rest = limits.without(over[~which].sum(), cut_mesh, sub)
    out = uv.copy()
    out[vid], _ = relax_weighted(sub, uv[vid], rest, monitor)
    return out


def _cut_off(atlas: Atlas, limits: Limits, monitor: Monitor) -> None:
    """Cut off the parts that are stretched too much and lay them out alone; all else stays as it lies.

    A layout stays sound when a part of it goes, so the work is proportional to what is cut off. Distortion is a
    mean over a chart: where a flat goes with a tip, what is left of its chart may come above the bound. It is
    laid out anew, too.
    """
    surface, flat = atlas.surface, atlas.flat
    together = surface.locked if flat is None else surface.locked | flat
    _, cell = components(len(surface.faces), *surface.sides[:, together])
    for _ in range(ROUNDS):
        cut_mesh, uv = atlas.open()
        inside = _stretched_parts(cut_mesh, face_stretch(cut_mesh, uv), cell, limits, surface.unit)
        left, right = inside[surface.sides]
        around = (left != right) & ~atlas.cut
        if not around.any() or monitor.expired:
            return
        before = chart_distortion(cut_mesh, uv)[cut_mesh.chart]
        atlas.cut |= around
        opened, uv = atlas.open()
        inside |= chart_distortion(opened, uv)[opened.chart] > np.maximum(before, limits.bound)
        part = atlas.part(inside)
        inner, uv = part.open()
        layouts = judge(inner, lay_out_sound(inner, uv, FINAL, monitor))
        enforce(part, layouts, limits.bound, FINAL, monitor)
        merge(part, MergeOptions(limits.bound, MARGIN / 2), monitor)
        atlas.put(inside, part)


def _stretched_parts(
    cut_mesh: CutMesh, stretch: FloatArray, cell: IntArray, limits: Limits, unit: float
) -> BoolArray:
    """(m,) bool: faces of the parts with most of the tail, as few parts as leave no more than is allowed.

    A part is what hangs together above the root of the largest stretch: a tip with what leads to it, and whole
    cells ((m,) of each face). It has to be worth its boundary, unless a user asked. Pieces of a chart that are
    left apart from its largest one go with it. unit: root of the area of the whole surface.
    """
    far, over = stretch > np.sqrt(limits.most), cut_mesh.areas * (stretch > limits.most)
    whole = cut_mesh.areas.sum()
    if over.sum() <= limits.enough * whole:
        return np.zeros(len(far), bool)
    left, right = cut_mesh.edges.T // 3
    joined = far[left] & far[right]
    n, part = components(len(far), left[joined], right[joined])
    share = group_sum(over, part, n) / whole
    order = np.argsort(share, kind="stable")
    gone = mask_of(n, order[np.cumsum(share[order]) > limits.allowed])
    if not limits.asked:
        rim = part[left] != part[right]
        length = np.tile(cut_mesh.lengths(cut_mesh.edges[rim, 0]), 2)
        around = group_sum(length, np.r_[part[left[rim]], part[right[rim]]], n)
        gone &= _pays(share * whole, around, 1, unit)
    inside = np.bincount(cell, gone[part])[cell] > 0
    return inside | severed(~inside, left, right, cut_mesh.areas, cut_mesh.chart)


def _pays(
    tail: FloatArray | float, length: FloatArray | float, charts: int, unit: float
) -> BoolArray | bool:
    """Whether a tail that is smaller by some area is worth seams of that length and so many charts more.

    unit: root of the area of the whole surface.
    """
    return COST.chart * charts + length / unit < PROMISE_WEIGHT * COST.tail * tail / unit**2


def _split(
    atlas: Atlas,
    cut_mesh: CutMesh,
    over: FloatArray,
    limits: Limits,
    monitor: Monitor,
) -> bool:
    """Split the charts whose tail is too long; whether that made it shorter (else all stays as it was).

    Charts that lie on themselves once they are relaxed to the end are cut there, where there are any; else all
    are halved.
    """
    whole, unit = cut_mesh.areas.sum(), atlas.surface.unit
    share = cut_mesh.chart_areas / whole
    long = over > np.minimum(limits.allowed * share, over.max() / 2)
    if not limits.asked:  # a chart that would not pay for one more is not worth the work
        long &= _pays(over * whole, 0.0, 1, unit)
        if not long.any():
            return False
    part = atlas.part(long[cut_mesh.chart])
    seams, count = part.surface.edge_lengths[part.cut].sum(), part.charts()[0]

    def pays(charts: int) -> BoolArray | bool:
        # all that is too long counts: the first of several halvings may shorten little
        length = part.surface.edge_lengths[part.cut].sum() - seams
        return limits.asked or _pays(over[long].sum() * whole, length, charts - count, unit)

    inner, uv = part.open()
    layouts = judge(inner, relax(inner, uv, FINAL, monitor).uv)
    if not layouts.bad(limits.bound).any():
        graph = DualGraph(part.surface, part.flat)
        split_charts(part, graph, inner.chart, np.ones(inner.n_charts, bool))
        make_disks(part, graph)
        inner, uv = part.open()
        layouts = judge(inner, lay_out_sound(inner, uv, FINAL, monitor))
    # what is bad needs a cut more
    if not pays(inner.n_charts + int(layouts.bad(limits.bound).sum())):
        return False
    enforce(part, layouts, limits.bound, FINAL, monitor)
    after, uv = part.open()
    if not pays(after.n_charts):
        return False
    rest = limits.without(over[~long].sum(), cut_mesh, after)
    uv, _ = relax_weighted(after, uv, rest, monitor)
    part.scatter(after, uv)
    left = share_over(after, face_stretch(after, uv), limits.most).sum() * share[long].sum()
    if judge(after, uv).bad(limits.bound).any() or left >= over[long].sum():
        return False
    atlas.put(long[cut_mesh.chart], part)
    return True
