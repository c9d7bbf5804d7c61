"""Seams decided on one surface: regions grown, merged, shortened and merged again, from several starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.hidden import PricesBeside
from circparam.seams.multires.holes import complexity
from circparam.seams.segmentation.grow import (
    dual_graph,
    first_charts,
    make_disks,
    split_charts,
)
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.move import move_seams
from circparam.seams.segmentation.shorten import propose
from circparam.seams.segmentation.shorten_seams import shorten_seams
from circparam.seams.segmentation.state import arcs_of
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.objective import chart_energies
from circparam.solvers.tutte.embed import tutte_embedding

CUT_UP = 20  # faces: a surface with fewer for each hole and handle is cut up by them
SEEDS = (60, 12, 30, 100)  # regions that charts are grown from, start by start
START_FACES = (1 << 62, 6000, 1500, 1500)  # up to this size a start is made
TOGETHER = 1500  # faces up to which starts merge in one system: calls cost more there than faces do
SHORT_ARCS = 0.2  # radians; arcs end at such vertices when charts must merge whatever the cost
RISE = 1e-3  # share of the mean distortion that fewer charts and shorter seams may cost: nobody sees it
LONGER = 0.01  # share by which seams may be longer that part fewer charts
LAST_WORK = 1.0  # times the faces of the surface that unions for it may have together
BARREN = (
    20_000  # faces of trials, from which on a round without a union is the last for hard surfaces
)
LAST_FACES = 100_000  # larger unions than that are not tried for it
NEARLY_FLAT = 6.0  # energy of the map onto a circle, up to which a component may need no seam
NEAR_MISS = 1.3  # times the bound's excess over 1, up to which it may need no more than a slit
FEW_STEPS = 15  # that maps onto a circle need which are nearly flat: of ten meshes 11 at most
CHART_COST = 0.25  # of a chart, in units of seam length, when starts are compared
ANY_BOUND = 1e6  # a distortion that no chart has: what is held to it only may not overlap
# share by which a start costs more when it has merged, from which it is given up: of 15 meshes none of them won
BEHIND = 0.1
ROUGH = RelaxOptions(tolerance=1e-3, max_iterations=25, bound=1.01)
HASTY = RelaxOptions(tolerance=1e-3, max_iterations=6, bound=1.01)
FAIR = RelaxOptions(tolerance=1e-4, max_iterations=30)
LOOPS = 300  # handles and holes above which the regions that charts are grown from hardly matter
CROWD = 300  # more first charts than that are a soup of faces: those that are bad are split in four, not in two


def decide(
    surface: Surface,
    bound: float,
    margin: float,
    max_charts: int | None,
    worker: Worker,
    monitor: Monitor,
    together: bool = True,
    prices: PricesBeside | None = None,
) -> Atlas:
    """Decide seams on the surface itself: components that are good charts as they are stay whole.

    together: see ``best_of_starts``. prices: of the edges of the surface, where it has none yet.
    """
    atlas = Atlas(replace(surface, price=None), np.zeros(len(surface.edges), bool))
    rest = ~whole_components(atlas, bound)
    if rest.any():
        part = surface.part(rest)
        # charts are decided by length alone: prices would be luck for good or bad, at the cost of charts
        begin = None if prices is None else prices.begin
        plain = replace(part, price=None)
        best = best_of_starts(plain, bound, margin, worker, monitor, together, begin)
        if prices is not None:
            part = replace(surface, price=prices.result()).part(rest)
        if part.price is not None:
            best = Atlas(part, best.cut, best.corners)
            move_seams(best, bound, margin, monitor)
        atlas.put(rest, best)
    if max_charts is not None:
        reach_count(atlas, bound, max_charts, monitor)
    return atlas


def whole_components(atlas: Atlas, bound: float) -> BoolArray:
    """(m,) bool: faces of components that are good charts without a seam. They are laid out."""
    cut_mesh = atlas.cut_mesh()
    able = ~not_disks(cut_mesh)
    if able.any():
        layouts = lay_out_fresh(atlas, able, replace(ROUGH, give_up=bound))
        able &= ~layouts.bad(bound)
    return able[cut_mesh.chart]


def nearly_flat_components(atlas: Atlas, bound: float) -> BoolArray:
    """(m,) bool: faces of components whose map onto a circle says that they need hardly a seam; laid out.

    They are below the bound, or so little above it that a slit from the boundary may do.
    """
    cut_mesh = atlas.cut_mesh()
    able = ~not_disks(cut_mesh)
    if able.any():
        sub, _, _ = cut_mesh.subset(able)
        able[able] = chart_energies(sub, tutte_embedding(sub, "mean-value")[0]) <= NEARLY_FLAT
    if able.any():
        # where half of the faces are needles, Newton's model gives up what converges in some more steps
        layouts = lay_out_fresh(atlas, able, replace(ROUGH, max_iterations=FEW_STEPS))
        able &= ~layouts.bad(1 + NEAR_MISS * (bound - 1))
    return able[cut_mesh.chart]


def best_of_starts(
    surface: Surface,
    bound: float,
    margin: float,
    worker: Worker,
    monitor: Monitor,
    together: bool = True,
    begin: Callable[[], None] | None = None,
) -> Atlas:
    """Grow, merge and shorten charts: the best of a few starts where that is cheap.

    Starts that are clearly behind when they have merged are not gone on with. together: whether starts merge
    in one system, which takes a third less work, or one in a process, which takes a third less time. begin:
    called when what is left keeps one process busy, hardly more.
    """
    begin = begin or _nothing
    seeds = [k for k, most in zip(SEEDS, START_FACES, strict=True) if len(surface.faces) <= most]
    # so many holes and handles cut the surface up that regions hardly matter
    if complexity(surface) > min(LOOPS, len(surface.faces) / CUT_UP):
        seeds = seeds[:1]
    if len(seeds) == 1:
        start = grow_and_merge(surface, bound, margin, seeds[0], worker, monitor)
        begin()
        return shortened(start, bound, margin, monitor)
    if together or len(surface.faces) <= TOGETHER:
        starts = merged_together(surface, bound, margin, seeds, monitor)
    else:
        tasks = [(surface, bound, margin, k, k == seeds[0]) for k in seeds]
        starts = [s for s in worker.map(start_once, tasks, monitor) if s]
    begin()
    cost = np.array([_cost(s.merger.atlas) for s in starts])
    near = np.flatnonzero(cost <= (1 + BEHIND) * cost.min())
    if monitor.expired:
        near = np.array([int(cost.argmin())])
    done = worker.map(shorten_once, [(starts[k], bound, margin) for k in near], monitor)
    ends = [Atlas(surface, *one) for one in done]
    return ends[int(np.argmin([_cost(end) for end in ends]))]


def _nothing() -> None:
    pass


def _cost(atlas: Atlas) -> float:
    """What starts are compared by."""
    return atlas.seam_length + CHART_COST * atlas.charts()[0]


@dataclass(frozen=True, eq=False)
class Start:
    """Charts that have merged, and what the merging has learnt. crowd: they came from very many."""

    merger: Merger
    crowd: bool


def start_once(
    surface: Surface, bound: float, margin: float, seeds: int, needed: bool, monitor: Monitor
) -> Start | None:
    """One start; None where it is not needed and there is no time for it."""
    if monitor.expired and not needed:
        return None
    return grow_and_merge(surface, bound, margin, seeds, None, monitor)


def shorten_once(
    start: Start, bound: float, margin: float, monitor: Monitor
) -> tuple[BoolArray, FloatArray]:
    """(cut, corners) of a start when its seams are short."""
    atlas = shortened(start, bound, margin, monitor)
    return atlas.cut, atlas.corners


def grow_and_merge(
    surface: Surface,
    bound: float,
    margin: float,
    seeds: int,
    worker: Worker | None,
    monitor: Monitor,
) -> Start:
    """Grow charts round so many seeds, split what is bad, merge.

    worker: lays half of the charts out where there is nothing better for it to do.
    """
    atlas, crowd = _grown(surface, bound, seeds, worker, monitor)
    fixed = np.zeros(len(atlas.cut), bool)
    merger = Merger(atlas, MergeOptions(bound, margin=margin), fixed, worker)
    merger.run(monitor)
    return Start(merger, crowd)


def merged_together(
    surface: Surface, bound: float, margin: float, seeds: list[int], monitor: Monitor
) -> list[Start]:
    """The starts from so many seeds each, merged side by side: on small surfaces calls are what trials cost."""
    grown: list[tuple[Atlas, bool]] = []
    for k in seeds:
        if not (monitor.expired and grown):
            grown.append(_grown(surface, bound, k, None, monitor))
    cut = np.concatenate([atlas.cut for atlas, _ in grown])
    corners = np.concatenate([atlas.corners for atlas, _ in grown])
    all_of_them = Atlas(surface.copies(len(grown)), cut, corners)
    options = MergeOptions(bound, margin=margin)
    merger = Merger(all_of_them, options, np.zeros(len(cut), bool))
    merger.run(monitor)
    starts = []
    e, m = len(surface.edges), len(surface.faces)
    for k, (_, crowd) in enumerate(grown):
        mine = slice(k * e, (k + 1) * e)
        one = Atlas(surface, merger.atlas.cut[mine], merger.atlas.corners[k * m : (k + 1) * m])
        of_one = Merger(one, options, np.zeros(e, bool))
        of_one.lower_bound, of_one.overlapped = (
            merger.lower_bound[mine],
            merger.overlapped[:, mine].copy(),
        )
        starts.append(Start(of_one, crowd))
    return starts


def _grown(
    surface: Surface, bound: float, seeds: int, worker: Worker | None, monitor: Monitor
) -> tuple[Atlas, bool]:
    """(charts grown round so many seeds and split until they are good, whether they are a crowd)."""
    graph = dual_graph(surface)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    first_charts(atlas, graph, seeds)
    make_disks(atlas, graph)
    proposal = propose(atlas, 2)
    atlas.cut = proposal.cut(np.ones(proposal.n, bool))
    make_disks(atlas, graph)
    crowd = atlas.charts()[0] > CROWD
    layouts = lay_out_fresh(atlas, None, HASTY if crowd else ROUGH, worker, monitor)
    for _ in range(12):
        bad = layouts.bad(bound) & (np.bincount(layouts.cut_mesh.chart) > 1)
        if not bad.any():
            break
        was = bad[layouts.cut_mesh.chart]
        split_charts(atlas, graph, layouts.cut_mesh.chart, bad, 4 if bad.sum() > CROWD else 2)
        make_disks(atlas, graph)
        n, chart = atlas.charts()
        again = np.zeros(n, bool)
        again[chart[was]] = True
        steps = HASTY if bad.sum() > CROWD else ROUGH
        layouts = lay_out_fresh(atlas, again, steps, worker, monitor)
    return atlas, crowd


def shortened(start: Start, bound: float, margin: float, monitor: Monitor) -> Atlas:
    """Shorten the seams, merge again, and shorten once more where that changed anything."""
    merger, atlas = start.merger, start.merger.atlas
    _, before = atlas.charts()
    arcs, was = arcs_of(atlas, before), atlas.cut.copy()
    steps = HASTY if start.crowd else FAIR
    shorten_seams(atlas, bound, steps, 3, margin=margin)
    merger.seams_moved(before, arcs)
    merger.run(monitor)
    if (atlas.cut != was).any():
        shorten_seams(atlas, bound, steps, 1, margin=margin)
    return atlas


def merge_on(
    atlas: Atlas, bound: float, margin: float, monitor: Monitor, rise: float = RISE
) -> None:
    """Merge charts of a finished atlas that can be had as one at the same distortion.

    Arcs end at smaller curvature than they did and parts may come nearer to each other, so that unions turn out
    fine that were refused when charts were decided. Whatever is kept has fewer charts, shorter seams, and
    the same mean distortion but for ``rise``, a share of it: it is better in every respect.
    """
    n, _ = atlas.charts()
    pieces, _ = atlas.surface.components
    if not pieces < n <= CROWD or monitor.expired:
        return
    options = MergeOptions(
        bound,
        margin=margin,
        cone=SHORT_ARCS,
        zip=False,
        faces=LAST_FACES,
        work=LAST_WORK,
        rise=rise,
    )
    merger = Merger(atlas, options, np.zeros(len(atlas.cut), bool), Worker(monitor.jobs))
    if atlas.prices is None:
        merger.run(monitor)
        return
    # charts of hard surfaces were tried with all arcs at once too: where a round finds nothing, hardly one does
    while merger.work <= merger.limit and not monitor.expired:
        merged = merger.tally["merged"]
        going = merger.round(monitor)
        if not going or (merger.tally["merged"] == merged and merger.work > BARREN):
            break


def merged_on(coarse: Atlas, bound: float, monitor: Monitor) -> Atlas:
    """The atlas of a proxy merged on, as far as that may turn out well on the mesh.

    First at the distortion that its charts have when they are relaxed, which costs nothing; then at the one
    they had. Else what relaxing saves pays for long arcs between charts that do not fit, and the mesh refuses
    them all together: of a camel's head three charts became one so, where they can be one at no cost.
    """
    pieces, _ = coarse.surface.components
    if coarse.charts()[0] <= pieces:
        return coarse
    out = Atlas(coarse.surface, coarse.cut, coarse.corners)
    cut_mesh, uv = out.open()
    relaxed = judge(cut_mesh, relax(cut_mesh, uv, FAIR).uv)
    fine = ~relaxed.bad(bound)
    at = np.where(fine[cut_mesh.vertex_chart][:, None], relaxed.uv, uv)
    out.scatter(cut_mesh, at)
    merge_on(out, bound, 0.0, monitor)
    had = float(chart_energies(cut_mesh, uv) @ cut_mesh.chart_areas)
    after, now = out.open()
    left = (1 + RISE) * had / float(chart_energies(after, now) @ after.chart_areas) - 1
    if left > RISE:
        merge_on(out, bound, 0.0, monitor, left)
    return out


def reach_count(atlas: Atlas, bound: float, count: int, monitor: Monitor) -> None:
    """Merge on with a rising bound until there are at most ``count`` charts, or nothing merges any more."""
    fixed = np.zeros(len(atlas.cut), bool)
    pieces, _ = atlas.surface.components
    for _ in range(24):
        n, _ = atlas.charts()
        if n <= max(count, pieces):
            break
        bound = 1 + max(bound - 1, 1e-3) * 1.6
        merger = Merger(atlas, MergeOptions(bound, margin=0.0, cone=SHORT_ARCS, zip=False), fixed)
        while not monitor.expired and atlas.charts()[0] > count and merger.round(monitor):
            pass


def better_in_all(atlas: Atlas, other: Atlas) -> bool:
    """Whether an atlas has fewer charts than another, seams hardly longer, and as little distortion."""
    if atlas is other or atlas.charts()[0] >= other.charts()[0]:
        return False
    (first, at), (second, there) = atlas.open(), other.open()
    mine, theirs = (
        chart_energies(first, at) @ first.chart_areas,
        chart_energies(second, there) @ second.chart_areas,
    )
    return bool(
        atlas.seam_length <= (1 + LONGER) * other.seam_length and mine <= (1 + RISE) * theirs
    )


def worth(atlas: Atlas, most: int, bound: float) -> tuple[int, int, float, float]:
    """What counts where so many charts are wanted, the least first: charts that lie on themselves, which would
    be split, charts beyond that number, distortion, seam length."""
    cut_mesh = atlas.cut_mesh()
    layouts = judge(cut_mesh, atlas.gather(cut_mesh))
    over = float(np.average(layouts.energy, weights=cut_mesh.chart_areas))
    faulty = int(layouts.bad(ANY_BOUND).sum())
    return faulty, max(cut_mesh.n_charts, most), max(over, bound), atlas.seam_length
