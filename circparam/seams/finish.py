"""From charts that are decided to an atlas: relaxed on the surface, held to the bound, merged once more."""

from typing import NamedTuple

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray
from circparam.core.workers import in_parts, in_processes
from circparam.mesh.atlas import Atlas
from circparam.seams.accuracy import ANY_BOUND, FINAL
from circparam.seams.cut_graph import cut_handles, genus_of
from circparam.seams.evaluate import MARGIN
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.enforce import enforce, relaxed_layouts
from circparam.seams.segmentation.grow import DualGraph, make_disks
from circparam.seams.segmentation.small import absorb
from circparam.solvers.newton import RelaxOptions

REGROUP_FACES = 20_000  # larger unions than that are not tried on the fine mesh
REGROUPINGS = 3  # rounds of merging on the fine mesh after charts were split there
LEVEL_FACES = 150_000  # larger surfaces get their charts on a smaller one first, a level


class Decided(NamedTuple):
    """An atlas whose seams are decided, its dual graph, and how far its layout is relaxed on the surface."""

    atlas: Atlas
    graph: DualGraph
    relaxing: RelaxOptions = FINAL


def finish(decided: Decided, bound: float, options: SeamOptions, monitor: Monitor) -> None:
    """Relax charts on the surface itself, and split and merge again what is not as wanted there."""
    atlas = decided.atlas
    if decided.relaxing.local is not None:
        # handles that only the mesh has, as those of noise: a loop each, where halves would go right across
        genus = genus_of(atlas.cut_mesh())
        if genus.any():
            atlas.cut |= cut_handles(atlas.surface, atlas.cut, genus > 0, monitor)
    make_disks(atlas, decided.graph)
    monitor.keep(atlas, sound=False)
    with monitor.stage("enforce"):
        count, chart = atlas.charts()
        # where the number of charts counts more than the bound, only what overlaps is split
        to_bound = bound if options.max_charts is None else ANY_BOUND
        parts = in_parts(chart)
        tasks = ((atlas.apart(faces), to_bound, decided.relaxing) for faces in parts)
        done = in_processes(settle_part, tasks, monitor)
        for faces, moved in zip(parts, done, strict=True):
            atlas.take(faces, *moved)
        monitor.keep(atlas)
        if atlas.charts()[0] > count:
            regroup(atlas, bound, options, monitor)
    if options.min_chart_faces > 1:
        with monitor.stage("charts"):
            merging = MergeOptions(bound, MARGIN / 2, chart=np.inf)
            absorb(atlas, merging, options.min_chart_faces, monitor)


def settle_part(
    atlas: Atlas, bound: float, options: RelaxOptions, monitor: Monitor
) -> tuple[BoolArray, FloatArray]:
    """Relax charts, and hold them to a bound; (cut, corners), all that a process has to send back."""
    with monitor.stage("relax"):
        layouts = relaxed_layouts(atlas, options, bound, monitor)
    enforce(atlas, layouts, bound, options, monitor)
    return atlas.cut, atlas.corners


def regroup(atlas: Atlas, bound: float, options: SeamOptions, monitor: Monitor) -> None:
    """Merge the pieces that enforcing left, and their neighbours, where that is good again."""
    if len(atlas.surface.faces) > LEVEL_FACES:
        # charts that are too large for any union need not be gone through
        chart = atlas.charts()[1]
        few = (np.bincount(chart) < REGROUP_FACES)[chart]
        if few.mean() < 0.5:
            part = atlas.part(few)
            if few.any():
                regroup(part, bound, options, monitor)
                atlas.put(few, part)
            return
    merging = MergeOptions(
        bound, margin=MARGIN / 2, rounds=REGROUPINGS, faces=REGROUP_FACES, search=options.search
    )
    merge(atlas, merging, monitor)
