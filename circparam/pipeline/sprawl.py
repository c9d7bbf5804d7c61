"""Arms cut off charts that sprawl, on pages of so many charts that sketches tell little of each.

A frame, a comb or a letter L keeps most of its bounding box from others. The estimate of the page is the
covered area and a share of the empty part of the least boxes (``KEPT``). The estimate is at least the least
square of the widest chart. A cut is made if the saved area is worth its seam (``RATE`` in ``cut_plan``), the
most worthwhile first. No page is laid out.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, stable_order
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.geometry.distortion import at_best_scales
from circparam.mesh.cut_mesh import CutMesh
from circparam.pipeline.chords import least_frames, outlines, turned
from circparam.pipeline.cut_along import Opened
from circparam.pipeline.cut_plan import RATE, ZIGZAG, boundary_length
from circparam.pipeline.pieces import AtlasCutter, Ground, Part

# of the empty part of a chart's box: the share lost to other charts, for nested charts and for many charts,
# which are laid out by boxes
KEPT, KEPT_OF_MANY, MANY = 0.5, 1.0, 250
FILLED = 0.85  # of a page, at most
WASTE = 0.003  # of all boxes: least empty part of a chart that is examined
CORNERS = 300  # of an outline, along the side of the square that all charts cover
# least gain of a cut, its seam deducted: of the logarithm of the page, and COUNT times the logarithm of the
# number of charts
SAVED, COUNT = 4e-3, 0.1
TRIES = 4  # chords of a chart along which no cut could be made before it is left
APART = 0.01  # of the same side: chords nearer to a failed chord fail too


@dataclass(frozen=True, eq=False)
class Trimmed:
    """The result of the cuts. grounds: of the charts that were cut, a row for each part. cuts: how many. value:
    logarithm of the saved share of the estimated page, less the price of the seams. before, length: of all
    boundaries, without and with them."""

    grounds: list[Ground]
    cuts: int
    value: float
    before: float
    length: float


@dataclass(frozen=True, eq=False)
class Arm(Part):
    """A part with the area of its least box and the side of its least square. failed: ends (4,) of chords along
    which no cut could be made."""

    box: float
    square: float
    failed: list[FloatArray] = field(default_factory=list)

    @cached_property
    def ends(self) -> FloatArray:
        """(c, 4) both ends of each chord."""
        p = self.outline.p
        return np.hstack([p[self.chords.i], p[self.chords.j]])


class Trimmer:
    """Cuts arms off the charts of an atlas. longer: length that all seams may have. spared: area of faces that
    may be stretched too much. cuts: at most."""

    def __init__(self, cutter: AtlasCutter, longer: float, spared: float, cuts: int) -> None:
        cut_mesh, uv = cutter.cut_mesh, at_best_scales(cutter.cut_mesh, cutter.uv)
        self._cutter, self._spared, self._cuts = cutter, spared, cuts
        self._area = float(cut_mesh.chart_areas.sum())
        self._charts = cut_mesh.n_charts
        self._kept = KEPT_OF_MANY if cut_mesh.n_charts > MANY else KEPT
        self._step = float(np.sqrt(self._area)) / CORNERS
        box, square = _extents(cut_mesh, uv)
        self._box, self._length = float(box.sum()), boundary_length(cut_mesh, uv)
        self._longest, self._stretched = self._length + longer, 0.0
        looked_at = self._looked_at(box, square)
        self._others = float(square[~looked_at].max(initial=0.0))
        opened = Opened(cutter.atlas, cut_mesh, cutter.uv)
        self._arms = self._find_arms(opened, np.flatnonzero(looked_at))

    def run(self, monitor: Monitor) -> Trimmed:
        """Make the cuts."""
        first, before, made = self._page(self._box, self._widest()), self._length, 0
        while made < self._cuts and not monitor.expired:
            arm, k = self._best()
            if arm is None:
                break
            made += self._cut(arm, k)
        saved = np.log(first / self._page(self._box, self._widest()))
        value = float(saved - RATE * np.log(self._length / before))
        grounds = [arm.ground for arm in self._arms if arm.ground is not None]
        return Trimmed(grounds, made, value, before, self._length)

    def _looked_at(self, box: FloatArray, square: FloatArray) -> BoolArray:
        """(n_charts,) bool: charts that may be cut because much of their box is empty."""
        wasteful: BoolArray = box - self._cutter.cut_mesh.chart_areas > WASTE * self._box
        return wasteful

    def _page(self, box: FloatArray | float, square: FloatArray | float) -> FloatArray:
        """Area of the page, for the sum of all boxes and the side of the widest square."""
        wanted = self._area + self._kept * (np.asarray(box) - self._area)
        return np.maximum(wanted / FILLED, np.square(square))

    def _widest(self, without: Arm | None = None) -> float:
        """Side of the widest least square of all charts."""
        return max([self._others, *(a.square for a in self._arms if a is not without)])

    def _best(self) -> tuple[Arm | None, int]:
        """The most worthwhile chord and its arm; None if no chord pays."""
        now = self._page(self._box, self._widest())
        chart = COUNT * np.log1p(1 / self._charts)
        best: tuple[Arm | None, int] = (None, -1)
        most = SAVED
        for arm in self._arms:
            found = arm.chords
            if not len(found.length) or len(arm.failed) == TRIES:
                continue
            square = np.maximum(found.square, self._widest(arm))
            longer = ZIGZAG * found.length
            gain = np.log(now / self._page(self._box - arm.box + found.box, square))
            gain -= RATE * np.log1p(longer / self._length) + chart
            gain[self._length + longer > self._longest] = -np.inf
            gain[self._tried(arm)] = -np.inf
            k = int(gain.argmax())
            if gain[k] > most:
                best, most = (arm, k), float(gain[k])
        return best

    def _tried(self, arm: Arm, apart: float = APART) -> BoolArray:
        """(c,) bool: chords of a chart near one along which no cut could be made."""
        near = np.zeros(len(arm.ends), bool)
        for ends in arm.failed:
            near |= np.abs(arm.ends - ends).max(1) < apart * self._step * CORNERS
        return near

    def _cut(self, arm: Arm, k: int) -> bool:
        """Cut a chart near one of its chords; whether that could be done."""
        done = self._cutter.chart_cutter.divided(*self._cutter.task(arm, k))
        only = np.zeros(1, np.int64)
        parts = (
            [] if done is None else [a for g in done[0] for a in self._find_arms(g.opened, only, g)]
        )
        if done is None or len(parts) != 2 or not self._room(done[1], done[2]):
            arm.failed.append(arm.ends[k])
            return False
        self._charts += 1
        self._length += done[1]
        self._stretched += done[2]
        self._box += sum(part.box for part in parts) - arm.box
        self._arms = [a for a in self._arms if a is not arm] + parts
        return True

    def _room(self, length: float, stretched: float) -> bool:
        longer, more = self._length + length, self._stretched + stretched
        return longer <= self._longest and more <= self._spared

    def _find_arms(
        self, opened: Opened, which: IntArray, ground: Ground | None = None
    ) -> list[Arm]:
        """Some charts of an atlas, that of a ground if there is one; those without an outline are left out."""
        cut_mesh, uv = opened.cut_mesh, opened.uv
        arms = []
        for shown in outlines(cut_mesh, at_best_scales(cut_mesh, uv), which, self._step):
            outline = shown if ground is None else replace(shown, chart=ground.chart)
            box, square = least_frames(np.ptp(turned(outline.p), axis=0)).tolist()
            arms.append(Arm(outline, uv[outline.vertex], ground, box, square))
        return arms


def _extents(cut_mesh: CutMesh, uv: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n_charts,) area of the least box of each chart, and side of its least square."""
    h = cut_mesh.boundary
    own = cut_mesh.chart[h // 3]
    order = stable_order(own)
    along = turned(uv[cut_mesh.faces.ravel()[h[order]]])
    start = np.searchsorted(own[order], np.arange(cut_mesh.n_charts))
    low, high = np.minimum.reduceat(along, start), np.maximum.reduceat(along, start)
    box, square = least_frames(high - low)
    return box, square
