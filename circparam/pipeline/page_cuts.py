"""Parts of charts, and cuts that divide them along edges of the mesh."""

from collections.abc import Iterable
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.geometry.distortion import at_best_scales
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.packing.outlines import ANGLE_STEPS
from circparam.pipeline.chords import Chords, Outline, chords, least_frames, outlines, turned
from circparam.pipeline.cut_along import Chord, Limits, Opened, cut_along
from circparam.seams.cost import COST
from circparam.seams.hard.regions import hard_components
from circparam.seams.prices import edge_prices

CORNERS = ANGLE_STEPS  # of an outline along the side of the square that all charts cover


@dataclass(frozen=True, eq=False)
class Ground:
    """The atlas of one chart, on which it can be cut.

    chart: the chart that it is or was a part of. faces: (k,) those of the whole. costs: (e,) of a cut along
    each edge, infinite where none may lead. flat: (e,) bool, edges inside flats of the design.
    """

    chart: int
    faces: IntArray
    opened: Opened
    costs: FloatArray
    flat: BoolArray

    def part(self, after: Atlas, mine: BoolArray) -> "Ground":
        """The part on some faces (bool) of the atlas after a cut."""
        inside = after.surface.inner_edges(mine)
        opened = Opened.of(after.part(mine))
        return Ground(self.chart, self.faces[mine], opened, self.costs[inside], self.flat[inside])


@dataclass(frozen=True, eq=False)
class Part:
    """A chart, or a part of a chart after cuts.

    outline: scaled to the size of the surface. places: (k, 2) uv of its corners in the atlas. opened, label:
    the atlas that it is a chart of, and its number there. ground: None if nothing was cut. box, square: area
    of the least bounding box, side of the least square. failed: numbers of the chords along which no cut could
    be made.
    """

    outline: Outline
    places: FloatArray
    opened: Opened
    label: int
    ground: Ground | None
    box: float
    square: float
    failed: set[int] = field(default_factory=set)

    @cached_property
    def chords(self) -> Chords:
        """The chords of its outline."""
        return chords(self.outline)


@dataclass(frozen=True, eq=False)
class Cutter:
    """The maker of cuts in an atlas, ``whole``. limits: of both parts of a cut.

    through_flats: whether a cut through a flat of the design costs its length alone. grounds: of charts that
    were to be cut.
    """

    whole: Opened
    limits: Limits
    through_flats: bool
    grounds: dict[int, Ground] = field(default_factory=dict)

    @cached_property
    def root(self) -> float:
        """Root of the area of the surface, the unit of all lengths of seams."""
        return float(np.sqrt(self.whole.atlas.surface.areas.sum()))

    @cached_property
    def charts(self) -> list[Part]:
        """All charts as they are; charts without an outline are left out."""
        return self._parts(self.whole, np.arange(self.whole.cut_mesh.n_charts), None)

    def cut(self, part: Part, k: int) -> tuple[list[Part], float] | None:
        """(both parts of a part cut near its chord k, length of the seam at the user's prices), or None."""
        i, j = int(part.chords.i[k]), int(part.chords.j[k])
        chord = Chord(part.places[i], part.places[j], float(part.chords.least[k]))
        ground = part.ground or self._ground(part.outline.chart)
        opened = cut_along(ground.opened, chord, ground.costs, self.limits)
        parts: list[Part] = []
        if opened is not None:
            after, label = opened.atlas, opened.cut_mesh.chart
            for c in (0, 1):
                piece = ground.part(after, label == c)
                parts += self._parts(piece.opened, np.zeros(1, np.int64), piece)
            new = after.cut & ~ground.opened.atlas.cut
            length = after.surface.priced_lengths[new]
            if not self.through_flats:
                length = length * (1 + COST.flat * ground.flat[new])
            if len(parts) == 2:
                return parts, float(length.sum())
        part.failed.add(k)
        return None

    def _parts(self, opened: Opened, which: IntArray, ground: Ground | None) -> list[Part]:
        """Some charts of an atlas, that of a ground if there is one."""
        cut_mesh, uv = opened.cut_mesh, opened.uv
        found = []
        step = self.root / CORNERS
        for shown in outlines(cut_mesh, at_best_scales(cut_mesh, uv), which, step):
            outline = shown if ground is None else replace(shown, chart=ground.chart)
            box, square = least_frames(np.ptp(turned(outline.p), axis=0)).tolist()
            found.append(
                Part(outline, uv[outline.vertex], opened, shown.chart, ground, box, square)
            )
        return found

    def _ground(self, chart: int) -> Ground:
        if chart not in self.grounds:
            atlas = self.whole.atlas
            mine = self.whole.cut_mesh.chart == chart
            surface = atlas.surface
            left, right = surface.sides
            near = mine.copy()  # with the neighbours, which show where a flat chart ends
            near[left[mine[right]]] = near[right[mine[left]]] = True
            costs, flat = _costs(surface.part(near))
            inner = surface.inner_edges(mine)[surface.inner_edges(near)]
            opened = Opened.of(atlas.part(mine))
            self.grounds[chart] = Ground(
                chart, np.flatnonzero(mine), opened, costs[inner], flat[inner]
            )
        return self.grounds[chart]


def joined(before: Atlas, parts: Iterable[Part]) -> Atlas:
    """An atlas with the cuts between parts of its charts."""
    surface = before.surface
    label = np.zeros(len(surface.faces), np.int64)
    after = Atlas(surface, before.cut, before.corners, before.prices)
    grounds = [part.ground for part in parts if part.ground is not None]
    for number, ground in enumerate(grounds):
        label[ground.faces] = number + 1
        after.corners[ground.faces] = ground.opened.atlas.corners
    after.cut |= label[surface.sides[0]] != label[surface.sides[1]]
    return after


def _costs(surface: Surface) -> tuple[FloatArray, BoolArray]:
    """(e,) price of a cut along each edge, and (e,) bool: edges inside flats of hard parts."""
    cost = np.where(surface.locked, np.inf, surface.priced_lengths)
    prices = edge_prices(surface, hard_components(surface))
    return cost * prices.price, prices.flat
