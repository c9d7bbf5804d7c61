"""From charts that are decided to an atlas: relaxed on the surface, held to the bound, merged once more."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import DeferredTask, Worker, in_parts
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import FINAL
from circparam.seams.cost import COST
from circparam.seams.cut_graph import cut_handles, genus_of
from circparam.seams.decided import Decided
from circparam.seams.options import SeamOptions
from circparam.seams.segmentation.decide import ANY_BOUND
from circparam.seams.segmentation.enforce import Vain, below, enforce, relaxed_layouts
from circparam.seams.segmentation.grow import dual_graph, make_disks
from circparam.seams.segmentation.layout import judge
from circparam.seams.segmentation.merge import Merger
from circparam.seams.segmentation.small import absorb, small_note
from circparam.seams.segmentation.unions import MergeOptions
from circparam.solvers.newton import RelaxOptions

REGROUP_FACES = 20_000  # larger unions than that are not tried on the fine mesh
REGROUPINGS = 3  # rounds of merging on the fine mesh after charts were split there
MARGIN = 0.004  # share of the root of its area that parts of one chart keep apart
# of the faces in one part: the others do not keep the processes busy as long as that one
MOST_OF_IT = 0.5
LEVEL_FACES = 150_000  # larger surfaces get their charts on a smaller one first, a level


def plain_finished(
    make: Callable[[Monitor], Decided], bound: float, options: SeamOptions, monitor: Monitor
) -> tuple[BoolArray, FloatArray]:
    """(cut, corners) of what ``Decided.plain`` makes, finished."""
    decided = make(monitor)
    finish(decided, bound, options, Worker(monitor.jobs), monitor, [])
    return decided.atlas.cut, decided.atlas.corners


def begun(
    make: Callable[[Monitor], Decided], monitor: Monitor
) -> tuple[BoolArray, FloatArray, int]:
    """(cut, corners, number of relaxed parts) of what ``Decided.plain`` makes.

    The first part is relaxed, as ``finish`` would, where it is most; of several all processes have some.
    """
    decided = make(monitor)
    atlas = decided.atlas
    make_disks(atlas, decided.graph)
    faces = in_parts(atlas.charts()[1])[0]
    if faces.mean() < MOST_OF_IT:
        return atlas.cut, atlas.corners, 0
    part = atlas.apart(faces)
    with monitor.stage("relax"):
        relaxed_layouts(part, decided.relaxing, monitor)
    atlas.take(faces, part.cut, part.corners)
    return atlas.cut, atlas.corners, 1


class NextBest:
    """The atlas that charts give way to: asked for where those have to be cut, finished by then perhaps.

    taken: whether the other was left for it.
    """

    def __init__(self, surface: Surface, finished: DeferredTask) -> None:
        self._surface, self._finished = surface, finished
        self.taken = False

    @property
    def atlas(self) -> Atlas:
        """The finished atlas."""
        return Atlas(self._surface, *self._finished.result())

    def __call__(self, atlas: Atlas, bad: int) -> bool:
        """Whether it costs no more than another atlas does once its bad charts are cut in two."""
        self.taken = COST.seams(self.atlas) <= COST.seams(atlas) + COST.chart * bad
        return self.taken


def finish(
    decided: Decided,
    bound: float,
    options: SeamOptions,
    worker: Worker,
    monitor: Monitor,
    notes: list[str],
    vain: Vain | None = None,
) -> None:
    """Relax charts on the surface itself, and split and merge again what is not as wanted there.

    vain: as for ``enforce``; asked only where one process has all charts.
    """
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
        steps = [None] * decided.relaxed + [decided.relaxing] * len(parts)
        asked = vain if len(parts) == 1 else None
        tasks = ((atlas.apart(f), to_bound, steps[k], asked) for k, f in enumerate(parts))
        for faces, moved in zip(parts, worker.map(settle_part, tasks, monitor), strict=True):
            atlas.take(faces, *moved)
        monitor.keep(atlas)
        if atlas.charts()[0] > count:
            regroup(atlas, bound, options, worker, monitor)
    if options.min_chart_faces > 1:
        with monitor.stage("charts"):
            merging, least = MergeOptions(bound, margin=MARGIN / 2), options.min_chart_faces
            notes += small_note(absorb(atlas, merging, least, monitor), least)


def settle_part(
    atlas: Atlas,
    bound: float,
    options: RelaxOptions | None,
    vain: Vain | None,
    monitor: Monitor,
) -> tuple[BoolArray, FloatArray]:
    """Relax charts, and hold them to a bound; (cut, corners), all that a process has to send back.

    options: None where they are relaxed. vain: as for ``enforce``.
    """
    with monitor.stage("relax"):
        steps = FINAL
        if options is None:
            layouts = judge(*atlas.open())
        else:
            layouts = relaxed_layouts(atlas, options, monitor)
            if options.local is not None:  # what a level has decided need not be relaxed to the end
                layouts = below(atlas, layouts, bound, monitor)
                steps = dataclasses.replace(FINAL, bound=bound)
    if not layouts.bad(bound).any():  # the dual graph of a large part takes longer than to see that
        return atlas.cut, atlas.corners
    enforce(atlas, dual_graph(atlas.surface), layouts, bound, steps, monitor, vain)
    return atlas.cut, atlas.corners


def regroup(
    atlas: Atlas, bound: float, options: SeamOptions, worker: Worker, monitor: Monitor
) -> None:
    """Merge the pieces that enforcing left with their neighbours where that is good again."""
    if len(atlas.surface.faces) > LEVEL_FACES:
        # charts that are too large for any union need not be gone through
        chart = atlas.charts()[1]
        few = (np.bincount(chart) < REGROUP_FACES)[chart]
        if few.mean() < 0.5:
            part = atlas.part(few)
            if few.any():
                regroup(part, bound, options, worker, monitor)
                atlas.put(few, part)
            return
    fixed = np.zeros(len(atlas.cut), bool)
    merging = MergeOptions(
        bound, margin=MARGIN / 2, rounds=REGROUPINGS, faces=REGROUP_FACES, search=options.search
    )
    Merger(atlas, merging, fixed, worker).run(monitor)
