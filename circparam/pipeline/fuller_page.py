"""A fuller page for a little seam (``--pack-splits auto``).

Texels are bought with seam. A page of R · R texels with the covered share s has s R² texels of surface. Seams
and boundaries of length L, in roots of the area, border L √s R texels, where filters blend and mip maps bleed.
**A cut pays if texels grow by at least 0.4 of the percentage by which seams grow** (``RATE`` in ``cut_plan``),
measured on sketches of the page. Sketches resolve 4 % of the covered share, one cell. The plans that rank
highest are therefore packed, beside the page without cuts where that page may be as good. The best page is
kept. The search has a budget of work (``WORK``), which is counted and not timed. Many charts are more than a
sketch can show. Their arms are then cut off by the estimate of their boxes (``sprawl``), and that one page is
packed. A mesh that needs no seam gets none, and all cuts together make the seams no longer than ``LIMIT``
allows.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.monitor import Monitor
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.workers import DeferredTask, Worker
from circparam.errors import CircparamError
from circparam.geometry.distortion import face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing import pack
from circparam.packing.budget import Budget
from circparam.packing.nest.strategy import on_page
from circparam.packing.placement import Placement
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade, KnownPacking
from circparam.pipeline.configure import pack_options
from circparam.pipeline.cut_along import Limits
from circparam.pipeline.cut_plan import (
    LOCKED,
    RATE,
    SKETCHED_SHARE,
    WORK,
    WORK_OF_FACE,
    Plan,
    effort_of,
    first_plan,
    sketch_grid,
)
from circparam.pipeline.cut_search import Planner
from circparam.pipeline.options import Options
from circparam.pipeline.pieces import AtlasCutter, ChartCutter
from circparam.pipeline.place import chart_signs, sized
from circparam.pipeline.sprawl import Trimmer
from circparam.seams.segmentation.tail import limit_stretch
from circparam.seams.segmentation.weigh import Limits as StretchLimits
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH, stretch_asked

LIMIT = 0.149  # of the length of the seams that all cuts may add
ENOUGH = 0.7  # covered share of a page on which nothing is looked for
# the same of more charts than FEW on surfaces of more faces than LARGE, where cuts and packing take longer
ENOUGH_OF_MANY, FEW, LARGE = 0.66, 12, 100_000
# A page is packed if its sketch promises this share of the wanted covered share; and the largest gain of a
# packed page over its sketch, as a logarithm.
NEARLY, SURE = 0.86, 0.12
# largest loss against the best sketch of a plan that is packed too
CLOSE = 0.05
SKETCHED, PLANNED = 0.2, 0.6  # share of the packing that has been done then
CUTS, ARMS = 8, 64  # at most: of plans, and arms of charts that are not sketched
DRAWN = 9  # charts that a sketch shows well
# Least worth of arms by their boxes for the page to be packed; and the worth from which the page without cuts
# is not packed.
WORTH, CERTAIN = 0.16, 0.3
# Share of the area that all cuts may stretch too much, below the promise; and the number of largest faces
# exempt in plans, whose charts may be relaxed with weights.
SPARED, LARGEST = 0.95e-3, 2


def fill_page(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Cut charts if a fuller page is worth the seam; a note says which cuts were made.

    There are never more charts than ``options.max_charts``, nor parts of fewer faces than
    ``options.min_chart_faces``. Charts keep the layout they had, so nothing overlaps, and their bound.
    """
    cascade = fallback.settle(cascade, monitor)
    cut_mesh, uv = cascade.atlas.open()
    asked = options.cuts_asked
    most = np.inf if options.max_charts is None else options.max_charts - cut_mesh.n_charts
    no_seam = asked is None and cascade.atlas.seam_length <= 0
    if most < 1 or asked == 0 or no_seam or monitor.expired or not np.isfinite(uv).all():
        return cascade

    uncut = _Uncut(cascade, options, monitor)
    chosen = _cut(uncut, atlas_cutter(cascade, cut_mesh, uv, options), most)
    if chosen is not None:
        return chosen
    kept = replace(cascade, packing=uncut.packing)
    return kept if asked is None else kept.noted("--pack-splits: no cut is worth its seam")


def _cut(uncut: _Uncut, cutter: AtlasCutter, most: float) -> Cascade | None:
    """The layout with charts cut, packed; None if no cut is worth its seam. most: cuts."""
    cascade, options, monitor = uncut.cascade, uncut.options, uncut.monitor
    cut_mesh, asked = cutter.cut_mesh, options.cuts_asked
    work = WORK + WORK_OF_FACE * len(cut_mesh.faces)
    budget = Budget(work, lambda: monitor.expired)
    first = None
    if not options.draft:
        first = first_plan(cutter, budget, SKETCHED_SHARE if asked is None else 0.0)
    monitor.update(SKETCHED)
    costly = cut_mesh.n_charts > FEW and len(cut_mesh.faces) > LARGE
    enough = ENOUGH_OF_MANY if costly else ENOUGH
    if first is None or len(first.pieces) > DRAWN:
        cuts = int(min(ARMS if asked is None else asked, most))
        return _trimmed(uncut, cutter, cuts, enough)
    if asked is None and uncut.fills(first, enough):
        return None
    cuts = int(min(CUTS if asked is None else asked, most))
    plans = _plans(first, cutter, cuts, asked is None, budget, monitor)
    monitor.update(PLANNED)
    return _Contest(cascade, cutter, options, monitor).winner(plans, uncut)


@dataclass(frozen=True, eq=False)
class _Uncut:
    """The layout without cuts; it is packed when somebody asks for it."""

    cascade: Cascade
    options: Options
    monitor: Monitor

    @cached_property
    def _later(self) -> DeferredTask:
        return DeferredTask(
            self.monitor.jobs, _packing, (self.cascade, self.options, None), self.monitor
        )

    def begin(self) -> None:
        """Let a process that is idle pack it: it may be asked for."""
        self._later.begin()

    @cached_property
    def packing(self) -> KnownPacking | None:
        """The charts, packed; None if packing fails."""
        found: KnownPacking | None = self._later.result()
        return found

    def fills(self, sketched: Plan, enough: float) -> bool:
        """Whether it covers so much that nothing is looked for; packed for that only where its sketch may."""
        if sketched.share <= NEARLY * enough:
            return False
        return self.packing is None or covered_share(self.packing) >= enough


def atlas_cutter(
    cascade: Cascade, cut_mesh: CutMesh, uv: FloatArray, options: Options
) -> AtlasCutter:
    """The maker of cuts; cuts lead through flats only if the user asked for cuts."""
    stretch = options.max_stretch or STRETCH
    if not stretch_asked(options.max_stretch, options.bound or np.inf):
        stretch = np.inf
    limits = Limits(cascade.rules.bound, options.min_chart_faces or 1)
    if options.cuts_asked is not None:
        limits = replace(limits, flats=1.0)
    grid = sketch_grid(cut_mesh, pack_options(options))
    sign = chart_signs(cascade.atlas.surface, cut_mesh, options)
    seams = cascade.atlas.seam_length * float(np.sqrt(cascade.atlas.surface.areas.sum()))
    return AtlasCutter(cascade.atlas, cut_mesh, uv, ChartCutter(grid, limits, sign, seams, stretch))


def _plans(
    first: Plan, cutter: AtlasCutter, cuts: int, limited: bool, budget: Budget, monitor: Monitor
) -> list[Plan]:
    """The plan without a cut and those worth more, the best first.

    limited: whether seams grow by no more than LIMIT.
    """
    area = float(cutter.atlas.surface.areas.sum())
    longer, spared = _room(cutter, limited)
    planner = Planner(cutter, area, first.length + longer, cuts, budget, monitor, spared)
    return [first, *planner.best(first)]


def _room(cutter: AtlasCutter, limited: bool) -> tuple[float, float]:
    """Limits of all cuts: length of seams, area of faces that are stretched too much."""
    areas = cutter.atlas.surface.areas
    longer = LIMIT * cutter.chart_cutter.seams if limited else np.inf
    return longer, SPARED * float(areas.sum()) + LARGEST * float(areas.max())


def _trimmed(uncut: _Uncut, cutter: AtlasCutter, cuts: int, enough: float) -> Cascade | None:
    """The layout with arms cut off, packed; None if that is not worth its seams. enough: covered share of
    the page without cuts from which no cut is made, except for cuts that the user asked for."""
    cascade, options, monitor = uncut.cascade, uncut.options, uncut.monitor
    limited = options.cuts_asked is None
    found = Trimmer(cutter, *_room(cutter, limited), cuts).run(monitor)
    if found.value < (CERTAIN if options.draft else WORTH):  # a draft packs one page
        return None
    atlas = cutter.joined(found.grounds)
    if not stretch_kept(atlas, cascade.atlas, options, cascade.rules.bound, monitor):
        return None
    doubtful = found.value < CERTAIN
    if doubtful:
        uncut.begin()
    after = replace(cascade, atlas=atlas)
    packed = packing(after, options, monitor)
    if packed is None:
        return None
    if doubtful and uncut.packing is not None:
        full = limited and covered_share(uncut.packing) >= enough
        if full or _value(uncut.packing, found.before) >= _value(packed, found.length):
            return None
    return replace(after, packing=packed).noted(_note(found.cuts, cascade.atlas, atlas))


@dataclass(frozen=True, eq=False)
class _Contest:
    """The layout without cuts against plans, as they will be packed: sketches only rank them."""

    cascade: Cascade
    cutter: AtlasCutter
    options: Options
    monitor: Monitor

    def winner(self, plans: list[Plan], uncut: _Uncut) -> Cascade | None:
        """The cascade with the cuts of the best plan; None if the first one, without any, is no worse."""
        first, before = plans[0], self.cascade.atlas
        most = effort_of(len(first.pieces), self.cutter).packed
        tried: list[tuple[Plan, Cascade]] = []
        for plan in plans[1:]:
            if tried and plan.value < tried[0][0].value - CLOSE:
                break
            if any(plan.like(other) for other, _ in tried):
                continue
            atlas = self.cutter.joined(p.ground for p in plan.pieces if p.ground is not None)
            bound = self.cascade.rules.bound
            if stretch_kept(atlas, before, self.options, bound, self.monitor):
                tried.append((plan, replace(self.cascade, atlas=atlas)))
            if len(tried) == most:
                break
        tasks = [
            (c, self.options, start_of(self.cutter, p, c.atlas, self.options)) for p, c in tried
        ]
        if len(tasks) == 1 and tried[0][0].value < first.value + SURE:
            uncut.begin()  # beside the only one
        packings = Worker(self.monitor.jobs).map(_packing, tasks, self.monitor)
        values = [_value(k, p.length) for (p, _), k in zip(tried, packings, strict=True)]
        best = int(np.argmax(values)) if values else -1
        if best < 0 or not np.isfinite(values[best]):
            return None
        # the page without cuts is packed if it may be better than its sketch
        if values[best] < first.value + SURE and values[best] <= _value(
            uncut.packing, first.length
        ):
            return None
        plan, cascade = tried[best]
        return replace(cascade, packing=packings[best]).noted(
            _note(plan.cuts, before, cascade.atlas)
        )


def _note(cuts: int, before: Atlas, after: Atlas) -> str:
    """A note on the cuts, for the user."""
    old, new = before.seam_length, after.seam_length
    longer = f"{new / old - 1:.1%} longer" if old > 0 else f"{new:.2f} roots of the area long"
    return (
        f"{counted(cuts, 'cut')} for a fuller page made the seams {longer} "
        "(--pack-splits 0 prevents this)"
    )


def stretch_kept(
    atlas: Atlas, before: Atlas, options: Options, bound: float, monitor: Monitor
) -> bool:
    """Whether the cuts keep the stretched area within its limit, or below its old value; weights may help.

    Each part of a chart has its own scale, and relaxed parts have lost their weights.
    """
    if not stretch_asked(options.max_stretch, options.bound or np.inf):
        return True
    limits = StretchLimits(bound, options.max_stretch or STRETCH)
    allowed = max(_stretched(before, limits.most), SPARED)
    if _stretched(atlas, limits.most) <= allowed:
        return True
    limit_stretch(atlas, limits, monitor, slits=False, splits=False)
    return _stretched(atlas, limits.most) <= allowed


def _stretched(atlas: Atlas, most: float) -> float:
    cut_mesh, uv = atlas.open()
    return float(share_over(cut_mesh, face_stretch(cut_mesh, uv), most).sum())


def start_of(cutter: AtlasCutter, plan: Plan, atlas: Atlas, options: Options) -> Placement | None:
    """The placement of a plan as a start for packing; charts without a sketch have page −1. None for several
    pages, or if charts are mirrored otherwise."""
    asked = pack_options(options)
    if asked.pages > 1 or asked.fixed_scale or asked.rotate != "free":
        return None
    count, chart = atlas.charts()
    old = cutter.cut_mesh.chart
    face = np.array(
        [
            int(p.ground.faces[0] if p.ground is not None else np.argmax(old == p.outline.chart))
            for p in plan.pieces
        ]
    )
    sign = chart_signs(atlas.surface, atlas.open()[0], options)
    at = chart[face]
    if (sign[at] != cutter.chart_cutter.sign[old[face]]).any():
        return None
    found = on_page(plan.layout, LOCKED, asked)
    angle, offset, page = np.zeros(count), np.zeros((count, 2)), np.full(count, -1)
    angle[at], offset[at], page[at] = found.angle, found.offset, found.page
    return Placement(found.scale, angle, offset, page)


def _packing(
    cascade: Cascade, options: Options, start: Placement | None, monitor: Monitor
) -> KnownPacking | None:
    return packing(cascade, options, monitor, start)


def packing(
    cascade: Cascade, options: Options, monitor: Monitor, start: Placement | None = None
) -> KnownPacking | None:
    """The charts packed as they will be; None if they cannot be. start: first places of the charts."""
    cut_mesh, uv = cascade.open()
    uv[:, 0] *= chart_signs(cascade.atlas.surface, cut_mesh, options)[cut_mesh.vertex_chart]
    uv = sized(cut_mesh, uv, cascade.kept_sizes(cut_mesh))
    with contextlib.suppress(CircparamError):
        return KnownPacking(
            uv, pack(cut_mesh.faces, uv, cut_mesh.chart, pack_options(options), monitor, start)
        )
    return None


def _value(found: KnownPacking | None, length: float) -> float:
    """``Plan.value`` of a page that was packed."""
    return -np.inf if found is None else float(np.log(covered_share(found)) - RATE * np.log(length))


def covered_share(found: KnownPacking) -> float:
    """Covered share of the pages that are used."""
    return float(found.packed.share[: int(found.packed.page.max()) + 1].mean())
