"""The tail of the distortion: what the mean over a chart hides, at finger tips, ears and dents.

Most of it needs no seam: with more weight in the energy on the few faces that are stretched or shrunk too
much, the others, of which there are a hundred times as many, give way by little. Where that is not enough, a
slit leads from the boundary towards the curvature that asks for it; at last a chart is split. A draft does not
look for slits: it cuts the tips off, and splits what is left. Where a user asked for the stretch, tips are cut
off too if nothing else helps.
"""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_max, group_sum
from circparam.core.graph import components, nearest, undirected
from circparam.core.monitor import Monitor
from circparam.geometry.distortion import chart_distortion, face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.accuracy import FINAL
from circparam.seams.evaluate import MARGIN
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.grow import dual_graph, make_disks, split_charts
from circparam.seams.segmentation.layout import judge, lay_out_sound
from circparam.seams.segmentation.slits import (
    SMOOTHING_RINGS,
    boundary_vertices,
    slit_to,
    smoothed_area_distortion,
)
from circparam.seams.segmentation.weigh import ROUNDS, Limits, relax_weighted, share_over
from circparam.solvers.newton import relax

FIRST_REACH = 0.5  # share of the way to the curvature that a slit takes in one turn


def limit_stretch(
    atlas: Atlas, limits: Limits, monitor: Monitor, slits: bool = True, splits: bool = True
) -> None:
    """Bring the share of the surface that is stretched or shrunk too much below what is allowed.

    slits, splits: whether seams may be added where weights do not help, and charts be split where slits do not.
    No chart comes above the bound that was not; charts stay as they are where nothing helps. Deterministic.
    """
    cut_mesh, uv = atlas.open()
    atlas.scatter(cut_mesh, _weighed(cut_mesh, uv, limits, monitor))
    # how often slits have not helped the chart of each face; where tips were cut off there is nothing to slit
    failed = np.zeros(len(atlas.surface.faces), np.int64)
    last = np.inf  # share that is stretched too much where tips were cut off
    if slits and limits.cuts_off:
        _cut_off(atlas, limits, monitor)
        failed += 2
    # as many rounds of slits, each of which may fail, as of splits
    for _ in range(2 * ROUNDS if slits else 0):
        cut_mesh, uv = atlas.open()
        stretch = face_stretch(cut_mesh, uv)
        over = share_over(cut_mesh, stretch, limits.most)
        if over.sum() <= limits.enough or monitor.expired:
            return
        far = stretch > limits.most
        helpless = float(cut_mesh.areas[far & (failed > 1)].sum() / cut_mesh.areas.sum())
        left = limits.allowed - helpless
        peaks = _peaks(cut_mesh, uv, far & (failed <= 1), left)
        if len(peaks):
            failed += _slit(atlas, cut_mesh, peaks, failed, limits, monitor)
        elif splits and _split(atlas, cut_mesh, over, limits, monitor):
            continue
        elif limits.asked and splits and over.sum() < last:
            last = over.sum()
            _cut_off(atlas, limits, monitor)
        else:
            return


def _weighed(cut_mesh: CutMesh, uv: FloatArray, limits: Limits, monitor: Monitor) -> FloatArray:
    """The layout with a shorter tail, of as few charts as need it."""
    over = share_over(cut_mesh, face_stretch(cut_mesh, uv), limits.most)
    if over.sum() <= limits.allowed:
        return uv
    # charts with hardly a tail keep it
    order = np.argsort(over, kind="stable")
    kept = np.cumsum(over[order]) <= limits.allowed / 2
    which = np.ones(cut_mesh.n_charts, bool)
    which[order[kept]] = False
    sub, vid, _ = cut_mesh.subset(which)
    rest = limits.without(over[~which].sum(), cut_mesh, sub)
    out = uv.copy()
    out[vid], _ = relax_weighted(sub, uv[vid], rest, monitor)
    return out


def _peaks(cut_mesh: CutMesh, uv: FloatArray, over: BoolArray, allowed: float) -> IntArray:
    """Vertices that slits should lead to: where the curvature lies that stretches faces too much.

    Each face that is stretched too much (over: (m,) bool) counts for the nearest local maximum of the smoothed
    distortion of area; those maxima that count least are left, as many as the share allowed holds.
    """
    n, flat = cut_mesh.n_vertices, cut_mesh.faces.ravel()
    inside = np.zeros(cut_mesh.n_charts, bool)
    inside[cut_mesh.chart[over]] = True
    field = smoothed_area_distortion(cut_mesh, uv)
    a, b = flat, cut_mesh.faces[:, [1, 2, 0]].ravel()
    field[boundary_vertices(cut_mesh)] = 0.0
    highest = field
    for _ in range(SMOOTHING_RINGS):
        highest = np.maximum(highest, group_max(highest[b], a, n))
        highest = np.maximum(highest, group_max(highest[a], b, n))
    top = (field >= highest) & (field > 0) & inside[cut_mesh.vertex_chart]
    peaks = np.flatnonzero(top)
    if len(peaks) == 0:
        return peaks
    links = undirected(n, a, b, cut_mesh.edge_lengths.ravel())
    distance, _, source = nearest(links, peaks)
    corner = cut_mesh.faces[over]
    first = corner[np.arange(len(corner)), distance[corner].argmin(1)]
    of = source[first]
    found = of >= 0
    gain = group_sum(cut_mesh.areas[over][found], of[found], n) / cut_mesh.areas.sum()
    peaks = np.flatnonzero(gain > 0)
    order = peaks[np.argsort(gain[peaks], kind="stable")]
    chosen: IntArray = order[np.cumsum(gain[order]) > allowed]
    return chosen


def _slit(
    atlas: Atlas,
    cut_mesh: CutMesh,
    peaks: IntArray,
    failed: IntArray,
    limits: Limits,
    monitor: Monitor,
) -> BoolArray:
    """Slit charts towards peaks and lay them out again; (m,) bool: faces of charts that stay as they were.

    failed: (m,) how often that was so before. The first slits lead half of the way, then they lead all of it.
    """
    cut, corners = atlas.cut.copy(), atlas.corners.copy()
    which = np.zeros(cut_mesh.n_charts, bool)
    which[cut_mesh.vertex_chart[peaks]] = True
    again = group_max(failed.astype(float), cut_mesh.chart, cut_mesh.n_charts) > 0
    reach = np.where(again[cut_mesh.vertex_chart[peaks]], 1.0, FIRST_REACH)
    slit = slit_to(atlas, cut_mesh, peaks, reach)
    faces = slit[cut_mesh.chart]
    if not slit.any():  # no way leads there
        return which[cut_mesh.chart]
    after = atlas.cut_mesh()
    changed = np.zeros(after.n_charts, bool)
    changed[after.chart[faces]] = True
    sub, vid, fid = after.subset(changed)
    over = share_over(cut_mesh, face_stretch(cut_mesh, atlas.gather(cut_mesh)), limits.most)
    limits = limits.without(over[~slit].sum(), cut_mesh, sub)
    uv, fine = relax_weighted(sub, atlas.gather(after)[vid], limits, monitor)
    atlas.corners[fid] = uv[sub.faces]
    back = which[cut_mesh.chart] & ~faces
    back[fid] = ~fine[sub.chart]
    atlas.corners[back] = corners[back]
    inner = atlas.surface.inner_edges(back)
    atlas.cut[inner] = cut[inner]
    return back


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
        inside = _stretched_parts(cut_mesh, face_stretch(cut_mesh, uv), cell, limits)
        left, right = inside[surface.sides]
        around = (left != right) & ~atlas.cut
        if not around.any() or monitor.expired:
            return
        before = chart_distortion(cut_mesh, uv)[cut_mesh.chart]
        atlas.cut |= around
        opened, uv = atlas.open()
        inside |= chart_distortion(opened, uv)[opened.chart] > np.maximum(before, limits.bound)
        part = atlas.part(inside)
        graph = dual_graph(part.surface, part.flat)
        inner, uv = part.open()
        layouts = judge(inner, lay_out_sound(inner, uv, FINAL, monitor))
        enforce(part, graph, layouts, limits.bound, FINAL, monitor)
        merge(part, MergeOptions(limits.bound, MARGIN / 2), monitor)
        atlas.put(inside, part)


def _stretched_parts(
    cut_mesh: CutMesh, stretch: FloatArray, cell: IntArray, limits: Limits
) -> BoolArray:
    """(m,) bool: faces of the parts with most of the tail, as few parts as leave no more than is allowed.

    A part is what hangs together above the root of the largest stretch: a tip with what leads to it, and whole
    cells ((m,) of each face). Pieces of a chart that are left apart from its largest one go with it.
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
    gone = np.zeros(n, bool)
    gone[order[np.cumsum(share[order]) > limits.allowed]] = True
    inside = np.bincount(cell, gone[part])[cell] > 0
    joined = inside[left] == inside[right]
    n, piece = components(len(far), left[joined], right[joined])
    rest = group_sum(cut_mesh.areas * ~inside, piece, n)[piece]
    largest = group_max(rest, cut_mesh.chart, cut_mesh.n_charts)[cut_mesh.chart]
    result: BoolArray = inside | (rest < largest)
    return result


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
    share = cut_mesh.chart_areas / cut_mesh.areas.sum()
    long = over > np.minimum(limits.allowed * share, over.max() / 2)
    part = atlas.part(long[cut_mesh.chart])
    graph = dual_graph(part.surface, part.flat)
    inner, uv = part.open()
    layouts = judge(inner, relax(inner, uv, FINAL, monitor).uv)
    if not layouts.bad(limits.bound).any():
        split_charts(part, graph, inner.chart, np.ones(inner.n_charts, bool))
        make_disks(part, graph)
        inner, uv = part.open()
        layouts = judge(inner, lay_out_sound(inner, uv, FINAL, monitor))
    enforce(part, graph, layouts, limits.bound, FINAL, monitor)
    after, uv = part.open()
    rest = limits.without(over[~long].sum(), cut_mesh, after)
    uv, _ = relax_weighted(after, uv, rest, monitor)
    part.scatter(after, uv)
    left = share_over(after, face_stretch(after, uv), limits.most).sum() * share[long].sum()
    if judge(after, uv).bad(limits.bound).any() or left >= over[long].sum():
        return False
    atlas.put(long[cut_mesh.chart], part)
    return True
