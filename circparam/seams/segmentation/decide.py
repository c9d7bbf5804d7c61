"""Seams decided on one surface: searched for, moved to where they are hardly seen, or merged on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray
from circparam.core.monitor import Monitor
from circparam.core.workers import Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import FINAL, ROUGH
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.search import WORK_PER_FACE
from circparam.seams.segmentation.layout import judge, lay_out_fresh
from circparam.seams.segmentation.starts import searched
from circparam.solvers.newton import relax

SHORT_ARCS = 0.2  # radians; arcs end at such vertices when charts of a finished atlas merge
ANY_BOUND = float(np.sqrt(np.finfo(float).max))  # that every chart keeps to which has no flips


def decide(
    surface: Surface,
    merging: MergeOptions,
    regions: Sequence[int],
    max_charts: int | None,
    worker: Worker,
    monitor: Monitor,
) -> Atlas:
    """Decide seams on the surface itself: components that are good charts as they are stay whole.

    regions: that the charts of each start are grown from.
    """
    # visibility does not predict which charts merge: charts are decided by length alone
    atlas = Atlas(surface.unpriced(), np.zeros(len(surface.edges), bool))
    rest = ~whole_components(atlas, merging.bound)
    if not rest.all():
        monitor.keep(atlas.part(~rest))
    if rest.any():
        atlas.put(rest, searched(atlas.surface.part(rest), merging, regions, worker, monitor))
    if max_charts is not None:
        reach_count(atlas, merging.bound, max_charts, monitor)
    return atlas


def whole_components(atlas: Atlas, bound: float) -> BoolArray:
    """(m,) bool: faces of components that are good charts without a seam. They are laid out."""
    cut_mesh = atlas.cut_mesh()
    able = ~not_disks(cut_mesh)
    if able.any():
        layouts = lay_out_fresh(atlas, able, replace(ROUGH, give_up=bound))
        able &= ~layouts.bad(bound)
    return able[cut_mesh.chart]


def merge_on(atlas: Atlas, bound: float, margin: float, monitor: Monitor) -> None:
    """Merge charts of a finished atlas wherever that lowers its cost, distortion included.

    Arcs end at smaller curvature than they did and parts may come nearer to each other, so that unions turn out
    fine that were refused when charts were decided.
    """
    n, _ = atlas.charts()
    pieces, _ = atlas.surface.components
    if n <= pieces or monitor.expired:
        return
    work = WORK_PER_FACE * len(atlas.surface.faces)
    options = MergeOptions(bound, margin, cone=SHORT_ARCS, zip=False, work=work)
    merge(atlas, options, monitor, worker=Worker(monitor.jobs))


def merged_on(coarse: Atlas, bound: float, monitor: Monitor) -> Atlas:
    """The atlas of a proxy relaxed to the end and merged on, as far as there is time."""
    monitor.keep(coarse)
    pieces, _ = coarse.surface.components
    out = Atlas(coarse.surface, coarse.cut, coarse.corners)
    if coarse.charts()[0] > pieces and not monitor.expired:
        cut_mesh, uv = out.open()
        relaxed = judge(cut_mesh, relax(cut_mesh, uv, FINAL).uv)
        fine = ~relaxed.bad(bound)[cut_mesh.vertex_chart]
        out.scatter(cut_mesh, np.where(fine[:, None], relaxed.uv, uv))
        merge_on(out, bound, 0.0, monitor)
    return out


def reach_count(atlas: Atlas, bound: float, count: int, monitor: Monitor) -> None:
    """Merge on with a rising bound until there are at most ``count`` charts, or nothing merges any more."""
    pieces, _ = atlas.surface.components
    for _ in range(24):
        if atlas.charts()[0] <= max(count, pieces):
            break
        bound = 1 + max(bound - 1, 1e-3) * 1.6
        options = MergeOptions(bound, 0.0, cone=SHORT_ARCS, zip=False, chart=np.inf, count=count)
        merge(atlas, options, monitor)


def worth(atlas: Atlas, most: int, bound: float) -> tuple[int, int, float, float]:
    """What counts where so many charts are wanted, the least first: charts that lie on themselves, which would
    be split, charts beyond that number, distortion, seam length."""
    cut_mesh = atlas.cut_mesh()
    layouts = judge(cut_mesh, atlas.gather(cut_mesh))
    over = float(np.average(layouts.energy, weights=cut_mesh.chart_areas))
    faulty = int(layouts.bad(ANY_BOUND).sum())
    return faulty, max(cut_mesh.n_charts, most), max(over, bound), atlas.seam_length
