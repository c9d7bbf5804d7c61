"""Charts cut for several pages, and for pages too small for them at a texel density that the user fixed.

Few charts leave pages empty: two charts fill two pages of four, each as large as the least square that holds
it. Charts are cut until each fits on its share of full pages. The chart that needs the largest page comes
first, along the chord whose larger part needs the smallest page. Boxes estimate the page after each cut. The
cuts stop where texels are worth most beside seams (``RATE`` in ``cut_plan``). The two best stops are packed,
beside the charts without a cut. At a fixed density pages have a size, and only charts that are longer are cut.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2
from circparam.core.monitor import Monitor
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.workers import Worker
from circparam.geometry.distortion import at_best_scales, chart_distortion
from circparam.mesh.atlas import Atlas
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade, KnownPacking
from circparam.pipeline.configure import pack_options
from circparam.pipeline.cut_along import Opened
from circparam.pipeline.cut_plan import RATE, ZIGZAG, boundary_length
from circparam.pipeline.fuller_page import ARMS, LIMIT, SPARED, atlas_cutter, packing, stretch_kept
from circparam.pipeline.options import Options
from circparam.pipeline.pieces import AtlasCutter, Ground
from circparam.pipeline.sprawl import COUNT, FILLED, KEPT, Arm, Trimmer

NEARLY = (
    0.98  # of the side of a page, up to which a chart fits whatever its outline's corners leave out
)
LARGE = 0.5  # of the side of a full page: smaller charts fill gaps, and are spread evenly in the estimate
PACKED = 2  # stops that are packed
SHARES = (
    1.0,
    0.7,
    0.5,
)  # of the side of a page: limit for charts, because charts that fit askew leave no room
CHORDS = 12  # of a chart along which no cut could be made before it is left
SMALLER = (
    0.95  # of the side of the square of a chart, that its parts are at most: else nothing is gained
)
RELAXED = 1.1  # times the excess of the bound over 1 from which relaxing a part brings it below, as a rule
LOOKED = 48  # chords of a chart whose sides are measured
# of the side of the square that all charts cover: chords nearer to a failed chord fail too
APART = 0.06

Values = TypeVar("Values", float, FloatArray)


@dataclass(frozen=True, eq=False)
class Stop:
    """The charts after some cuts. page: estimated area of the largest page needed; length: of all boundaries;
    value: logarithm of the gain of pages less the price of seams and charts; fits: whether every chart is short
    enough."""

    grounds: list[Ground]
    cuts: int
    page: float
    length: float
    value: float
    fits: bool


def taken(box: Values, area: Values) -> Values:
    """Area of a page that charts take with their gaps, from that of their least boxes and their own."""
    return (area + KEPT * (box - area)) / FILLED


class Divider(Trimmer):
    """Cuts the charts of an atlas for a number of pages; side: of a page in uv where its size is fixed."""

    def __init__(
        self, cutter: AtlasCutter, longer: float, spared: float, cuts: int, pages: int,
        side: float | None,
    ) -> None:  # fmt: skip
        self._pages, self._side = pages, side
        super().__init__(cutter, longer, spared, cuts)

    def stops(self, careful: bool, monitor: Monitor) -> list[Stop]:
        """The charts as they are, and after each cut.

        careful: chords whose sides are known to be above the bound are not tried first. Retries lead to other
        cuts, along longer chords.
        """
        found = [self._stop(0, None)]
        while found[-1].cuts < self._cuts and not monitor.expired:
            arm, k = self._next(careful)
            if arm is None:
                break
            if self._cut(arm, k):
                found.append(self._stop(found[-1].cuts + 1, found[0]))
        return found

    def _looked_at(self, box: FloatArray, square: FloatArray) -> BoolArray:
        """Charts that may need more than a page, or much of one; the others are spread evenly."""
        load = taken(box, self._cutter.cut_mesh.chart_areas)
        self._aim = self._side or float(np.sqrt(load.sum() / self._pages))
        large: BoolArray = np.maximum(square**2, load) > (LARGE * self._aim) ** 2
        self._small = float(load[~large].sum())
        return large

    def _need(self, arm: Arm) -> float:
        """Area of the page that a chart needs alone."""
        square = arm.square**2
        return square if self._side else max(square, taken(arm.box, arm.outline.area))

    def _next(self, careful: bool) -> tuple[Arm | None, int]:
        """The chart that needs the largest page, and the chord to cut it along; None if each fits."""
        aim = (NEARLY * self._aim) ** 2
        for arm in sorted(self._arms, key=self._need, reverse=True):
            if self._need(arm) <= aim:
                break
            found = arm.chords
            if not len(found.length) or len(arm.failed) >= CHORDS:
                continue
            longer = ZIGZAG * found.length
            cost = np.log(np.maximum(found.square**2, aim)) + RATE * np.log1p(longer / self._length)
            cost[self._length + longer > self._longest] = np.inf
            cost[self._tried(arm, APART) | (found.square > SMALLER * arm.square)] = np.inf
            order = np.argsort(cost, kind="stable")[: min(LOOKED, int(np.isfinite(cost).sum()))]
            if len(order):
                return arm, self._below(arm, order) if careful or arm.failed else int(order[0])
        return None, -1

    def _below(self, arm: Arm, chords: IntArray) -> int:
        """The first chord of which both sides lie below the bound or nearly so, else that nearest to it."""
        opened = self._cutter.task(arm, int(chords[0]))[0].opened
        cut_mesh = opened.cut_mesh
        bound = 1 + RELAXED * (self._cutter.chart_cutter.limits.bound - 1)
        centre = opened.uv[cut_mesh.faces].mean(1)
        least, nearest = np.inf, int(chords[0])
        for k in map(int, chords):
            start, end = arm.places[arm.chords.i[k]], arm.places[arm.chords.j[k]]
            side = (cross2(end - start, centre - start) > 0).astype(np.int64)
            worst = float(chart_distortion(replace(cut_mesh, chart=side), opened.uv).max())
            if worst <= bound:
                return k
            if worst < least:
                least, nearest = worst, k
        return nearest

    def _stop(self, cuts: int, first: Stop | None) -> Stop:
        """Where the cuts so far have led. Charts go to the emptiest page, the largest first."""
        loads = np.zeros(self._pages)
        arms = self._arms
        for load in sorted((taken(a.box, a.outline.area) for a in arms), reverse=True):
            loads[int(loads.argmin())] += load
        even = (float(loads.sum()) + self._small) / self._pages
        widest = self._widest()
        page = max(float(loads.max()), even, widest**2)
        value = 0.0
        if first is not None:
            gain = np.log(first.page / page) - RATE * np.log(self._length / first.length)
            value = float(gain - COUNT * np.log(self._charts / (self._charts - cuts)))
        grounds = [arm.ground for arm in arms if arm.ground is not None]
        return Stop(grounds, cuts, page, self._length, value, widest <= self._aim)


def fill_pages(cascade: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """Cut charts for the pages that were asked for, or so that they fit at a fixed density; a note tells it.

    There are never more charts than ``options.max_charts``, nor parts of fewer faces than
    ``options.min_chart_faces``.
    """
    cascade = fallback.settle(cascade, monitor)
    cut_mesh, uv = cascade.atlas.open()
    most = np.inf if options.max_charts is None else options.max_charts - cut_mesh.n_charts
    if most < 1 or monitor.expired or not np.isfinite(uv).all():
        return cascade
    cutter, page = atlas_cutter(cascade, cut_mesh, uv, options), pack_options(options)
    cuts = int(min(ARMS if options.cuts_asked is None else options.cuts_asked, most))
    scale, longer = page.fixed_scale, np.inf
    side = None if scale is None else (page.resolution - 2 * page.border) / scale
    if side is None and options.cuts_asked is None:  # so much may be added for each page
        length = boundary_length(cut_mesh, at_best_scales(cut_mesh, uv))
        longer = LIMIT * page.pages * length
    before = float(cutter.chart_cutter.stretched(Opened(cascade.atlas, cut_mesh, uv)).sum())
    spared = max(SPARED * float(cascade.atlas.surface.areas.sum()) - before, 0.0)
    if side is not None:
        return _fitted(cascade, cutter, options, monitor, (side, spared, cuts))
    stops: list[Stop] = []
    for careful in (False, True):
        stops += Divider(cutter, longer, spared, cuts, page.pages, None).stops(careful, monitor)
    return _fullest(cascade, cutter, stops, options, monitor)


def _fitted(
    cascade: Cascade, cutter: AtlasCutter, options: Options, monitor: Monitor,
    room: tuple[float, float, int],
) -> Cascade:  # fmt: skip
    """The layout with the fewest cuts that can be packed at a fixed size; unchanged if none are enough.

    room: side of a page in uv, area of faces that may be stretched too much, cuts at most.
    """
    side, spared, cuts = room
    limits = replace(
        cutter.chart_cutter.limits, flats=1.0
    )  # there is no layout otherwise: cut through flats too
    cutter = replace(cutter, chart_cutter=replace(cutter.chart_cutter, limits=limits))
    for share in SHARES:
        divider = Divider(cutter, np.inf, spared, cuts, options.pages or 1, share * side)
        stop = divider.stops(False, monitor)[-1]
        after = _cut(cascade, cutter, stop, options, monitor) if stop.cuts else cascade
        found = None if after is None or not stop.fits else packing(after, options, monitor)
        if after is not None and found is not None:
            return replace(after, packing=found)
    return cascade


def _fullest(
    cascade: Cascade, cutter: AtlasCutter, stops: list[Stop], options: Options, monitor: Monitor
) -> Cascade:
    """The stop whose packed pages are worth most beside the length of seams, none among them."""
    found = [(stops[0], cascade)]
    for stop in sorted((s for s in stops if s.value > 0), key=lambda s: -s.value):
        after = _cut(cascade, cutter, stop, options, monitor)
        found += [] if after is None else [(stop, after)]
        if len(found) > PACKED:
            break
    if len(found) == 1:
        return cascade
    tasks = [(after, options) for _, after in found]
    packings = Worker(monitor.jobs).map(_packing, tasks, monitor)
    pages = pack_options(options).pages
    values = [
        -np.inf if k is None else np.log(_share(k, pages)) - RATE * np.log(s.length)
        for (s, _), k in zip(found, packings, strict=True)
    ]
    k = int(np.argmax(values))
    return replace(found[k][1], packing=packings[k])


def _share(found: KnownPacking, pages: int) -> float:
    """Covered share of all pages that were asked for, the empty ones too."""
    return float(found.packed.share.sum()) / pages


def _packing(cascade: Cascade, options: Options, monitor: Monitor) -> KnownPacking | None:
    return packing(cascade, options, monitor)


def _cut(
    cascade: Cascade, cutter: AtlasCutter, stop: Stop, options: Options, monitor: Monitor
) -> Cascade | None:
    """The layout with the cuts of a stop, and a note; None if too much surface would be stretched."""
    atlas = cutter.joined(stop.grounds)
    if not stretch_kept(atlas, cascade.atlas, options, cascade.rules.bound, monitor):
        return None
    return replace(cascade, atlas=atlas).noted(_note(stop.cuts, cascade.atlas, atlas, options))


def _note(cuts: int, before: Atlas, after: Atlas, options: Options) -> str:
    """A note on the cuts, for the user."""
    old, new = before.seam_length, after.seam_length
    longer = f"{new / old - 1:.1%} longer" if old > 0 else f"{new:.2f} roots of the area long"
    what = "for charts that fit on a page"
    if options.texel_density is None:
        what = f"to fill {options.pages} pages"
    return f"{counted(cuts, 'cut')} {what} made the seams {longer} (--pack-splits 0 prevents this)"
