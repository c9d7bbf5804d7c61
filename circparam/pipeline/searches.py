"""The best of several searches for charts: each goes all the way to a page, and the cheapest layout is kept.

A search depends on its number alone, so the same effort gives the same bytes on any number of cores. More
effort contains the searches of less, a draft included, and never gives a dearer layout
(``AtlasCost.finished``).
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

import numpy as np

from circparam.core import clock
from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.imports import OnDemand
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.workers import DeferredTask, in_processes
from circparam.errors import CircparamError
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.pipeline import applies, fallback
from circparam.pipeline.fallback import Cascade, KnownPacking
from circparam.pipeline.flatten import rules, seams_in_frame, surface_of_layout, with_straight
from circparam.pipeline.job import Job
from circparam.pipeline.options import Options
from circparam.pipeline.result import Effort
from circparam.seams.cost import COST
from circparam.seams.options import SeamOptions, Seams, Search
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH
from circparam.solvers.objective import chart_energies

# share of the seconds of the last search that must be left for another one to be begun
LIKELY_TIME_SHARE = 0.5
fuller_page: Any = OnDemand("circparam.pipeline.fuller_page")  # the FFT takes 0.1 s to import
OUT_OF_TIME = "out of time for a full search: its charts are those of a draft"
FAILURES = (CircparamError, np.linalg.LinAlgError, ArithmeticError)


@dataclass(frozen=True, eq=False)
class _SearchResult:
    """The result of one search: seams (e,), layout (m, 3, 2), notes, packing, cost."""

    cut: BoolArray
    corners: FloatArray
    notes: tuple[str, ...]
    packing: KnownPacking | None
    cost: float


def with_room(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Charts cut for a fuller page, as ``pack_splits`` says."""
    no_time = monitor.late and not np.isfinite(cascade.atlas.corners).all()
    # charts without a layout are projected later, in far too many charts
    if monitor.expired or no_time:
        return cascade
    # the price of a page is no weight of the user: cuts beside weights are made on demand alone
    weighted = options.seam_weights is not None and options.cuts_asked is None
    if not options.fills_page or weighted:
        return cascade
    if options.texel_density is not None:
        return fuller_page.fit_pages(cascade, options, monitor)
    return fuller_page.fill_page(cascade, options, monitor)


def begun_beside(job: Job, monitor: Monitor) -> list[DeferredTask]:
    """The next searches, one for each idle process; none where time decides how many are made."""
    options = job.options
    if options.searches < 2 or monitor.jobs < 2 or monitor.deadline is not None:
        return []
    numbers = range(1, min(options.searches, monitor.jobs))
    tasks = [(job.surface, job.seams_asked, options, number) for number in numbers]
    begun = [DeferredTask(searched, task, monitor) for task in tasks]
    for search in begun:
        search.begin()
    return begun


def best_layout(
    first: Cascade, begun: list[DeferredTask], job: Job, monitor: Monitor
) -> tuple[Cascade, Effort]:
    """The cheapest of the layout at hand and those of further searches, as many as the effort asks for.

    first: the layout of the first search, with its cuts for a fuller page. begun: of ``begun_beside``. Where
    there is a deadline, searches are begun as long as one is likely to end in time. Whenever the
    searches have doubled, the best layout is packed once more, with as many times the usual work: pages of
    eight meshes are 1.7 % fuller with four times the work, in the time of a tenth of a search.
    """
    options = job.options
    numbers = range(1, options.searches)
    repacked_at = 2
    if not len(numbers):
        return first, Effort()
    with monitor.stage("search"):
        first = _packed(first, options, monitor)
        costs = [cost_of(first, options)]
        best, kept = first, 0
        wave = len(numbers) if monitor.deadline is None else max(monitor.jobs, 1)
        took = 0.0
        while len(costs) <= len(numbers):
            if monitor.short(LIKELY_TIME_SHARE * took):
                break
            since = time.monotonic()
            some = numbers[len(costs) - 1 : len(costs) - 1 + wave]
            tasks = [(job.surface, job.seams_asked, options, k) for k in some[len(begun) :]]
            later = in_processes(searched, tasks, monitor)
            for found in [*(search.result() for search in begun), *later]:
                costs.append(np.inf if found is None else found.cost)
                if found is not None and found.cost < costs[kept]:
                    atlas = Atlas(first.atlas.surface, found.cut, found.corners)
                    best = Cascade(atlas, rules(options), notes=found.notes, packing=found.packing)
                    kept = len(costs) - 1
                if len(costs) == repacked_at:
                    best = _repacked(best, repacked_at, options, monitor)
                    costs[kept] = min(costs[kept], cost_of(best, options))
                    repacked_at *= 2
            took = time.monotonic() - since
            monitor.update((len(costs) - 1) / len(numbers))
    return best, Effort(len(costs), tuple(costs), kept, options.searches - len(costs))


@dataclass(eq=False)
class Drafted:
    """A draft beside a full search: an upper bound on its cost, and its fallback when time is up.

    The cheaper layout of both gets its page. If that is the draft's, the full search may still cost less on a
    page of its own. That page is made too, with as little work as in a draft.

    competes: the draft also replaces a full search that ended in time.
    """

    job: Job
    seams: DeferredTask
    competes: bool
    _layout: Cascade | None = None
    _paged: Cascade | None = None

    @classmethod
    def of(cls, job: Job, monitor: Monitor, full_search: float) -> "Drafted | None":
        """The draft, begun where a process is idle; None if a search contains it and has enough time.

        full_search: seconds that a full search may take. If fewer are left, the draft comes first, with its
        page.
        """
        options, surface = job.options, job.surface
        if options.draft or not applies.searches(options):
            return None
        from circparam.seams.charts import contains_draft

        asked = job.seams_asked
        competes, urgent = not contains_draft(surface, asked), monitor.short(full_search)
        if not (competes or urgent):
            return None
        task = (surface, asked, options.cut, Search(draft=True))
        draft = cls(job, DeferredTask(_seams, task, monitor), competes)
        if urgent:
            with monitor.stage("draft"), clock.bounded(monitor.last), suppress(*FAILURES):
                layout = draft.layout(monitor)
                if layout is not None:
                    draft.on_page(layout, monitor)
        else:
            draft.seams.begin()
        return draft

    def layout(self, monitor: Monitor) -> Cascade | None:
        """The layout of the draft; None if there is no time for it."""
        if self._layout is None and not monitor.expired:
            seams = self.seams.result()
            if seams is not None:
                surface = surface_of_layout(self.job.surface, self.job.seams_asked)
                self._layout = _laid_out(surface, seams, self.job.options)
        return self._layout

    def on_page(self, layout: Cascade, monitor: Monitor) -> Cascade:
        """The layout on the page of a draft."""
        if self._paged is None:
            quick = replace(self.job.options, effort=0.0)
            self._paged = _packed(with_room(layout, quick, monitor), quick, monitor)
        return self._paged


def on_page(
    cascade: Cascade, draft: Drafted | None, options: Options, monitor: Monitor
) -> tuple[Cascade, Cascade]:
    """(a layout on its page with cuts for a fuller one, the same layout without cuts).

    A draft replaces the layout if it costs less.
    """
    other, hurried = None, monitor.hurried
    if draft is not None and (draft.competes or hurried):
        with monitor.stage("draft"):
            other = draft.layout(monitor)
    if draft is None or other is None:
        return with_room(cascade, options, monitor), cascade
    if hurried:
        other = other.noted(OUT_OF_TIME)
    sound = not cascade.repairs and np.isfinite(cascade.atlas.corners).all()
    if not sound or finished_cost(other) < finished_cost(cascade):
        cascade = other
    filled = _packed(with_room(cascade, options, monitor), options, monitor)
    if finished_cost(other) < cost_of(filled, options):  # perhaps, if the page of the draft is full
        drafted = draft.on_page(other, monitor).noted(*other.notes)
        if cost_of(drafted, options) < cost_of(filled, options):
            return drafted, other
    return filled, cascade


def searched(
    surface: Surface, asked: SeamOptions, options: Options, number: int, monitor: Monitor
) -> _SearchResult | None:
    """One more search, to its page; None if the search fails or ends early."""
    # the share of the further searches that is done, or of the time for them
    left, timeout = monitor.left, monitor.timeout
    gone = 0.0 if left is None or not timeout else 1 - left / timeout
    monitor.update(max((number - 1) / (options.searches - 1), gone))
    seams = _seams(surface, asked, options.cut, Search(draw=number), monitor)
    if seams is None:
        return None
    with _apart(monitor) as own:
        try:
            cascade = _laid_out(surface_of_layout(surface, asked), seams, options)
            cascade = with_room(cascade, options, own)
            cascade = _packed(cascade, options, own)
        except FAILURES:
            return None
    atlas = cascade.atlas
    return _SearchResult(
        atlas.cut, atlas.corners, cascade.notes, cascade.packing, cost_of(cascade, options)
    )


def _seams(
    surface: Surface, asked: SeamOptions, cut: str, search: Search, monitor: Monitor
) -> Seams | None:
    """The seams of one search; None if it fails or ends early."""
    with _apart(monitor) as own:
        try:
            seams = seams_in_frame(surface, replace(asked, search=search), cut, own)
        except FAILURES:
            return None
    return None if seams.uv is None or not np.isfinite(seams.uv).all() else seams


def _laid_out(surface: Surface, seams: Seams, options: Options) -> Cascade:
    atlas = with_straight(Atlas(surface, seams.cut, seams.uv), options)
    return Cascade(atlas, rules(options), notes=tuple(seams.notes))


@contextmanager
def _apart(monitor: Monitor) -> Iterator[Monitor]:
    """A monitor for one more search, which does not make the first one late; the seconds are added."""
    own = Monitor(None, monitor.left, monitor.jobs)
    try:
        yield own
    finally:
        for name, seconds in own.seconds.items():
            monitor.seconds[name] = monitor.seconds.get(name, 0.0) + seconds


def _packed(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """The layout with its packing, which is part of its cost; pages of several atlases are not part of the
    cost."""
    if cascade.packing is not None or not _one_atlas(options):
        return cascade
    cascade = fallback.settle(cascade, monitor)
    return replace(cascade, packing=fuller_page.packing(cascade, options, monitor))


def _repacked(cascade: Cascade, work: int, options: Options, monitor: Monitor) -> Cascade:
    """The layout on a fuller page, if so many times the usual work of packing finds one."""
    known = cascade.packing
    if known is None or not _one_atlas(options):
        return cascade
    found = fuller_page.packing(cascade, options, monitor, known.packed.scale, work)
    share = fuller_page.covered_share
    fuller = found is not None and share(found) > share(known)
    return replace(cascade, packing=found) if fuller else cascade


def _one_atlas(options: Options) -> bool:
    """Whether all charts are packed together, so that the page is part of the cost."""
    several = options.grouped or options.sorted_by is not None or options.only is not None
    return options.packed and not several


def cost_of(cascade: Cascade, options: Options) -> float:
    """``AtlasCost.finished`` of a layout; infinite if charts are faulty, too many, or fit on no page."""
    cut_mesh, uv = cascade.open()
    most = np.inf if options.max_charts is None else options.max_charts
    if cascade.repairs or not np.isfinite(uv).all() or cut_mesh.n_charts > most:
        return float(np.inf)
    if cascade.packing is None and _one_atlas(options):
        return float(np.inf)
    if (fallback.faults(cut_mesh, uv) > 0).any():
        return float(np.inf)
    return finished_cost(cascade)


def finished_cost(cascade: Cascade) -> float:
    """``AtlasCost.finished`` of a layout as it is; a page that is not packed counts as full."""
    cut_mesh, uv = cascade.open()
    share = 1.0
    if cascade.packing is not None:
        share = float(cascade.packing.packed.share.mean())
    area = cut_mesh.chart_areas
    distortion = float(chart_energies(cut_mesh, uv) @ area / area.sum())
    tail = float(share_over(cut_mesh, face_stretch(cut_mesh, uv), STRETCH).sum())
    return COST.finished(cascade.atlas.seam_length, cut_mesh.n_charts, distortion, tail, share)
