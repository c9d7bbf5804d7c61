"""The tail of the distortion: what the mean over a chart hides, at finger tips, ears and dents.

Most of it needs no seam: with more weight in the energy on the few faces that are stretched or shrunk too
much, the others, of which there are a hundred times as many, give way by little. Where that is not enough, a
slit leads from the boundary towards the curvature that asks for it; at last a chart is split.
"""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_max, group_sum
from circparam.core.graph import nearest, undirected
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, DeferredTask, in_parts
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.accuracy import FINAL
from circparam.seams.hard.unroll import slits
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.grow import dual_graph, make_disks, split_charts
from circparam.seams.segmentation.layout import judge, lay_out_sound
from circparam.seams.segmentation.slits import slit_to, smoothed_area_distortion
from circparam.seams.segmentation.weigh import Limits, relax_weighted, share_over
from circparam.solvers.newton import relax

PEAK = 0.3  # logarithm of how much areas grow or shrink, below which a vertex is no peak of it
# the root of the faces of a chart over this: rings a peak is the highest of, beyond four
FACES_A_RING = 40
HOLE = 0.2  # length of a boundary over that of the longest of its chart, below which it is a small hole
LOST = 3.0  # times the share that is allowed, from which on some places are given up at once
TURNS = 8  # of slits and splits
CUT_OFF = 0  # pieces: regions that are stretched are cut off along sharp edges
PIECES = (2, 4)  # that charts are split in, one after the other where that is no use
SPLITTING, FREE = 3, 100_000  # faces of all splits: times those of the surface, and so many more
STRETCHED = 0.1  # share of a smooth region, from which on it is cut off as a whole
REACH = 0.5  # share of the way to the curvature that a slit takes in one turn


def limit_stretch(
    atlas: Atlas, limits: Limits, monitor: Monitor, slits: bool = True, splits: bool = True
) -> None:
    """Bring the share of the surface that is stretched or shrunk too much below what is allowed.

    slits, splits: whether seams may be added where weights do not help, and charts be split where slits do not.
    No chart comes above the bound that was not; charts stay as they are where nothing helps. Deterministic.
    """
    cut_mesh, uv = atlas.open()
    atlas.scatter(cut_mesh, _weighed(cut_mesh, uv, limits, monitor))
    failed = np.zeros(
        len(atlas.surface.faces), np.int64
    )  # how often slits have not helped the chart
    work = FREE + SPLITTING * len(failed)
    for _ in range(TURNS if slits else 0):
        cut_mesh, uv = atlas.open()
        stretch = face_stretch(cut_mesh, uv)
        over = share_over(cut_mesh, stretch, limits.most)
        if over.sum() <= limits.enough or monitor.expired:
            return
        goal = _open_boundary(cut_mesh)
        far = stretch > limits.most
        helpless = float(cut_mesh.areas[far & (failed > 1)].sum() / cut_mesh.areas.sum())
        left = limits.allowed - helpless
        peaks = _peaks(cut_mesh, uv, far & (failed <= 1), goal, left)
        if len(peaks):
            failed += _slit(atlas, cut_mesh, peaks, goal, failed, limits, monitor)
            continue
        work -= int((over > 0)[cut_mesh.chart].sum())
        if not splits or work < 0:
            return
        # smooth regions of hard surfaces are cut off whole before charts are split
        if not any(
            _split(atlas, cut_mesh, over, pieces, limits, monitor) for pieces in (CUT_OFF, *PIECES)
        ):
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
    # with so much to hold some places are hopeless: without them the others fare better; and where a level was
    # held already, as many rounds without anything spared only come to the same
    part, left = uv[vid], np.full(sub.n_charts, np.inf)
    hopeless = over.sum() > LOST * limits.allowed or limits.local is not None
    aims = (rest,) if hopeless else (replace(rest, spared=0.0), rest)
    tries = [
        DeferredTask(monitor.jobs, relax_weighted, (sub, uv[vid], aim), monitor) for aim in aims
    ]
    large = len(sub.faces) >= PARTED and len(in_parts(sub.chart)) == 1
    if large and len(tries) > 1:
        tries[1].begin()  # one large chart keeps one process busy, and often both are needed
    for tried in tries:
        other, _ = tried.result()
        share = share_over(sub, face_stretch(sub, other), limits.most)
        part = np.where((share < left)[sub.vertex_chart][:, None], other, part)
        left = np.minimum(left, share)
        if left.sum() <= rest.allowed:
            break
    out = uv.copy()
    out[vid] = part
    return out


def _open_boundary(cut_mesh: CutMesh) -> BoolArray:
    """(nv,) bool: vertices of the boundaries that a slit may lead to: all but those of small holes."""
    loops = cut_mesh.loops
    longest = group_max(loops.length, loops.chart, cut_mesh.n_charts)
    large = loops.length >= HOLE * longest[loops.chart]
    out = np.zeros(cut_mesh.n_vertices, bool)
    out[cut_mesh.faces.ravel()[loops.half_edges[large[loops.loop_of]]]] = True
    return out


def _peaks(
    cut_mesh: CutMesh, uv: FloatArray, over: BoolArray, goal: BoolArray, allowed: float
) -> IntArray:
    """Vertices that slits should lead to: where the curvature lies that stretches faces too much.

    Each face that is stretched too much (over: (m,) bool) counts for the nearest local maximum of the smoothed
    distortion of area; those maxima that count least are left, as many as the share allowed holds. goal: (nv,)
    bool, where slits begin.
    """
    n, flat = cut_mesh.n_vertices, cut_mesh.faces.ravel()
    inside = np.zeros(cut_mesh.n_charts, bool)
    inside[cut_mesh.chart[over]] = True
    rings = 4 + int(np.sqrt(np.bincount(cut_mesh.chart).max()) / FACES_A_RING)
    field = smoothed_area_distortion(cut_mesh, uv, rings)
    a, b = flat, cut_mesh.faces[:, [1, 2, 0]].ravel()
    field[goal] = 0.0
    highest = field
    for _ in range(rings):
        highest = np.maximum(highest, group_max(highest[b], a, n))
        highest = np.maximum(highest, group_max(highest[a], b, n))
    top = (field >= highest) & (field >= PEAK) & ~goal & inside[cut_mesh.vertex_chart]
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
    goal: BoolArray,
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
    reach = np.where(again[cut_mesh.vertex_chart[peaks]], 1.0, REACH)
    slit = slit_to(atlas, cut_mesh, peaks, goal, reach)
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
    inner = back[atlas.surface.edges // 3].all(1)
    atlas.cut[inner] = cut[inner]
    return back


def _cut_off(atlas: Atlas, far: BoolArray) -> bool:
    """Cut smooth regions of a hard surface off that are stretched ((m,) bool: faces); whether there are any."""
    if atlas.prices is None:
        return False
    surface, sharp = atlas.surface, atlas.prices.sharp & ~atlas.surface.locked
    n, region = surface.charts(atlas.cut | sharp)
    over = group_sum(surface.areas * far, region, n) > STRETCHED * group_sum(
        surface.areas, region, n
    )
    sides = over[region[surface.edges // 3]]
    new = sharp & ~atlas.cut & (sides[:, 0] != sides[:, 1])
    atlas.cut |= new
    atlas.cut |= slits(atlas)
    return bool(new.any())


def _split(
    atlas: Atlas,
    cut_mesh: CutMesh,
    over: FloatArray,
    pieces: int,
    limits: Limits,
    monitor: Monitor,
) -> bool:
    """Split the charts whose tail is too long; whether that made it shorter (else all stays as it was).

    Charts that lie on themselves once they are relaxed to the end are cut there, where there are any; else all
    are split in so many pieces.
    """
    share = cut_mesh.chart_areas / cut_mesh.areas.sum()
    long = over > np.minimum(limits.allowed * share, over.max() / 2)
    part = atlas.part(long[cut_mesh.chart])
    if pieces == CUT_OFF and part.prices is None:
        return False
    graph = dual_graph(part.surface, part.flat)
    inner, uv = part.open()
    layouts = judge(inner, relax(inner, uv, FINAL, monitor).uv)
    if not layouts.bad(limits.bound).any():
        if pieces != CUT_OFF:
            split_charts(part, graph, inner.chart, np.ones(inner.n_charts, bool), pieces)
        elif not _cut_off(part, face_stretch(inner, uv) > limits.most):
            return False
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
