"""Parts of charts, and cuts that divide them along edges of the mesh.

A chord is a straight cut through a chart from boundary to boundary; it tells the shapes of both parts.
"""

from collections.abc import Iterable
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import cross2, ends_of, norms2, ranges
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.distortion import at_best_scales
from circparam.geometry.intersect import properly_cross
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing.outlines import ANGLE_STEPS
from circparam.pipeline.cut_along import Ground, Limits, cut_along, slit_open
from circparam.seams.cost import COST
from circparam.seams.hard.regions import hard_components
from circparam.seams.prices import edge_prices

CORNERS = ANGLE_STEPS  # of an outline along the side of the square that all charts cover
ANCHORS = 2 * ANGLE_STEPS  # points of an outline between which chords are tried


@dataclass(frozen=True, eq=False)
class Outline:
    """One chart as closed polygons with some of its boundary vertices.

    chart: its number. vertex: (k,) vertices of the cut mesh along the outer loop, p: (k, 2) their uv. holes:
    the corners (h, 2) of each.
    """

    chart: int
    vertex: IntArray
    p: FloatArray
    holes: list[FloatArray]

    @cached_property
    def edges(self) -> tuple[FloatArray, FloatArray]:
        """Starts and ends (e, 2) of the edges of all loops."""
        return closed([self.p, *self.holes])

    @cached_property
    def fans(self) -> FloatArray:
        """(k,) signed areas between the origin and each edge of the outer loop."""
        return cross2(self.p, np.roll(self.p, -1, axis=0)) / 2

    @cached_property
    def area(self) -> float:
        """Area inside, holes left out."""
        start, end = self.edges
        return float(cross2(start, end).sum() / 2)

    @property
    def ring(self) -> bool:
        """Whether a hole is larger than what lies round it."""
        around = [cross2(hole, np.roll(hole, -1, axis=0)).sum() / 2 for hole in self.holes]
        return bool(np.abs(around).max(initial=0.0) > self.area)


@dataclass(frozen=True, eq=False)
class Chords:
    """Chords of one outline from corner i to corner j, i < j: all (c,). Some may leave the outline.

    length: of each. least: area of the smaller part. box: sum of the least bounding boxes of both parts.
    square: side of the smallest square that holds either part. widest: box of the part that needs it.
    """

    outline: Outline
    i: IntArray
    j: IntArray
    length: FloatArray
    least: FloatArray
    box: FloatArray
    square: FloatArray
    widest: FloatArray

    def ends(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Both ends of chord k, each (2,)."""
        return self.outline.p[self.i[k]], self.outline.p[self.j[k]]

    def inside(self, k: int) -> bool:
        """Whether chord k crosses no edge of the outline, and its middle lies inside."""
        a, b = self.ends(k)
        start, end = self.outline.edges
        here, there = np.broadcast_to(a, start.shape), np.broadcast_to(b, start.shape)
        if properly_cross(here, there, start, end).any():
            return False
        middle = (a + b)[None] / 2
        inside = within(self.outline.p, middle)[0]
        return bool(inside and not any(within(hole, middle)[0] for hole in self.outline.holes))


@dataclass(frozen=True, eq=False)
class Part:
    """A chart, or a part of a chart after cuts.

    outline: scaled to the size of the surface. places: (k, 2) uv of its corners in the atlas. ground: None if
    nothing was cut. slit: length of the slit that opens it. drawn: cut along chords themselves, so nothing but
    the outline is known. failed: numbers of the chords along which no cut could be made.
    """

    outline: Outline
    places: FloatArray
    ground: Ground | None
    slit: float = 0.0
    drawn: bool = False
    failed: set[int] = field(default_factory=set)

    @cached_property
    def frames(self) -> tuple[float, float]:
        """Area of the least bounding box, side of the least square."""
        box, square = least_frames(np.ptp(turned(self.outline.p), axis=0)).tolist()
        return box, square

    @property
    def box(self) -> float:
        """Area of the least bounding box."""
        return self.frames[0]

    @property
    def square(self) -> float:
        """Side of the least square."""
        return self.frames[1]

    @cached_property
    def chords(self) -> Chords:
        """The chords of its outline."""
        return chords(self.outline)


@dataclass(frozen=True, eq=False)
class Cutter:
    """The maker of cuts in an atlas. limits: of both parts of a cut.

    through_flats: whether a cut through a flat of the design costs its length alone. grounds: of charts that
    were to be cut. slits: of rings.
    """

    atlas: Atlas
    limits: Limits
    through_flats: bool
    grounds: dict[int, Ground] = field(default_factory=dict)
    slits: dict[Part, Part | None] = field(default_factory=dict)

    @cached_property
    def cut_mesh(self) -> CutMesh:
        """The atlas cut open."""
        return self.atlas.cut_mesh()

    @cached_property
    def root(self) -> float:
        """Root of the area of the surface, the unit of all lengths of seams."""
        return float(np.sqrt(self.atlas.surface.areas.sum()))

    @cached_property
    def charts(self) -> list[Part]:
        """All charts as they are; charts without an outline are left out."""
        uv = self.atlas.gather(self.cut_mesh)
        shapes = outlines(self.cut_mesh, at_best_scales(self.cut_mesh, uv), self.root / CORNERS)
        return [Part(outline, uv[outline.vertex], None) for outline in shapes]

    def worth_trying(self, part: Part, k: int) -> bool:
        """Whether chord k lies inside its part, and no cut failed along a chord within two corners of it."""
        chords, failed = part.chords, list(part.failed)
        p, i, j = part.outline.p, chords.i, chords.j
        away = norms2(p[i[failed]] - p[i[k]]) + norms2(p[j[failed]] - p[j[k]])
        return not (away < 2 * self.root / CORNERS).any() and chords.inside(k)

    def cut(self, part: Part, k: int) -> tuple[list[Part], float] | None:
        """(both parts of a part cut near its chord k, length of the seam at the user's prices), or None."""
        start, end = (part.places[at[k]] for at in (part.chords.i, part.chords.j))
        ground, least = self.ground_of(part), float(part.chords.least[k])
        after = cut_along(ground, start, end, least, self.limits)
        if after is not None:
            chart = after.charts()[1]
            parts = [p for c in (0, 1) for p in self._parts(ground.part(after, chart == c))]
            if len(parts) == 2:
                return parts, self._priced(ground, after)
        part.failed.add(k)
        return None

    def straight_parts(self, part: Part, k: int) -> list[Part]:
        """Both parts of a part cut along its chord k itself, as outlines alone."""
        shown, i, j = part.outline, int(part.chords.i[k]), int(part.chords.j[k])
        corners = np.arange(len(shown.p))
        parts = []
        for mine in (corners[i : j + 1], np.r_[corners[j:], corners[: i + 1]]):
            p = shown.p[mine]
            holes = [hole for hole in shown.holes if within(p, hole[:1])[0]]
            outline = Outline(shown.chart, shown.vertex[mine], p, holes)
            parts.append(Part(outline, part.places[mine], None, drawn=True))
        return parts

    def slit(self, part: Part) -> Part | None:
        """A ring that is opened by a slit, None if none leads across it."""
        if part not in self.slits:
            ground = self.ground_of(part)
            after, self.slits[part] = slit_open(ground), None
            if after is not None:
                slit = part.slit + self._priced(ground, after)
                for one in self._parts(ground.part(after, np.ones(len(ground.faces), bool))):
                    self.slits[part] = replace(one, slit=slit)
        return self.slits[part]

    def _priced(self, ground: Ground, after: Atlas) -> float:
        """Length of the seams that are new on a ground, at the user's prices."""
        new = after.cut & ~ground.atlas.cut
        length = after.surface.priced_lengths[new]
        if not self.through_flats:
            length = length * (1 + COST.flat * ground.flat[new])
        return float(length.sum())

    def _parts(self, ground: Ground) -> list[Part]:
        """The one chart of a ground, none without an outline."""
        cut_mesh, uv = ground.opened
        shapes = outlines(cut_mesh, at_best_scales(cut_mesh, uv), self.root / CORNERS)
        return [Part(replace(o, chart=ground.chart), uv[o.vertex], ground) for o in shapes]

    def ground_of(self, part: Part) -> Ground:
        """The ground on which a part is cut."""
        chart = part.outline.chart
        if part.ground is not None:
            return part.ground
        if chart not in self.grounds:
            surface, mine = self.atlas.surface, self.cut_mesh.chart == chart
            left, right = surface.sides
            near = mine.copy()  # with the neighbours, which show where a flat chart ends
            near[left[mine[right]]] = near[right[mine[left]]] = True
            around = surface.part(near)
            prices = edge_prices(around, hard_components(around))
            costs = np.where(around.locked, np.inf, around.priced_lengths) * prices.price
            inner = surface.inner_edges(mine)[surface.inner_edges(near)]
            faces, own = np.flatnonzero(mine), self.atlas.part(mine)
            self.grounds[chart] = Ground(chart, faces, own, costs[inner], prices.flat[inner])
        return self.grounds[chart]


def joined(before: Atlas, parts: Iterable[Part]) -> Atlas:
    """An atlas with the cuts between parts of its charts."""
    surface = before.surface
    label = np.zeros(len(surface.faces), np.int64)
    after = Atlas(surface, before.cut, before.corners, before.prices)
    grounds = [part.ground for part in parts if part.ground is not None]
    for number, ground in enumerate(grounds):
        label[ground.faces] = number + 1
        after.corners[ground.faces] = ground.atlas.corners
    after.cut |= label[surface.sides[0]] != label[surface.sides[1]]
    return after


def closed(loops: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Starts and ends (e, 2) of the edges of closed polygons."""
    return np.concatenate(loops), np.concatenate([np.roll(q, -1, axis=0) for q in loops])


def outlines(cut_mesh: CutMesh, uv: FloatArray, step: float) -> list[Outline]:
    """The outlines of all charts, in their order; corners ``step`` apart, charts without three left out."""
    loops = cut_mesh.loops
    vertex, ahead = ends_of(cut_mesh.faces, loops.half_edges)
    p = uv[vertex]
    length = np.sqrt(((uv[ahead] - p) ** 2).sum(1))
    at = np.cumsum(length) - length
    at -= at[loops.start[:-1]][loops.loop_of]
    rung = np.floor(at / step)
    kept = np.r_[True, (rung[1:] != rung[:-1]) | (loops.loop_of[1:] != loops.loop_of[:-1])]
    corners = [k[kept[k]] for k in np.split(np.arange(len(p)), loops.start[1:-1])]
    holes: dict[int, list[FloatArray]] = {}
    for k in np.flatnonzero(~loops.outer).tolist():
        if len(corners[k]) > 2:
            holes.setdefault(int(loops.chart[k]), []).append(p[corners[k]])
    outer = {int(loops.chart[k]): corners[k] for k in np.flatnonzero(loops.outer)}
    return [
        Outline(chart, vertex[k], p[k], holes.get(chart, []))
        for chart, k in sorted(outer.items())
        if len(k) > 2
    ]


def chords(outline: Outline, anchors: int = ANCHORS) -> Chords:
    """Chords between points of an outline: for each point the shortest ones."""
    p = outline.p
    pick = np.unique(np.linspace(0, len(p), anchors, endpoint=False).astype(np.int64))
    k = len(pick)
    q = p[pick]
    gap = np.sqrt(((q[:, None] - q[None]) ** 2).sum(2))
    apart = np.abs(np.arange(k)[:, None] - np.arange(k)[None])
    apart = np.minimum(apart, k - apart)
    # from each point the ends that are nearer than those beside them, and those nearer than from points beside
    far = np.where(apart < 2, np.inf, gap)
    near = (far <= np.roll(far, 1, 1)) & (far <= np.roll(far, -1, 1))
    near |= near.T
    i, j = np.nonzero(np.triu(near & np.isfinite(far)))
    total = float(outline.fans.sum())
    cumulative = np.r_[0.0, np.cumsum(outline.fans)]
    first = cumulative[pick[j]] - cumulative[pick[i]] + cross2(q[j], q[i]) / 2
    box, square = extents(p, pick, np.r_[i, j], np.r_[j - i, k - j + i]).reshape(2, 2, -1)
    widest = np.where(square[0] > square[1], box[0], box[1])
    least = np.minimum(first, total - first)
    return Chords(outline, pick[i], pick[j], gap[i, j], least, box.sum(0), square.max(0), widest)


def turned(points: FloatArray) -> FloatArray:
    """(k, ANGLE_STEPS, 2) coordinates of points (k, 2) in frames turned within a quarter turn."""
    t = np.arange(ANGLE_STEPS) * (np.pi / 2 / ANGLE_STEPS)
    x = points @ np.stack([np.cos(t), np.sin(t)])
    y = points @ np.stack([-np.sin(t), np.cos(t)])
    return np.stack([x, y], -1)


def least_frames(size: FloatArray) -> FloatArray:
    """(2, ...) area of the least bounding box and side of the least square, of sizes (..., ANGLE_STEPS, 2)."""
    return np.stack([size.prod(-1).min(-1), size.max(-1).min(-1)])


def extents(p: FloatArray, pick: IntArray, first: IntArray, pieces: IntArray) -> FloatArray:
    """(2, c) least box (area) and least square (side) of a stretch of boundary. The stretch begins at anchor
    ``first`` (c,) and has ``pieces`` (c,) ≥ 1 parts between anchors.

    Two halves give the extents of twice as many pieces. Two overlapping stretches give any number.
    """
    k = len(pick)
    along = turned(p)
    count = np.diff(np.r_[pick, pick[0] + len(p)]) + 1
    index = (np.repeat(pick, count) + ranges(count)) % len(p)
    start = np.cumsum(count) - count
    # both directions at once: the lowest points are the highest of the mirrored chart
    reach = np.maximum.reduceat(np.concatenate([along, -along], -1)[index], start)
    known = [reach]
    for length in (2**n for n in range(int(pieces.max(initial=1)).bit_length() - 1)):
        reach = np.maximum(reach, np.roll(reach, -length, 0))
        known.append(reach)
    level = np.frexp(pieces)[1] - 1  # of the largest power of two that is no more
    table = np.stack(known)
    last = (first + pieces - 2**level) % k
    top = np.maximum(table[level, first], table[level, last])
    return least_frames(top[..., :2] + top[..., 2:])


def within(polygon: FloatArray, points: FloatArray) -> BoolArray:
    """(p,) bool: the points (p, 2) that lie in a polygon (k, 2)."""
    a, b = polygon[:, None], np.roll(polygon, -1, axis=0)[:, None]
    crossed = (a[..., 1] > points[:, 1]) != (b[..., 1] > points[:, 1])
    rise = np.where(crossed, b[..., 1] - a[..., 1], 1.0)
    x = a[..., 0] + (points[:, 1] - a[..., 1]) / rise * (b[..., 0] - a[..., 0])
    return np.asarray((crossed & (x > points[:, 0])).sum(0) % 2 == 1)
