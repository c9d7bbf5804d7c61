"""Pieces of charts, the parts of a plan of cuts. Every cut of a plan is made along the edges of the mesh at
once. A plan therefore knows the length of its seams, and all its cuts are possible."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.geometry.distortion import at_best_scales, face_stretch
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.packing.nest.sketch import Sketch, SketchGrid
from circparam.pipeline.chords import Chords, Outline, chords, outlines, split
from circparam.pipeline.cut_along import Chord, Limits, Opened, cut_along
from circparam.seams.hard.regions import HARD, hardness
from circparam.seams.prices import designed_flats, edge_prices
from circparam.seams.segmentation.weigh import share_over

LONGEST = 512  # cells of a sketch: a longer chart is a sliver and gets no sketch
UNSEEN = 0.003  # of all seams: length of a cut that may always lead through flats
STEP = 0.35  # cells of a sketch between the corners of an outline

# both parts of a piece, length of the seam between them, area of the faces that are stretched too much then and
# were not
Cut: TypeAlias = "tuple[list[Piece], float, float]"


@dataclass(frozen=True, eq=False)
class Ground:
    """The atlas of one chart, on which it can be cut. faces: (k,) those of the whole.

    costs: (e,) of a cut along each edge. flat: (e,) bool, edges inside flats that are meant. stretched: area of
    its faces that are stretched too much. chart: which it is or was a part of.
    """

    chart: int
    faces: IntArray
    opened: Opened
    costs: FloatArray
    flat: BoolArray
    stretched: float

    @property
    def atlas(self) -> Atlas:
        """Its atlas."""
        return self.opened.atlas

    def part(self, after: Atlas, mine: BoolArray, stretched: float) -> Ground:
        """The part on some faces (bool) of the atlas after a cut."""
        inside = mine[self.atlas.surface.edges // 3].all(1)
        opened = Opened.of(after.part(mine))
        costs, flat = self.costs[inside], self.flat[inside]
        return Ground(self.chart, self.faces[mine], opened, costs, flat, stretched)


@dataclass(frozen=True, eq=False)
class Part:
    """A chart, or a part of a chart after cuts. outline: scaled to the size of the surface. places: (k, 2) uv
    of its corners in the atlas. ground: None if nothing was cut."""

    outline: Outline
    places: FloatArray
    ground: Ground | None

    @cached_property
    def chords(self) -> Chords:
        """The chords of its outline."""
        return chords(self.outline)


@dataclass(frozen=True, eq=False)
class Piece(Part):
    """A part with its sketch. known, halves: results of cuts along its chords, and parts of straight cuts;
    plans share pieces."""

    sketch: Sketch
    known: dict[int, Cut | None] = field(default_factory=dict)
    halves: dict[int, Halves] = field(default_factory=dict)


@dataclass(eq=False)
class Halves:
    """Both parts of a straight cut through a piece: outlines, and their sketches on demand."""

    outlines: tuple[Outline, Outline]
    found: list[Sketch] = field(default_factory=list)

    def sketches(self, chart_cutter: ChartCutter) -> list[Sketch]:
        """The sketches of both."""
        self.found = self.found or [chart_cutter.sketch(part) for part in self.outlines]
        return self.found


@dataclass(frozen=True, eq=False)
class ChartCutter:
    """State that all cuts of an atlas share and that other processes receive.

    grid: of the sketches of pieces. limits: of both parts of a cut. sign: (n_charts,) −1 for charts that are
    packed mirrored, else 1. seams: length of all that there are. stretch: from which on faces are stretched too
    much.
    """

    grid: SketchGrid
    limits: Limits
    sign: FloatArray
    seams: float
    stretch: float = np.inf

    def sketch(self, outline: Outline) -> Sketch:
        """An outline as packed, mirrored with its chart."""
        start, end = outline.edges
        if self.sign[outline.chart] < 0:
            start, end = end * [-1, 1], start * [-1, 1]
        return self.grid.sketch(start, end)

    def cut(self, ground: Ground, chord: Chord) -> Cut | None:
        """A chart cut along edges near a chord; None if that cannot be."""
        found = self.divided(ground, chord)
        if found is None:
            return None
        grounds, length, stretched = found
        parts = [
            p for part in grounds for p in self.pieces(part.opened, np.zeros(1, np.int64), part)
        ]
        return None if len(parts) < 2 else (parts, length, stretched)

    def divided(self, ground: Ground, chord: Chord) -> tuple[list[Ground], float, float] | None:
        """(both parts of a chart cut along edges near a chord, length of the seam between them, further area
        stretched too much); None if the cut is impossible."""
        opened = cut_along(ground.opened, chord, ground.costs, self.limits)
        if opened is None:
            return None
        after = opened.atlas
        new = after.cut & ~ground.atlas.cut
        lengths = after.surface.edge_lengths
        length = float(lengths[new].sum())
        through = max(self.limits.flats * length, UNSEEN * self.seams)
        if float(lengths[new & ground.flat].sum()) > through:
            return None
        stretched = self.stretched(opened)
        label = opened.cut_mesh.chart
        parts = [ground.part(after, label == c, float(stretched[c])) for c in (0, 1)]
        return parts, length, float(stretched.sum()) - ground.stretched

    def stretched(self, opened: Opened) -> FloatArray:
        """(n_charts,) area of the faces of each chart that are stretched or shrunk too much."""
        cut_mesh = opened.cut_mesh
        if not np.isfinite(self.stretch):
            return np.zeros(cut_mesh.n_charts)
        over = share_over(cut_mesh, face_stretch(cut_mesh, opened.uv), self.stretch)
        return np.asarray(over * cut_mesh.chart_areas.sum())

    def pieces(self, opened: Opened, charts: IntArray, ground: Ground | None = None) -> list[Piece]:
        """Some charts as they are; those without an outline are left out, all where one is a sliver."""
        cut_mesh, uv = opened.cut_mesh, opened.uv
        shown = outlines(cut_mesh, at_best_scales(cut_mesh, uv), charts, STEP * self.grid.cell)
        if any(np.ptp(o.p, axis=0).max() > LONGEST * self.grid.cell for o in shown):
            return []
        if ground is not None:
            shown = [replace(o, chart=ground.chart) for o in shown]
        return [Piece(o, uv[o.vertex], ground, self.sketch(o)) for o in shown]


@dataclass(frozen=True, eq=False)
class AtlasCutter:
    """The maker of cuts in an atlas. cut_mesh, uv: the atlas opened. grounds: of the charts that a cut was
    tried on."""

    atlas: Atlas
    cut_mesh: CutMesh
    uv: FloatArray
    chart_cutter: ChartCutter
    grounds: dict[int, Ground] = field(default_factory=dict)

    @property
    def grid(self) -> SketchGrid:
        """The grid of all sketches."""
        return self.chart_cutter.grid

    def pieces(self, charts: IntArray) -> list[Piece]:
        """Some charts as they are; those without an outline are left out, all where one is a sliver."""
        return self.chart_cutter.pieces(Opened(self.atlas, self.cut_mesh, self.uv), charts)

    def halves(self, piece: Piece, k: int) -> Halves:
        """Both parts of a piece that is cut straight along its chord k."""
        if k not in piece.halves:
            i, j = int(piece.chords.i[k]), int(piece.chords.j[k])
            piece.halves[k] = Halves(split(piece.outline, i, j))
        return piece.halves[k]

    def task(self, part: Part, k: int) -> tuple[Ground, Chord]:
        """Arguments of ``ChartCutter.cut`` for a cut of a part near its chord k."""
        start, end = (part.places[int(at[k])] for at in (part.chords.i, part.chords.j))
        ground = part.ground or self._ground(part.outline.chart)
        return ground, Chord(start, end, float(part.chords.least[k]))

    def joined(self, grounds: Iterable[Ground]) -> Atlas:
        """The whole atlas with the cuts between parts of its charts."""
        surface = self.atlas.surface
        label = np.zeros(len(surface.faces), np.int64)
        after = Atlas(surface, self.atlas.cut, self.atlas.corners, self.atlas.prices)
        for number, ground in enumerate(grounds):
            label[ground.faces] = number + 1
            after.corners[ground.faces] = ground.atlas.corners
        after.cut |= np.diff(label[surface.edges // 3], axis=1)[:, 0] != 0
        return after

    def _ground(self, chart: int) -> Ground:
        if chart not in self.grounds:
            mine = self.cut_mesh.chart == chart
            surface = self.atlas.surface
            sides = surface.edges // 3
            near = mine.copy()  # with the neighbours, which show where a flat chart ends
            near[sides[mine[sides].any(1)]] = True
            costs, flat = _costs(surface.part(near))
            inner = mine[sides[near[sides].all(1)]].all(1)
            opened = Opened.of(self.atlas.part(mine))
            stretched = float(self.chart_cutter.stretched(opened).sum())
            self.grounds[chart] = Ground(
                chart, np.flatnonzero(mine), opened, costs[inner], flat[inner], stretched
            )
        return self.grounds[chart]


def _costs(surface: Surface) -> tuple[FloatArray, BoolArray]:
    """((e,) price of a cut along each edge, (e,) bool: edges inside flats of the design)."""
    cost = np.where(surface.locked, np.inf, surface.priced_lengths)
    prices = edge_prices(surface, hardness(surface) == HARD)
    return cost * prices.price, prices.flat | designed_flats(surface)
