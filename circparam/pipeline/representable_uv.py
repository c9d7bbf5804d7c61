"""The uv that a format can represent, and spoilt faces mended among them.

Rounding may turn over a needle narrower than the distance of two storable numbers. Its vertices then move among
the storable numbers near them. The sum of the violations of spoilt faces is convex in one vertex while the
others stay. Vertices that share no face (an independent set) therefore take the best place in their windows at
once, round by round. Signs are exact.
"""

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import (
    cross2,
    first_of_runs,
    group_count,
    group_max,
    group_sum,
    mask_of,
    positions_in,
)
from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.overlap import signs
from circparam.geometry.predicates import orientation

# uv (k, 2) → the nearest that can be stored, each coordinate for itself
Rounding: TypeAlias = Callable[[FloatArray], FloatArray]
# (which of the chosen vertices (c,), faces round them (c, 3), these at all places (c, w, 3, 2)) → cost (c, w)
Term: TypeAlias = Callable[[IntArray, IntArray, FloatArray], FloatArray]

REACH_NUMBERS = 3  # storable numbers to either side that a vertex looks at in one round
# storable numbers that a vertex may move in all. On a boundary 6 single-precision numbers are 0.006 texels of
# the largest page (16384), within the margin of packing. Inside a chart nothing is near.
FAR_NUMBERS, BOUNDARY_NUMBERS = 256, 6
CROWD_NUMBERS = 16  # storable numbers: vertices joined by shorter edges are a crowd
MOVE_ROUNDS = 60  # of moves in one search
PATIENCE_ROUNDS = 16  # rounds without fewer spoilt faces after which a search ends
# Spoilt faces, and their share, up to one of which a search pays. A layout with more is too small to be
# stored, and new maps give its faces their size back.
SPOILT_FACES, SPOILT_SHARE = 1000, 0.3
SMALLEST_STEP = 2.0**-60  # no step is finer than this: numbers next to zero are of no use
DOUBLINGS = (32, 16, 8, 4, 2, 1)  # all numbers up to 63 are sums of these
RAYS_PER_VERTEX = 6  # faces of a vertex, the largest, into which it looks
# of places on a ray, in storable numbers
RAY_NUMBERS = np.unique(np.round(2.0 ** (np.arange(25) / 2)))
CHUNK_PLACES = 2_000_000  # corners x places looked at together


@dataclass(frozen=True)
class PlaceSearch:
    """One way of looking for places. Crowds are first widened by the factor ``spread``. Vertices up to
    ``rings`` rings round the spoilt faces may move. Faces should hold ``room`` cells twice over. along:
    vertices look along ``rays`` into the faces round them, and not at their window.
    """

    spread: float
    rings: int
    room: float
    along: bool = False


# One after the other, each for the faces that the one before left. Test: 1500 spoilt faces round crowds of 40
# and 100 vertices in two to eight cells. The first two searches leave 8 %, the spreading ones 0.5 %. At the
# tip of a sliver the next place is as many numbers away as the sliver is narrow. Rays into the sliver reach
# that place, windows do not.
PLACE_SEARCHES = (
    PlaceSearch(1, 0, 0),
    PlaceSearch(1, 1, 0),
    PlaceSearch(1, 0, 0, along=True),
    PlaceSearch(3, 2, 2),
    PlaceSearch(9, 4, 4),
    PlaceSearch(27, 4, 4),
)


def following(x: FloatArray, rounding: Rounding, side: int) -> FloatArray:
    """The next storable number above (``side`` 1) or below (−1) each of the storable numbers x (k, 2).

    The step grows by doubling. The first step that rounds to another number is longer than half the distance to
    that number, and at most the whole distance. No number in between is skipped.
    """
    # below a power of two they are finer
    step = np.maximum(np.spacing(np.abs(x)) / 2, SMALLEST_STEP)
    doublings = np.zeros(x.shape, np.int64)  # by halves: single precision is 29 doublings away
    for some in DOUBLINGS:
        stuck = rounding(x + side * np.ldexp(step, doublings + some - 1)) == x
        doublings += np.where(stuck, some, 0)
    step = np.ldexp(step, doublings)
    out = rounding(x + side * step)
    while (stuck := out == x).any():
        step = np.where(stuck, 2 * step, step)
        out = np.where(stuck, rounding(x + side * step), out)
    return out


@dataclass(frozen=True, eq=False)
class Patch:
    """Faces (m, 3), counter-clockwise as they should lie, whose vertices move among storable numbers.

    exact: (n, 2) before rounding. on_boundary: (n,) bool, vertices that move by ``BOUNDARY_NUMBERS`` at most.
    """

    faces: IntArray
    exact: FloatArray
    on_boundary: BoolArray
    rounding: Rounding

    @cached_property
    def start(self) -> FloatArray:
        """(n, 2) where rounding alone puts the vertices."""
        return self.rounding(self.exact)

    def part(self, free: BoolArray) -> "tuple[Patch, IntArray, IntArray]":
        """The faces with free vertices ((n,) bool) alone; the numbers of these faces and of their vertices."""
        near = np.flatnonzero(free[self.faces].any(1))
        v, local = np.unique(self.faces[near], return_inverse=True)
        faces = local.reshape(-1, 3)
        return Patch(faces, self.exact[v], self.on_boundary[v], self.rounding), near, v

    def independent(self, active: BoolArray, number: IntArray) -> IntArray:
        """Active vertices ((n,) bool) with the highest number in all their faces: no two share a face."""
        own = np.where(active, number, -1)[self.faces]
        beaten = mask_of(len(active), self.faces[own < own.max(1)[:, None]])
        return np.flatnonzero(active & ~beaten)

    def in_turns(self, waiting: BoolArray, number: IntArray) -> Iterator[IntArray]:
        """All waiting vertices ((n,) bool) in independent sets, one after the other."""
        waiting = waiting.copy()
        while waiting.any():
            chosen = self.independent(waiting, number)
            waiting[chosen] = False
            yield chosen

    def around(self, chosen: IntArray) -> tuple[IntArray, IntArray]:
        """The faces round chosen vertices: (c,) which of ``chosen``, (c, 3) the face, that vertex first."""
        slot = positions_in(len(self.exact), chosen)
        corner = np.flatnonzero(slot[self.faces.ravel()] >= 0)
        turned = corner[:, None] // 3 * 3 + (corner[:, None] + np.arange(3)) % 3
        found = self.faces.ravel()[turned]
        return slot[found[:, 0]], found

    def places(self, x: FloatArray, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
        """((k, w, 2) storable numbers round chosen vertices at x, x in the middle; (k, 2) next − x)."""
        near = np.repeat(x[chosen][:, :, None], 2 * REACH_NUMBERS + 1, axis=2)  # in ascending order
        for k in range(1, REACH_NUMBERS + 1):
            for side in (1, -1):
                last = near[:, :, REACH_NUMBERS + side * (k - 1)]
                near[:, :, REACH_NUMBERS + side * k] = following(last, self.rounding, side)
        size = near.shape[2]
        grid = np.stack([np.repeat(near[:, 0], size, axis=1), np.tile(near[:, 1], (1, size))], 2)
        return grid, near[:, :, REACH_NUMBERS + 1] - near[:, :, REACH_NUMBERS]

    def rays(self, x: FloatArray, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
        """((k, w, 2) places of chosen vertices on rays, x itself in the middle; (k, 2) next − x).

        A ray leads from a vertex to the middle of the opposite edge of one of its largest faces. The places lie
        ``RAY_NUMBERS`` numbers out, none beyond that edge. Where a vertex has fewer faces, places are x once
        more.
        """
        step = following(x[chosen], self.rounding, 1) - x[chosen]
        own, around = self.around(chosen)
        at, b, c = x[around[:, 0]], x[around[:, 1]], x[around[:, 2]]
        order = np.lexsort((-np.abs(cross2(b - at, c - at)), own))
        own = own[order]
        first = first_of_runs(own)
        rank = np.arange(len(own)) - np.repeat(first, np.diff(np.r_[first, len(own)]))
        some = rank < RAYS_PER_VERTEX
        ray = np.zeros((len(chosen), RAYS_PER_VERTEX, 2))
        ray[own[some], rank[some]] = ((b + c) / 2 - at)[order][some]
        length = np.abs(ray / step[:, None]).max(2)
        share = RAY_NUMBERS / np.maximum(length, RAY_NUMBERS[-1])[..., None]
        out = x[chosen][:, None] + (ray[:, :, None] * share[..., None]).reshape(len(chosen), -1, 2)
        grid = self.rounding(out.reshape(-1, 2)).reshape(out.shape)
        half = grid.shape[1] // 2
        return np.concatenate([grid[:, :half], x[chosen][:, None], grid[:, half:]], 1), step

    def total(self, x: FloatArray, chosen: IntArray, grid: FloatArray, term: Term) -> FloatArray:
        """(k, w) sum of a term over the faces round each chosen vertex, with the vertex at each place."""
        own, around = self.around(chosen)
        w = grid.shape[1]
        out = np.zeros((len(chosen), w))
        for first in range(0, len(own), max(CHUNK_PLACES // w, 1)):
            part = slice(first, first + max(CHUNK_PLACES // w, 1))
            triangles = np.repeat(x[around[part]][:, None], w, axis=1)
            triangles[:, :, 0] = grid[own[part]]
            np.add.at(out, own[part], term(own[part], around[part], triangles))
        return out


def not_upright(triangles: FloatArray) -> BoolArray:
    """(...) whether triangles (..., 3, 2) are not counter-clockwise, exactly."""
    flat = triangles.reshape(-1, 3, 2)
    result: BoolArray = orientation(flat[:, 0], flat[:, 1], flat[:, 2]) <= 0
    return result.reshape(triangles.shape[:-2])


def mend_faces(patch: Patch) -> tuple[FloatArray, BoolArray]:
    """Round a layout, and move vertices among storable numbers until every face is upright, if possible.

    Returns storable uv (n, 2), and (m,) bool: faces that are still not upright. Layouts with over
    ``SPOILT_FACES`` spoilt faces are given up. So are faces that all ``PLACE_SEARCHES`` leave, with vertices up
    to ``FAR_NUMBERS`` numbers from their rounded places.
    """
    x, spoilt = patch.start.copy(), signs(patch.start, patch.faces) <= 0
    for search in PLACE_SEARCHES if spoilt.any() else ():
        if not 0 < spoilt.sum() <= max(SPOILT_FACES, SPOILT_SHARE * len(patch.faces)):
            break
        free = mask_of(len(x), patch.faces[spoilt])
        if search.along:
            free &= ~patch.on_boundary  # no ray is as short as those may move
        for _ in range(search.rings):
            free[patch.faces[free[patch.faces].any(1)]] = True
        part, near, v = patch.part(free)
        y = x[v]
        if search.spread > 1:
            crowd, place = _spread(part, free[v] & ~part.on_boundary, search.spread)
            y[crowd] = place
        y = _descend(part, y, free[v], search)
        after = signs(y, part.faces) <= 0
        if after.sum() < spoilt[near].sum():
            x[v], spoilt[near] = y, after
    return x, spoilt


def _spread(patch: Patch, inner: BoolArray, by: float) -> tuple[IntArray, FloatArray]:
    """(vertices, storable places) of crowds among the vertices that are ``inner``, scaled round their middles.

    Scaling keeps the signs of a crowd's own faces, and of faces that join the crowd to vertices outside its new
    width.
    """
    exact, start = patch.exact, patch.start
    step = np.zeros(len(exact))
    step[inner] = (following(start[inner], patch.rounding, 1) - start[inner]).max(1)
    a, b = patch.faces.ravel(), patch.faces[:, [1, 2, 0]].ravel()
    near = CROWD_NUMBERS * np.minimum(step[a], step[b])
    short = np.linalg.norm(exact[a] - exact[b], axis=1) < near
    crowd, label = np.unique(np.r_[a[short], b[short]], return_inverse=True)
    half = int(short.sum())
    n, label = components(len(crowd), label[:half], label[half:])
    middle = group_sum(exact[crowd], label, n) / group_count(label, n)[:, None]
    away = exact[crowd] - middle[label]
    width = group_max(np.abs(away).max(1) / step[crowd], label, n)
    times = np.minimum(by, np.maximum(FAR_NUMBERS / np.maximum(width, 1.0), 1.0))[label]
    return crowd, patch.rounding(exact[crowd] + (times - 1)[:, None] * away)


def _descend(patch: Patch, x: FloatArray, free: BoolArray, search: PlaceSearch) -> FloatArray:
    """Places after rounds of moves of free vertices from x (n, 2)."""
    x, faces = x.copy(), patch.faces
    least, since = len(faces) + 1, 0
    inside = RAY_NUMBERS[-1] if search.along else FAR_NUMBERS
    limit = np.where(patch.on_boundary, BOUNDARY_NUMBERS, inside)
    for turn in range(MOVE_ROUNDS):
        bad = signs(x, faces) <= 0
        left = int(bad.sum())
        least, since = (left, turn) if left < least else (least, since)
        if left == 0 or turn - since > PATIENCE_ROUNDS:
            break
        active = mask_of(len(x), faces[bad])
        if turn % 4 == 3:  # obstacles may have to move first
            active[faces[active[faces].any(1)]] = True
        chosen = patch.independent(active & free, mixed(np.arange(len(x)), turn))
        grid, step = (patch.rays if search.along else patch.places)(x, chosen)
        cost = patch.total(x, chosen, grid, _violation(step.prod(1), search.room))
        away = np.abs(grid - patch.start[chosen][:, None]) / step[:, None]
        w = grid.shape[1]
        far = away.max(2) > limit[chosen][:, None]
        far[:, w // 2] = False
        cost[far] = np.inf
        if turn % 2:  # places that are as good are tried in turn: so vertices leave a plateau
            tie = mixed(chosen[:, None] * w + np.arange(w), turn) / 2.0**33
        else:
            tie = (away**2).sum(2) / (2.0**30 if search.along else 2.0**20)
        x[chosen] = grid[np.arange(len(chosen)), (cost + tie).argmin(1)]
    return x


def _violation(cell: FloatArray, room: float) -> Term:
    """By how many cells twice the area of a face lacks ``room``, or 0; and 1 where it is not upright."""

    def term(own: IntArray, around: IntArray, triangles: FloatArray) -> FloatArray:
        a, b = (triangles[:, :, k] - triangles[:, :, 0] for k in (1, 2))
        area = cross2(a, b) / cell[own][:, None]
        low = not_upright(triangles)
        return np.where(low, 1 + room + np.abs(area), np.maximum(room - area, 0.0))

    return term


def mixed(number: IntArray, turn: int) -> IntArray:
    """Numbers below 2³², each its own as far as the input goes, in another order every turn."""
    x = (number.astype(np.uint64) + np.uint64(turn * 0x9E3779B9)) & np.uint64(0xFFFFFFFF)
    for factor in (0x7FEB352D, 0x846CA68B):  # steps that can be undone, so no two numbers meet
        x ^= x >> np.uint64(16)
        x = (x * np.uint64(factor)) & np.uint64(0xFFFFFFFF)
    x ^= x >> np.uint64(16)
    return x.astype(np.int64)
