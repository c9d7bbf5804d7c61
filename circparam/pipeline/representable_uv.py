"""The uv that a format can represent, and spoilt faces mended among them.

Rounding may turn over a needle narrower than the distance of two storable numbers. Its vertices then move among
the storable numbers near them. The sum of the violations of spoilt faces is convex in one vertex while the
others stay. Vertices that share no face (an independent set) therefore take the best place in their windows at
once, round by round. Signs are exact.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    cross2,
    first_of_runs,
    group_max,
    group_sum,
)
from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.geometry.overlap import signs
from circparam.geometry.predicates import orientation

# uv (k, 2) → the nearest that can be stored, each coordinate for itself
Rounding: TypeAlias = Callable[[FloatArray], FloatArray]

REACH = 3  # storable numbers to either side that a vertex looks at in one round
# storable numbers that a vertex may move in all. On a boundary 6 single-precision numbers are 0.006 texels of
# the largest page (16384), within the margin of packing. Inside a chart nothing is near.
FAR, FAR_ON_BOUNDARY = 256, 6
CROWDED = 16  # storable numbers: vertices joined by shorter edges are a crowd
ROUNDS = 60  # of moves in one search
PATIENCE = 16  # rounds without fewer spoilt faces after which a search ends
# Spoilt faces, and their share, up to one of which a search pays. A layout with more is too small to be
# stored, and new maps give its faces their size back.
MOST, MOST_SHARE = 1000, 0.3
SMALLEST = 2.0**-60  # no step is finer than this: numbers next to zero are of no use
DOUBLINGS = (32, 16, 8, 4, 2, 1)  # all numbers up to 63 are sums of these
RAYS = 6  # faces of a vertex, the largest, into which it looks
RADII = np.unique(np.round(2.0 ** (np.arange(25) / 2)))  # of places on a ray, in storable numbers
CHUNK = 2_000_000  # corners x places looked at together


@dataclass(frozen=True)
class Search:
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
SEARCHES = (
    Search(1, 0, 0),
    Search(1, 1, 0),
    Search(1, 0, 0, along=True),
    Search(3, 2, 2),
    Search(9, 4, 4),
    Search(27, 4, 4),
)


def following(x: FloatArray, rounding: Rounding, side: int) -> FloatArray:
    """The next storable number above (``side`` 1) or below (−1) each of the storable numbers x (k, 2).

    The step grows by doubling. The first step that rounds to another number is longer than half the distance to
    that number, and at most the whole distance. No number in between is skipped.
    """
    step = np.maximum(np.spacing(np.abs(x)) / 2, SMALLEST)  # below a power of two they are finer
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


def window(x: FloatArray, rounding: Rounding, reach: int = REACH) -> FloatArray:
    """(k, 2, 2 reach + 1) storable numbers round those of x (k, 2), in ascending order."""
    out = np.repeat(x[:, :, None], 2 * reach + 1, axis=2)
    for k in range(1, reach + 1):
        for side in (1, -1):
            last = out[:, :, reach + side * (k - 1)]
            out[:, :, reach + side * k] = following(last, rounding, side)
    return out


def places(x: FloatArray, rounding: Rounding) -> tuple[FloatArray, FloatArray]:
    """((k, w, 2) all places of the window of each x (k, 2), x itself in the middle; (k, 2) next − x)."""
    near = window(x, rounding)
    size = near.shape[2]
    grid = np.stack([np.repeat(near[:, 0], size, axis=1), np.tile(near[:, 1], (1, size))], 2)
    return grid, near[:, :, REACH + 1] - near[:, :, REACH]


def rays(
    faces: IntArray, x: FloatArray, chosen: IntArray, rounding: Rounding
) -> tuple[FloatArray, FloatArray]:
    """((k, w, 2) places of chosen vertices on rays, x itself in the middle; (k, 2) next − x).

    faces: (m, 3). x: (n, 2) storable. A ray leads from a vertex to the middle of the opposite edge of one of
    its largest faces. The places lie ``RADII`` numbers out, none beyond that edge. Where a vertex has fewer
    faces, places are x once more.
    """
    step = following(x[chosen], rounding, 1) - x[chosen]
    slot = np.full(len(x), -1)
    slot[chosen] = np.arange(len(chosen))
    flat = faces.ravel()
    corner = np.flatnonzero(slot[flat] >= 0)
    face, k = corner // 3, corner % 3
    at, b, c = x[flat[corner]], x[faces[face, (k + 1) % 3]], x[faces[face, (k + 2) % 3]]
    order = np.lexsort((-np.abs(cross2(b - at, c - at)), slot[flat[corner]]))
    own = slot[flat[corner]][order]
    first = first_of_runs(own)
    rank = np.arange(len(own)) - np.repeat(first, np.diff(np.r_[first, len(own)]))
    some = rank < RAYS
    ray = np.zeros((len(chosen), RAYS, 2))
    ray[own[some], rank[some]] = ((b + c) / 2 - at)[order][some]
    length = np.abs(ray / step[:, None]).max(2)
    share = RADII / np.maximum(length, RADII[-1])[..., None]
    out = x[chosen][:, None] + (ray[:, :, None] * share[..., None]).reshape(len(chosen), -1, 2)
    grid = rounding(out.reshape(-1, 2)).reshape(out.shape)
    half = grid.shape[1] // 2
    return np.concatenate([grid[:, :half], x[chosen][:, None], grid[:, half:]], 1), step


def independent(faces: IntArray, active: BoolArray, turn: int) -> IntArray:
    """Active vertices ((n,) bool), no two of which share a face: those with the highest number among their
    neighbours.

    turn: the numbers are others in every turn.
    """
    number = np.where(active, _mixed(np.arange(len(active)), turn), -1)[faces]
    beaten = np.zeros(len(active), bool)
    beaten[faces[number < number.max(1)[:, None]]] = True
    return np.flatnonzero(active & ~beaten)


@dataclass(frozen=True, eq=False)
class Mended:
    """uv (nv, 2), all storable. moved: (nv,) bool, not where rounding alone puts them. spoilt: (m,) bool, faces
    that are still not upright."""

    uv: FloatArray
    moved: BoolArray
    spoilt: BoolArray


def mend_faces(
    faces: IntArray, exact: FloatArray, on_boundary: BoolArray, rounding: Rounding
) -> Mended:
    """Round a layout, and move vertices among storable numbers until every face is upright, if possible.

    faces: (m, 3), counter-clockwise as they should lie. exact: (nv, 2) before rounding. on_boundary: (nv,)
    bool. Layouts with over ``MOST`` spoilt faces are given up. So are faces that all ``SEARCHES`` leave, with
    vertices up to ``FAR`` numbers from their rounded places (``FAR_ON_BOUNDARY`` on a boundary).
    """
    start = rounding(exact)
    x, spoilt = start.copy(), signs(start, faces) <= 0
    for search in SEARCHES if spoilt.any() else ():
        if not 0 < spoilt.sum() <= max(MOST, MOST_SHARE * len(faces)):
            break
        free = np.zeros(len(exact), bool)
        free[faces[spoilt]] = True
        if search.along:
            free &= ~on_boundary  # no ray is as short as those may move
        for _ in range(search.rings):
            free[faces[free[faces].any(1)]] = True
        near = np.flatnonzero(free[faces].any(1))
        v, local = np.unique(faces[near], return_inverse=True)
        far = RADII[-1] if search.along else FAR
        limit = np.where(on_boundary[v], FAR_ON_BOUNDARY, far)
        patch = _Patch(local.reshape(-1, 3), start[v], free[v], limit, search, rounding)
        y = x[v]
        if search.spread > 1:
            inner = free[v] & ~on_boundary[v]
            crowd, place = _spread(patch, exact[v], inner, search.spread)
            y[crowd] = place
        y = patch.descend(y)
        after = signs(y, patch.faces) <= 0
        if after.sum() < spoilt[near].sum():
            x[v], spoilt[near] = y, after
    return Mended(x, (x != start).any(1), spoilt)


def _spread(
    patch: "_Patch", exact: FloatArray, inner: BoolArray, by: float
) -> tuple[IntArray, FloatArray]:
    """(vertices, storable places) of crowds among the vertices that are ``inner``, scaled round their middles.

    Scaling keeps the signs of a crowd's own faces, and of faces that join the crowd to vertices outside its new
    width.
    """
    step = np.zeros(len(exact))
    step[inner] = (following(patch.start[inner], patch.rounding, 1) - patch.start[inner]).max(1)
    a, b = patch.faces.ravel(), patch.faces[:, [1, 2, 0]].ravel()
    short = np.linalg.norm(exact[a] - exact[b], axis=1) < CROWDED * np.minimum(step[a], step[b])
    crowd, label = np.unique(np.r_[a[short], b[short]], return_inverse=True)
    half = int(short.sum())
    n, label = components(len(crowd), label[:half], label[half:])
    count = np.bincount(label, minlength=n)
    away = exact[crowd].copy()
    for k in (0, 1):
        away[:, k] -= (group_sum(exact[crowd, k], label, n) / count)[label]
    width = group_max(np.abs(away).max(1) / step[crowd], label, n)
    times = np.minimum(by, np.maximum(FAR / np.maximum(width, 1.0), 1.0))[label]
    return crowd, patch.rounding(exact[crowd] + (times - 1)[:, None] * away)


@dataclass(frozen=True, eq=False)
class _Patch:
    """Some faces (m, 3); start (n, 2): rounded places of their vertices; free: (n,) movable vertices; limit:
    (n,) largest distance from there, in numbers."""

    faces: IntArray
    start: FloatArray
    free: BoolArray
    limit: IntArray
    search: Search
    rounding: Rounding

    def descend(self, x: FloatArray) -> FloatArray:
        """Places after rounds of moves from x (n, 2)."""
        x, least, since = x.copy(), len(self.faces) + 1, 0
        for turn in range(ROUNDS):
            bad = signs(x, self.faces) <= 0
            left = int(bad.sum())
            least, since = (left, turn) if left < least else (least, since)
            if left == 0 or turn - since > PATIENCE:
                break
            active = np.zeros(len(x), bool)
            active[self.faces[bad]] = True
            if turn % 4 == 3:  # obstacles may have to move first
                active[self.faces[active[self.faces].any(1)]] = True
            chosen = independent(self.faces, active & self.free, turn)
            x[chosen] = self._best(x, chosen, turn)
        return x

    def _best(self, x: FloatArray, chosen: IntArray, turn: int) -> FloatArray:
        """(k, 2) the best place in the window of each chosen vertex."""
        if self.search.along:
            grid, step = rays(self.faces, x, chosen, self.rounding)
        else:
            grid, step = places(x[chosen], self.rounding)
        cost = self.cost(x, chosen, grid, step)
        away = np.abs(grid - self.start[chosen][:, None]) / step[:, None]
        allowed = away.max(2) <= self.limit[chosen][:, None]
        w = grid.shape[1]
        allowed[:, w // 2] = True
        cost[~allowed] = np.inf
        if turn % 2:  # places that are as good are tried in turn: so vertices leave a plateau
            tie = _mixed(chosen[:, None] * w + np.arange(w), turn) / 2.0**33
        else:
            tie = (away**2).sum(2) / (2.0**30 if self.search.along else 2.0**20)
        result: FloatArray = grid[np.arange(len(chosen)), (cost + tie).argmin(1)]
        return result

    def cost(
        self, x: FloatArray, chosen: IntArray, grid: FloatArray, step: FloatArray
    ) -> FloatArray:
        """(k, w) violation of the faces round each chosen vertex at each of its places."""
        slot = np.full(len(x), -1)
        slot[chosen] = np.arange(len(chosen))
        corner = np.flatnonzero(slot[self.faces.ravel()] >= 0)
        own = slot[self.faces.ravel()[corner]]
        face, k = corner // 3, corner % 3
        b, c = self.faces[face, (k + 1) % 3], self.faces[face, (k + 2) % 3]
        w, cell, room = grid.shape[1], step.prod(1), self.search.room
        cost = np.zeros((len(chosen), w))
        for first in range(0, len(corner), max(CHUNK // w, 1)):
            part = slice(first, first + max(CHUNK // w, 1))
            at = grid[own[part]].reshape(-1, 2)
            q, r = np.repeat(x[b[part]], w, axis=0), np.repeat(x[c[part]], w, axis=0)
            low = orientation(at, q, r) <= 0
            area = cross2(q - at, r - at) / np.repeat(cell[own[part]], w)
            lack = np.where(low, 1 + room + np.abs(area), np.maximum(room - area, 0.0))
            np.add.at(cost, own[part], lack.reshape(-1, w))
        return cost


def _mixed(number: IntArray, turn: int) -> IntArray:
    """Numbers below 2³², each its own as far as the input goes, in another order every turn."""
    x = (number.astype(np.uint64) + np.uint64(turn * 0x9E3779B9)) & np.uint64(0xFFFFFFFF)
    for factor in (0x7FEB352D, 0x846CA68B):  # steps that can be undone, so no two numbers meet
        x ^= x >> np.uint64(16)
        x = (x * np.uint64(factor)) & np.uint64(0xFFFFFFFF)
    x ^= x >> np.uint64(16)
    return x.astype(np.int64)
