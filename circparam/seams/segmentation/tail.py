"""The tail of the distortion: what the mean over a chart hides, at finger tips, ears and dents.

Most of it needs no seam: with more weight in the energy on the few faces that are stretched or shrunk too
much, the others, of which there are a hundred times as many, give way by little. Where that is not enough, a
slit leads from the boundary towards the curvature that asks for it, and at last a chart is split.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_count, group_max, group_sum
from circparam.core.graph import nearest, undirected
from circparam.core.monitor import Monitor
from circparam.geometry.distortion import chart_distortion, face_stretch
from circparam.geometry.overlap import self_overlapping
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.seams.segmentation.enforce import enforce, lay_out_sound
from circparam.seams.segmentation.grow import dual_graph, make_disks, split_charts
from circparam.seams.segmentation.layout import judge
from circparam.seams.segmentation.slits import slit_to, smoothed_area_distortion
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.separate import push_apart
from circparam.solvers.untangle import cut_out

TAIL = 1e-3  # share of the surface on which the stretch may be larger
AIMED = 0.8  # of that share: what is aimed for, since a file stores rounded numbers
AIM = 0.9  # of the excess of the largest stretch over 1: from there on a face weighs more
POWER = 3  # of the stretch over that: by how much its weight grows a round
HEAVIEST = 1e3  # times its area: heavier faces tear at the others, and the layout folds
SPARED = 0.5  # of the share allowed: the worst faces, which are left as they are
ROUNDS = 8  # of weighing; most charts need three
PATIENCE = 3  # rounds without headway after which a chart is left
STEP = RelaxOptions(tolerance=1e-4, max_iterations=2)
SETTLED = RelaxOptions(tolerance=1e-4, max_iterations=30)
GAP = 0.0005  # share of the root of a chart's area by which parts that touched are pushed apart
SMALL = 2000  # faces up to which a chart moves as a whole
NEAR = 0.15  # share of the root of a chart's area that moves round such faces at first
GROWTH = 1.25  # times so much more a round
PEAK = 0.3  # logarithm of how much areas grow or shrink, below which a vertex is no peak of it
FACES_A_RING = (
    40  # the root of the faces of a chart over this: rings a peak is the highest of, beyond four
)
HOLE = 0.2  # length of a boundary over that of the longest of its chart, below which it is a small hole
TURNS = 8  # of slits and splits
PIECES = (2, 4)  # that charts are split in, one after the other where that is no use
REACH = 0.5  # share of the way to the curvature that a slit takes in one turn


@dataclass(frozen=True)
class Limits:
    """bound: distortion that no chart below it comes above. most: stretch that only the share ``allowed`` of
    the surface may exceed. spared: of that share, how much the worst faces may have that are left as they are.
    """

    bound: float
    most: float
    allowed: float = AIMED * TAIL
    spared: float = SPARED

    def without(self, over: float, whole: CutMesh, part: CutMesh) -> Limits:
        """For a part of the surface, where the other parts use so much of the share."""
        left = max(self.allowed - over, 0.0)
        return replace(self, allowed=left * float(whole.areas.sum() / part.areas.sum()))


def hold_stretch(
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
    for _ in range(TURNS if slits else 0):
        cut_mesh, uv = atlas.open()
        stretch = face_stretch(cut_mesh, uv)
        over = _share_over(cut_mesh, stretch, limits.most)
        if over.sum() <= limits.allowed or monitor.expired:
            return
        goal = _open_boundary(cut_mesh)
        far = stretch > limits.most
        helpless = float(cut_mesh.areas[far & (failed > 1)].sum() / cut_mesh.areas.sum())
        left = limits.allowed - helpless
        peaks = _peaks(cut_mesh, uv, far & (failed <= 1), goal, left)
        if len(peaks):
            failed += _slit(atlas, cut_mesh, peaks, goal, failed, limits, monitor)
        elif not splits or not any(
            _split(atlas, cut_mesh, over, pieces, limits, monitor) for pieces in PIECES
        ):
            return


def _share_over(cut_mesh: CutMesh, stretch: FloatArray, most: float) -> FloatArray:
    """(n,) area of each chart that is stretched more than ``most`` times, over that of the surface."""
    area = group_sum(cut_mesh.areas * (stretch > most), cut_mesh.chart, cut_mesh.n_charts)
    share: FloatArray = area / cut_mesh.areas.sum()
    return share


def _weighed(cut_mesh: CutMesh, uv: FloatArray, limits: Limits, monitor: Monitor) -> FloatArray:
    """The layout with a shorter tail, of as few charts as need it."""
    over = _share_over(cut_mesh, face_stretch(cut_mesh, uv), limits.most)
    if over.sum() <= limits.allowed:
        return uv
    # charts with hardly a tail keep it
    order = np.argsort(over, kind="stable")
    kept = np.cumsum(over[order]) <= limits.allowed / 2
    which = np.ones(cut_mesh.n_charts, bool)
    which[order[kept]] = False
    sub, vid, _ = cut_mesh.subset(which)
    rest = limits.without(over[~which].sum(), cut_mesh, sub)
    part, _ = even_out(sub, uv[vid], replace(rest, spared=0.0), monitor)
    left = _share_over(sub, face_stretch(sub, part), limits.most)
    if (
        left.sum() > rest.allowed
    ):  # some places are hopeless: without them the others may fare better
        other, _ = even_out(sub, uv[vid], rest, monitor)
        better = _share_over(sub, face_stretch(sub, other), limits.most) < left
        part = np.where(better[sub.vertex_chart][:, None], other, part)
    out = uv.copy()
    out[vid] = part
    return out


def even_out(
    cut_mesh: CutMesh, uv: FloatArray, limits: Limits, monitor: Monitor
) -> tuple[FloatArray, BoolArray]:
    """Relax charts with more weight, round by round, on faces that are stretched or shrunk about too much.

    Returns ((nv, 2) the best layout of each chart: neither folded, overlapping nor above the bound (or what it
    was before, where that is higher); (n,) bool: charts that got better).
    """
    n, chart, most = cut_mesh.n_charts, cut_mesh.chart, limits.most
    limit = np.maximum(chart_distortion(cut_mesh, uv), limits.bound)
    stretch = face_stretch(cut_mesh, uv)
    start = _share_over(cut_mesh, stretch, most)
    best, folded = _Best(uv, start), _Best(uv, start)
    at, weight = uv, np.ones(len(chart))
    idle = np.where(start > 0, 0, PATIENCE)
    small = np.bincount(chart, minlength=n) <= SMALL
    spared = _worst(cut_mesh, stretch, limits.spared * limits.allowed)
    for turn in range(ROUNDS):
        active = idle < PATIENCE
        if not active.any() or best.over.sum() <= limits.allowed or monitor.expired:
            break
        heavier = weight * np.maximum(stretch / (1 + AIM * (most - 1)), 1.0) ** POWER
        heavier[spared] = 1.0
        weight = np.where(active[chart], np.minimum(heavier, HEAVIEST), weight)
        reach = np.where(small, np.inf, NEAR * GROWTH**turn * np.sqrt(cut_mesh.chart_areas))
        at = _relaxed_near(cut_mesh, at, weight, np.where(active, reach, 0.0))
        stretch = face_stretch(cut_mesh, at)
        over = _share_over(cut_mesh, stretch, most)
        good = active & (over < best.over) & (chart_distortion(cut_mesh, at) <= limit)
        coiled = good & _overlapping(cut_mesh, at, good)
        best = best.taken(cut_mesh, at, over, good & ~coiled)
        # what lies on itself when it moves as a whole is tried again near those faces alone
        again = coiled & small
        folded = folded.taken(cut_mesh, at, over, good & ~again & (over < folded.over))
        idle = np.where(good & ~coiled | again, 0, idle + 1)
        idle[best.over == 0] = PATIENCE
        if again.any():
            at = np.where(again[cut_mesh.vertex_chart][:, None], best.uv, at)
            stretch = np.where(again[chart], face_stretch(cut_mesh, best.uv), stretch)
            weight = np.where(again[chart], 1.0, weight)
            small &= ~again
    coiled = folded.over < best.over
    if coiled.any() and best.over.sum() > limits.allowed:
        sub, vid, _ = cut_mesh.subset(coiled)
        at = folded.uv.copy()
        at[vid], apart = push_apart(sub, at[vid], GAP, limits.bound, monitor)
        over = _share_over(cut_mesh, face_stretch(cut_mesh, at), most)
        coiled[coiled] = apart
        best = best.taken(cut_mesh, at, over, coiled & (over < best.over))
    return best.uv, best.over < start


def _worst(cut_mesh: CutMesh, stretch: FloatArray, share: float) -> BoolArray:
    """(m,) bool: the faces that are stretched most, as many as such a share of the surface holds."""
    order = np.argsort(-stretch, kind="stable")
    out = np.zeros(len(stretch), bool)
    out[order] = np.cumsum(cut_mesh.areas[order]) <= share * cut_mesh.areas.sum()
    return out


@dataclass(frozen=True, eq=False)
class _Best:
    """The best layout of each chart so far: uv (nv, 2), over (n,) as ``_share_over`` has it."""

    uv: FloatArray
    over: FloatArray

    def taken(
        self, cut_mesh: CutMesh, uv: FloatArray, over: FloatArray, better: BoolArray
    ) -> _Best:
        """With another layout of some charts ((n,) bool)."""
        keep = better[cut_mesh.vertex_chart][:, None]
        return _Best(np.where(keep, uv, self.uv), np.where(better, over, self.over))


def _overlapping(cut_mesh: CutMesh, uv: FloatArray, which: BoolArray) -> BoolArray:
    """(n,) bool: the chart is one of those asked for and overlaps itself."""
    out = which.copy()
    if which.any():
        sub, vid, _ = cut_mesh.subset(which)
        out[which] = self_overlapping(sub, uv[vid])
    return out


def _relaxed_near(
    cut_mesh: CutMesh, uv: FloatArray, weight: FloatArray, reach: FloatArray
) -> FloatArray:
    """Relax the faces within reach ((n,) by charts) of those that weigh more than 1; the rest stays."""
    heavy = (weight > 1) & (reach > 0)[cut_mesh.chart]
    middle = np.c_[uv[cut_mesh.faces].mean(1), 4.0 * cut_mesh.chart * np.ptp(uv, axis=0).max()]
    far, _ = cKDTree(middle[heavy]).query(middle, distance_upper_bound=float(reach.max()))
    region = far < reach[cut_mesh.chart]
    hold = np.zeros(len(uv), bool)
    # one vertex of a chart that moves as a whole
    whole = group_count(cut_mesh.chart[~region], cut_mesh.n_charts) == 0
    first = np.unique(cut_mesh.chart, return_index=True)[1][whole]
    hold[cut_mesh.faces[first, 0]] = True
    still = hold.copy()
    still[cut_mesh.faces[~region]] = True
    region &= ~still[cut_mesh.faces].all(1)
    part, source, fixed = cut_out(cut_mesh, region, hold)
    if len(part.faces) == 0:
        return uv
    heavier = weight[region]
    mean = group_sum(part.areas * heavier, part.chart, part.n_charts) / part.chart_areas
    options = replace(STEP, fixed=fixed, weight=heavier / mean[part.chart])
    out = uv.copy()
    out[source[~fixed]] = relax(part, uv[source], options).uv[~fixed]
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
    after = atlas.cut_mesh()
    changed = np.zeros(after.n_charts, bool)
    changed[after.chart[faces]] = True
    sub, vid, fid = after.subset(changed)
    over = _share_over(cut_mesh, face_stretch(cut_mesh, atlas.gather(cut_mesh)), limits.most)
    limits = limits.without(over[~slit].sum(), cut_mesh, sub)
    uv, fine = even_out(sub, atlas.gather(after)[vid], limits, monitor)
    atlas.corners[fid] = uv[sub.faces]
    back = which[cut_mesh.chart] & ~faces
    back[fid] = ~fine[sub.chart]
    atlas.corners[back] = corners[back]
    inner = back[atlas.surface.edges // 3].all(1)
    atlas.cut[inner] = cut[inner]
    return back


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
    graph = dual_graph(part.surface, part.flat)
    inner, uv = part.open()
    laid = judge(inner, relax(inner, uv, SETTLED, monitor).uv)
    if not laid.bad(limits.bound).any():
        split_charts(part, graph, inner.chart, np.ones(inner.n_charts, bool), pieces)
        make_disks(part, graph)
        inner, uv = part.open()
        laid = judge(inner, lay_out_sound(inner, uv, SETTLED, monitor))
    enforce(part, graph, laid, limits.bound, SETTLED, monitor)
    after, uv = part.open()
    rest = limits.without(over[~long].sum(), cut_mesh, after)
    uv, _ = even_out(after, uv, rest, monitor)
    part.scatter(after, uv)
    left = _share_over(after, face_stretch(after, uv), limits.most).sum() * share[long].sum()
    if judge(after, uv).bad(limits.bound).any() or left >= over[long].sum():
        return False
    atlas.put(long[cut_mesh.chart], part)
    return True
