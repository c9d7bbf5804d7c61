"""Few charts under a distortion bound: grow, merge, shorten, on a coarse proxy where the mesh is large."""

from __future__ import annotations

import dataclasses

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import HALVED, Worker, in_halves
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.constraints import constrain
from circparam.seams.hard.charts import hard_atlas, take_better
from circparam.seams.hard.regions import DOUBTFUL, HARD, hardness, seam_prices
from circparam.seams.multires.decimate import SMALL_COMPONENT, Proxy, decimate
from circparam.seams.multires.holes import close_small_holes, complexity, without_fans
from circparam.seams.multires.transfer_layout import (
    drop_slivers,
    fine_targets,
    nearest_coarse_face,
    separate,
)
from circparam.seams.multires.transfer_seams import transfer_seams
from circparam.seams.options import SeamOptions, Seams
from circparam.seams.segmentation.enforce import enforce, lay_out_sound
from circparam.seams.segmentation.grow import (
    DualGraph,
    dual_graph,
    first_charts,
    make_disks,
    split_charts,
)
from circparam.seams.segmentation.layout import ChartLayouts, judge, lay_out_fresh, shorten_seams
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.shorten import propose
from circparam.seams.segmentation.small import absorb, small_note
from circparam.seams.segmentation.state import arcs_of
from circparam.seams.segmentation.tail import hold_stretch
from circparam.seams.segmentation.unions import MergeOptions
from circparam.seams.segmentation.weigh import Limits
from circparam.seams.symmetry import Mirror, about_image_of, both_sides, find_mirror, image_of
from circparam.solvers.newton import RelaxOptions
from circparam.solvers.poisson import from_jacobians

DIRECT_FACES = 3_500  # up to this size charts are decided on the mesh itself
PROXY_FACES = 2_000  # faces of the proxy of a mesh in one piece
PIECE_FACES = 200  # more for every further piece, up to half as many again
PROXY_SHARE = 1 / 60  # and at least this share of the faces
LOOP_FACES = 20  # faces of a proxy for each handle and hole: fewer would close them
CUT_UP = 20  # faces: a surface with fewer for each hole and handle is cut up by them
MANY = 300  # more first charts than that are a soup of faces: those that are bad are split in four, not in two
WORTH_IT = 0.7  # a proxy that keeps more of the faces (many small components) is no use
SEEDS = (60, 12, 30, 100)  # regions that charts are grown from, start by start
START_FACES = (1 << 62, 6000, 1500, 1500)  # up to this size a start is made
SHARED_FACES = 500  # from this size on starts are shared with a second process
SHORT_ARCS = 0.2  # radians; arcs end at such vertices when charts must merge whatever the cost
DOUBTS = (
    10_000  # faces of components that may be hard surfaces or not, up to which both ways are tried
)
CHART_COST = 0.25  # of a chart, in units of seam length, when starts are compared
REGROUP_FACES = 20_000  # larger unions than that are not tried on the fine mesh
REGROUPINGS = 3  # rounds of merging on the fine mesh after charts were split there
MARGIN = 0.004  # share of the root of its area that parts of one chart keep apart
PROXY_MARGIN = 0.01  # on the proxy, whose boundaries are only about those of the mesh
SLACK = 0.01  # share of the bound's excess over 1 that seams on the proxy leave for the fine mesh
STRETCH = 2.0  # that all but a thousandth of the surface keep to where nothing else is asked for
STRICT = 1.05  # bound up to which seams are added for that
ROUGH = RelaxOptions(tolerance=1e-3, max_iterations=25, bound=1.01)
HASTY = RelaxOptions(tolerance=1e-3, max_iterations=6, bound=1.01)
FAIR = RelaxOptions(tolerance=1e-4, max_iterations=30)
FINAL = RelaxOptions(tolerance=1e-4, max_iterations=60)


def charts(surface: Surface, options: SeamOptions, monitor: Monitor) -> Seams:
    """Seams that leave few charts, each a disk (holes allowed) whose isometric map stays under the bound.

    Returns the seams with the layout (symmetric Dirichlet energy minimised, no flips, no chart overlapping
    itself). Raises OptionError for contradictory seams, and for a symmetry that the surface does not have.
    Deterministic.
    """
    mirror = None if options.symmetry is None else find_mirror(surface, options.symmetry)
    surface, forced, notes = constrain(surface, options)
    if mirror is not None:
        surface = dataclasses.replace(surface, locked=mirror.closed(surface.locked))
        forced = mirror.closed(forced) & ~surface.locked
        notes.append(mirror.note)
    opened = dataclasses.replace(
        surface, edges=surface.edges[~forced], locked=surface.locked[~forced]
    )
    bound = 1 + (options.max_distortion - 1) * (1 - 1e-4)
    if mirror is None:
        atlas = bounded_atlas(opened, bound, options, monitor, notes)
    else:
        atlas = mirrored_atlas(opened, mirror.without(forced), bound, options, monitor, notes)
    with monitor.stage("stretch"):
        # who allows more distortion wants fewer seams: then none are added for a stretch nobody asked for
        asked = options.max_stretch is not None or options.max_distortion <= STRICT
        free = asked and options.max_charts is None and options.min_chart_faces == 1
        limits = Limits(bound, options.max_stretch or STRETCH)
        hold_stretch(atlas, limits, monitor, asked and mirror is None, free)
    cut = forced.copy()
    cut[~forced] = atlas.cut
    return Seams(cut, atlas.corners, notes)


def mirrored_atlas(
    surface: Surface,
    mirror: Mirror,
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
) -> Atlas:
    """The atlas of one half on both, then whatever charts of both may be glued where they meet."""
    if options.max_charts is not None:
        options = dataclasses.replace(options, max_charts=max(options.max_charts // 2, 1))
    half = bounded_atlas(surface.part(mirror.half), bound, options, monitor, notes)
    if mirror.images is not None:
        other = image_of(surface, mirror, mirror.images, half)
    else:
        with monitor.stage("carry"):
            rest = surface.part(~mirror.half)
            graph = dual_graph(rest)
            other = transfer_to_fine(rest, graph, *about_image_of(mirror, half, rest))
        with Worker(__name__, len(rest.faces) > HALVED) as worker:
            finish(other, graph, bound, options, worker, monitor, notes)
    atlas, between = both_sides(surface, mirror, half, other)
    with monitor.stage("charts"):
        Merger(atlas, MergeOptions(bound, margin=MARGIN / 2), ~between).run(monitor)
        atlas.cut = mirror.closed(atlas.cut)
        if not_disks(atlas.cut_mesh()).any():
            make_disks(atlas, dual_graph(surface))
    return atlas


def bounded_atlas(
    surface: Surface, bound: float, options: SeamOptions, monitor: Monitor, notes: list[str]
) -> Atlas:
    """Decide the seams of a surface and lay its charts out: hard components from their regions."""
    kind = hardness(surface)
    hard, doubtful = kind == HARD, kind == DOUBTFUL
    doubtful &= doubtful.sum() <= DOUBTS
    if not (hard | doubtful).any() or options.max_charts is not None:
        return grown_atlas(surface, bound, options, monitor, notes)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    if not hard.all():
        atlas.put(~hard, grown_atlas(surface.part(~hard), bound, options, monitor, notes))
    with Worker(__name__, int(hard.sum()) > HALVED) as worker:
        if hard.any():
            atlas.put(hard, hard_atlas(surface.part(hard), bound, options, worker, monitor, notes))
        if doubtful.any() and not monitor.expired:
            other = hard_atlas(surface.part(doubtful), bound, options, worker, monitor, notes)
            take_better(atlas, doubtful, other, CHART_COST)
    if hard.any():
        atlas.prices = seam_prices(surface)
    return atlas


def grown_atlas(
    surface: Surface, bound: float, options: SeamOptions, monitor: Monitor, notes: list[str]
) -> Atlas:
    """Decide the seams of a surface on a coarse proxy and lay its charts out."""
    with Worker(__name__, len(surface.faces) > SHARED_FACES) as worker:
        atlas, graph = _decided(surface, bound, options, worker, monitor)
        finish(atlas, graph, bound, options, worker, monitor, notes)
    return atlas


def finish(
    atlas: Atlas,
    graph: DualGraph,
    bound: float,
    options: SeamOptions,
    worker: Worker,
    monitor: Monitor,
    notes: list[str],
) -> None:
    """Relax charts on the surface itself, and split and merge again what is not as wanted there."""
    make_disks(atlas, graph)
    with monitor.stage("enforce"):
        count, chart = atlas.charts()
        to_bound = bound if options.max_charts is None else None
        parts = in_halves(chart)
        tasks = [(atlas.part(faces), to_bound) for faces in parts]
        for faces, part in zip(parts, worker.map(settle_part, tasks, monitor), strict=True):
            atlas.put(faces, part)
        if atlas.charts()[0] > count:
            regroup(atlas, bound, worker, monitor)
    if options.min_chart_faces > 1:
        with monitor.stage("charts"):
            notes += grow_small(atlas, bound, options.min_chart_faces, monitor)


def settle_part(atlas: Atlas, bound: float | None, monitor: Monitor) -> Atlas:
    """Relax charts, and hold them to a bound where there is one."""
    with monitor.stage("relax"):
        laid = settle(atlas, monitor)
    if bound is not None:
        enforce(atlas, dual_graph(atlas.surface), laid, bound, FINAL, monitor)
    return atlas


def _decided(
    surface: Surface, bound: float, options: SeamOptions, worker: Worker, monitor: Monitor
) -> tuple[Atlas, DualGraph]:
    """Seams before the last relaxation, decided on the surface or on its proxy."""
    if complexity(surface) > MANY:
        closed = close_small_holes(surface)
        if complexity(closed) <= complexity(surface) / 2:
            atlas, _ = _decided(closed, bound, options, worker, monitor)
            return without_fans(atlas, surface), dual_graph(surface)
    count, graph = len(surface.faces), dual_graph(surface)
    proxy = None
    with monitor.stage("charts"):
        if count > DIRECT_FACES:
            target = proxy_faces(surface)
            proxy = decimate(surface, target) if target < count else None
        if proxy is None or len(proxy.surface.faces) > WORTH_IT * count:
            return decide(surface, bound, MARGIN, options.max_charts, worker, monitor), graph
        inner = 1 + (bound - 1) * (1 - SLACK)
        coarse = decide(proxy.surface, inner, PROXY_MARGIN, options.max_charts, worker, monitor)
    with monitor.stage("carry"):
        return transfer_to_fine(surface, graph, coarse, proxy), graph


def proxy_faces(surface: Surface) -> int:
    """How many faces a proxy should have."""
    _, piece = surface.charts(np.zeros(len(surface.edges), bool))
    large = int((np.bincount(piece) > SMALL_COMPONENT).sum())
    pieces = PROXY_FACES + min(PIECE_FACES * max(large - 1, 0), PROXY_FACES // 2)
    share = int(PROXY_SHARE * len(surface.faces))
    return max(pieces, share, LOOP_FACES * complexity(surface))


def grow_small(atlas: Atlas, bound: float, least: int, monitor: Monitor) -> list[str]:
    """Let the neighbours of charts below so many faces take them; a note where some stay."""
    left = absorb(atlas, MergeOptions(bound, margin=MARGIN / 2), least, monitor)
    return small_note(left, least)


def regroup(atlas: Atlas, bound: float, worker: Worker, monitor: Monitor) -> None:
    """Merge the pieces that enforcing left with their neighbours where that is good again."""
    fixed = np.zeros(len(atlas.cut), bool)
    options = MergeOptions(bound, margin=MARGIN / 2, rounds=REGROUPINGS, faces=REGROUP_FACES)
    Merger(atlas, options, fixed, worker).run(monitor)


def decide(
    surface: Surface,
    bound: float,
    margin: float,
    max_charts: int | None,
    worker: Worker,
    monitor: Monitor,
) -> Atlas:
    """Decide seams on the surface itself: components that are good charts as they are stay whole."""
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    rest = ~whole_components(atlas, bound)
    if rest.any():
        atlas.put(rest, best_of_starts(surface.part(rest), bound, margin, worker, monitor))
    if max_charts is not None:
        reach_count(atlas, bound, max_charts, monitor)
    return atlas


def whole_components(atlas: Atlas, bound: float) -> BoolArray:
    """(m,) bool: faces of components that are good charts without a seam. They are laid out."""
    cut_mesh = atlas.cut_mesh()
    able = ~not_disks(cut_mesh)
    if able.any():
        laid = lay_out_fresh(atlas, able, dataclasses.replace(ROUGH, give_up=bound))
        able &= ~laid.bad(bound)
    return able[cut_mesh.chart]


def best_of_starts(
    surface: Surface, bound: float, margin: float, worker: Worker, monitor: Monitor
) -> Atlas:
    """Grow, merge and shorten charts: the best of a few starts where that is cheap."""
    seeds = [k for k, most in zip(SEEDS, START_FACES, strict=True) if len(surface.faces) <= most]
    # so many holes and handles cut the surface up that regions hardly matter
    if complexity(surface) > min(MANY, len(surface.faces) / CUT_UP):
        seeds = seeds[:1]
    if len(seeds) == 1:
        return grow_and_merge(surface, bound, margin, seeds[0], worker, monitor)
    tasks = [(surface, bound, margin, k, k == seeds[0]) for k in seeds]
    starts = [Atlas(surface, *s) for s in worker.map(decide_once, tasks, monitor) if s]
    cost = [c.seam_length + CHART_COST * c.charts()[0] for c in starts]
    return starts[int(np.argmin(cost))]


def decide_once(
    surface: Surface, bound: float, margin: float, seeds: int, needed: bool, monitor: Monitor
) -> tuple[BoolArray, FloatArray] | None:
    """(cut, corners) of one start; None where it is not needed and there is no time for it."""
    if monitor.expired and not needed:
        return None
    atlas = grow_and_merge(surface, bound, margin, seeds, None, monitor)
    return atlas.cut, atlas.corners


def grow_and_merge(
    surface: Surface,
    bound: float,
    margin: float,
    seeds: int,
    worker: Worker | None,
    monitor: Monitor,
) -> Atlas:
    """Grow charts round so many seeds, split what is bad, merge, shorten, merge again.

    worker: lays half of the charts out where there is nothing better for it to do.
    """
    graph = dual_graph(surface)
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    first_charts(atlas, graph, seeds)
    make_disks(atlas, graph)
    proposal = propose(atlas, 2)
    atlas.cut = proposal.cut(np.ones(proposal.n, bool))
    make_disks(atlas, graph)
    crowd = atlas.charts()[0] > MANY
    laid = lay_out_fresh(atlas, None, HASTY if crowd else ROUGH, worker, monitor)
    for _ in range(12):
        bad = laid.bad(bound) & (np.bincount(laid.cut_mesh.chart) > 1)
        if not bad.any():
            break
        was = bad[laid.cut_mesh.chart]
        split_charts(atlas, graph, laid.cut_mesh.chart, bad, 4 if bad.sum() > MANY else 2)
        make_disks(atlas, graph)
        n, chart = atlas.charts()
        again = np.zeros(n, bool)
        again[chart[was]] = True
        steps = HASTY if bad.sum() > MANY else ROUGH
        laid = lay_out_fresh(atlas, again, steps, worker, monitor)
    fixed = np.zeros(len(atlas.cut), bool)
    merger = Merger(atlas, MergeOptions(bound, margin=margin), fixed, worker)
    merger.run(monitor)
    _, before = atlas.charts()
    arcs = arcs_of(atlas, before)
    steps = HASTY if crowd else FAIR
    shorten_seams(atlas, graph, bound, steps, 3, margin=margin)
    merger.seams_moved(before, arcs)
    merger.run(monitor)
    shorten_seams(atlas, graph, bound, steps, 1, margin=margin)
    return atlas


def reach_count(atlas: Atlas, bound: float, count: int, monitor: Monitor) -> None:
    """Merge on with a rising bound until there are at most ``count`` charts, or nothing merges any more."""
    fixed = np.zeros(len(atlas.cut), bool)
    for _ in range(24):
        n, _ = atlas.charts()
        if n <= count:
            break
        bound = 1 + max(bound - 1, 1e-3) * 1.6
        merger = Merger(atlas, MergeOptions(bound, margin=0.0, cone=SHORT_ARCS), fixed)
        while not monitor.expired and atlas.charts()[0] > count and merger.round(monitor):
            pass


def transfer_to_fine(surface: Surface, graph: DualGraph, coarse: Atlas, proxy: Proxy) -> Atlas:
    """Seams and layout of the proxy on the fine surface (not relaxed yet)."""
    fine = Atlas(surface, np.zeros(len(surface.edges), bool))
    transfer_seams(coarse, proxy, fine)
    near = nearest_coarse_face(surface, proxy)
    _, coarse_chart = coarse.charts()
    separate(fine, graph, coarse, coarse_chart, near)
    transferred = drop_slivers(fine, coarse_chart, near)
    targets, _ = fine_targets(coarse, fine, coarse_chart, near, transferred)
    cut_mesh = fine.cut_mesh()
    bad = not_disks(cut_mesh)
    uv, _ = from_jacobians(cut_mesh, targets, 0 if bad.any() else 8)
    fine.scatter(cut_mesh, uv)
    return fine


def settle(atlas: Atlas, monitor: Monitor) -> ChartLayouts:
    """Relax the layout of all charts, after mending its flips."""
    cut_mesh = atlas.cut_mesh()
    uv = lay_out_sound(cut_mesh, atlas.gather(cut_mesh), FINAL, monitor)
    atlas.scatter(cut_mesh, uv)
    return judge(cut_mesh, uv)
