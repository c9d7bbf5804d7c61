"""Polygons of a file, and one rule that turns them into triangles, for every format.

The fan from the first corner whose triangles all agree with the polygon's normal (Newell's). Otherwise ears are
clipped in the plane of the polygon: near-linear, by a tree of the corners that can be in the way.
"""

import heapq
from collections import Counter

import numpy as np

from circparam.core.arrays import mask_of
from circparam.core.compiled import kd_tree
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import InputError, NoResultError
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

# Corners. Beyond this, a polygon that no fan fits is refused: clipping its ears takes 0.1 ms for each corner.
MAX_CONCAVE_CORNERS = 100_000
MAX_CORNERS = 1_000_000  # of any polygon: its triangles would be needles round one corner
# Corners from which the ear with the shortest diagonal goes first. Small triangles hold only near corners;
# triangles along a side of many corners are near all these.
SHORTEST_FIRST_CORNERS = 1000
# area over the square of the length below which such an ear waits for a better one
SLIVER_AREA_SHARE = 1e-9
MAX_LOOKED_CORNERS = 200_000_000  # near the triangles of one polygon, 0.1 µs each
_AFTER = np.array([1, 2, 0])
# of a diagonal: the radius about a box that holds all its corners
HALF_AND_ROUNDING = 0.5 * (1 + 1e-9)
# Looks at a corner, for each corner of a polygon and in addition, before the rest is cut in order. Three
# looks each are enough for polygons that do not cross themselves.
LOOKS_PER_CORNER, LEAST_LOOKS = 4, 100_000


@dataclass(frozen=True)
class Polygons:
    """Polygons of a file and the triangles made inside them.

    corners: (L,) int64 vertex of every polygon corner. start: (p + 1,) int64 offsets of the polygons.
    triangles: (m, 3) int64 into ``corners``. owner: (m,) int64 polygon of each triangle.
    """

    corners: IntArray
    start: IntArray
    triangles: IntArray
    owner: IntArray

    @property
    def labels(self) -> IntArray | None:
        """Polygon label of each triangle for ``Mesh.polygons``; None if all are triangles."""
        return None if (np.diff(self.start) <= 3).all() else self.owner

    def mesh(
        self, points: FloatArray, groups: IntArray | None = None, counted_from: int = 0
    ) -> Mesh:
        """The triangles as a mesh, with labels (m,) of groups."""
        return Mesh(points, self.corners[self.triangles], self.labels, groups, counted_from)

    def corner_uv(self, uvmap: UVMap, name: str) -> IntArray:
        """(L,) int64: the uv of every polygon corner, from the first triangle that lists it; −1 for none.

        Raises NoResultError if triangles of one polygon disagree: no seam may run inside a polygon.
        """
        out = np.full(len(self.corners), -1, np.int64)
        out[self.triangles.ravel()[::-1]] = uvmap.uv_faces.ravel()[::-1]
        given, kept = uvmap.uv_faces, out[self.triangles]
        f = np.flatnonzero((given != kept).any(1))
        a, b = given[f], kept[f]
        same = (a < 0) == (b < 0)
        if len(uvmap.uv):
            same &= (uvmap.uv[a] == uvmap.uv[b]).all(2)
        wrong = f[~same.all(1)]
        if len(wrong):
            raise NoResultError(
                f"{name}: polygon {int(self.owner[wrong[0]])} got two uv at one corner: "
                "a seam may not run inside a polygon"
            )
        return out


def triangulate(points: FloatArray, corners: IntArray, start: IntArray) -> Polygons:
    """Triangulate polygons. points: (n, 3). corners: (L,) int64 into points. start: (p + 1,) offsets.

    Polygons of fewer than three corners give no triangle. Triangles come in the order of the polygons.
    Raises InputError for a polygon of more than ``MAX_CORNERS`` corners, and for one that no fan fits and that
    has more than ``MAX_CONCAVE_CORNERS``.
    """
    size = np.diff(start)
    if len(size) and size.max() > MAX_CORNERS:
        raise InputError(
            f"polygon {int(size.argmax())} has {int(size.max())} corners, more than the {MAX_CORNERS} that are "
            "read: triangulate it first"
        )
    if len(size) and (size == 3).all():
        return of_triangles(corners)
    finite = np.isfinite(points)
    if not finite.all():  # the mesh is refused later, with the place; here any number will do
        points = np.where(finite, points, 0.0)
    count = np.maximum(size - 2, 0)
    at = np.cumsum(count) - count
    triangles = np.empty((int(count.sum()), 3), np.int64)
    for n in np.unique(size[size > 2]).tolist():
        of_size = np.flatnonzero(size == n)
        apex = np.zeros(len(of_size), np.int64)
        fits = np.ones(len(of_size), bool)
        if n > 3:
            p = points[corners[start[of_size][:, None] + np.arange(n)]]
            apex, fits = first_fan(p - p[:, :1])
        fans = _fans(apex, n)
        triangles[at[of_size][:, None] + np.arange(n - 2)] = fans + start[of_size][:, None, None]
        for i in np.flatnonzero(~fits).tolist():  # concave ones are few
            if n > MAX_CONCAVE_CORNERS and _normal(p[i]).any():
                raise InputError(
                    f"polygon {int(of_size[i])} is concave and has {n} corners: triangulate it first"
                )
            f = of_size[i]
            try:
                ears = _without_fan(p[i] - p[i, 0])
            except InputError as error:
                raise InputError(
                    f"polygon {int(f)} is concave, has {n} corners, and {error}"
                ) from None
            triangles[at[f] : at[f] + n - 2] = -1
            triangles[at[f] : at[f] + len(ears)] = ears + start[f]
    owner = np.repeat(np.arange(len(size)), count)
    made = triangles[:, 0] >= 0
    return Polygons(corners, start, triangles[made], owner[made])


def of_triangles(corners: IntArray) -> Polygons:
    """Polygons (3 m,) that are triangles."""
    each = np.arange(len(corners)).reshape(-1, 3)
    return Polygons(corners, 3 * np.arange(len(each) + 1), each, np.arange(len(each)))


def _fans(apex: IntArray, n: int) -> IntArray:
    """(k, n − 2, 3) corners of the fans of k polygons of n corners, from their corners ``apex`` (k,) on."""
    k = np.arange(1, n - 1)
    middle = np.broadcast_to(apex[:, None], (len(apex), n - 2))
    return np.stack([middle, (apex[:, None] + k) % n, (apex[:, None] + k + 1) % n], 2)


@np.errstate(over="ignore", invalid="ignore")
def first_fan(p: FloatArray) -> tuple[IntArray, BoolArray]:
    """First corner of each polygon whose fan agrees with its normal.

    p: (k, n, 3) corners relative to corner 0. Returns ((k,) corner, (k,) whether there is one). A polygon
    without a normal takes corner 0: no other choice is better. A corner fits if it lies to the left of every
    side that does not end in it. The side at which the fan of one corner fails therefore rules out many others.
    """
    k, n, _ = p.shape
    normal = np.cross(p, np.roll(p, -1, axis=1)).sum(1)
    apex = np.zeros(k, np.int64)
    fits = np.zeros(k, bool)
    open_ = np.flatnonzero(np.abs(normal).max(1) > 0)
    possible = np.ones((k, n), bool)
    while len(open_):
        row = np.arange(len(open_))
        r = possible[open_].argmax(1)
        q = p[open_[:, None], (r[:, None] + np.arange(n)) % n]
        side = _doubled_areas(q[:, 1:-1] - q[:, :1], q[:, 2:] - q[:, :1], normal[open_])
        good = (side > 0).all(1)
        apex[open_[good]], fits[open_[good]] = r[good], True
        start = (r + 1 + side.argmin(1)) % n
        end = (start + 1) % n
        first, last = (p[open_, at][:, None] - p[open_] for at in (start, end))
        beyond = _doubled_areas(first, last, normal[open_]) > 0
        beyond[row, start] = beyond[row, end] = True
        possible[open_] &= beyond
        possible[open_, r] = False
        open_ = open_[~good & possible[open_].any(1)]
    return apex, fits


def _doubled_areas(a: FloatArray, b: FloatArray, normal: FloatArray) -> FloatArray:
    """(k, t) twice the area along the normal (k, 3) of triangles with sides (k, t, 3)."""
    return np.einsum("kti,ki->kt", np.cross(a, b), normal)


def _without_fan(p: FloatArray) -> IntArray:
    """(t, 3) corners of the triangles of a polygon that no fan fits, t ≤ n − 2. p: (n, 3) relative to corner 0.

    A polygon that comes back to a point is taken apart there. Its parts share no corner, because parts may lie
    in different charts and a corner has one uv. A polygon with a hole has parts that are wound both ways. It
    stays whole, because all its triangles agree with its normal.
    """
    place = list(map(tuple, p.tolist()))
    normal = _normal(p)
    if len(set(place)) == len(p) and normal.any():
        return clip_ears(p)
    least = -SLIVER_AREA_SHARE * (normal @ normal)
    loops = _loops(place, len(p))
    if max(map(len, loops)) < 3:
        return _fans(np.zeros(1, np.int64), len(p))[0]
    if not all(_normal(p[loop]) @ normal >= least for loop in loops):
        whole = _cut_loops(p, _loops(place, 2))
        if all(_normal(p[triangle]) @ normal >= least for triangle in whole):
            return whole
    return _cut_loops(p, loops)


def _normal(p: FloatArray) -> FloatArray:
    """(3,) the normal of a polygon (n, 3), twice its area long."""
    p = p - p[0]
    return np.asarray(np.cross(p, np.roll(p, -1, axis=0)).sum(0))


def _cut_loops(p: FloatArray, loops: list[list[int]]) -> IntArray:
    """(t, 3) the triangles of each loop of a polygon (n, 3); loops without area give one, for their uv."""
    out = []
    for loop in loops:
        if len(loop) < 3:
            out.append(np.array([[loop[0], loop[-1], loop[-1]]]))
            continue
        q = p[loop] - p[loop[0]]
        apex, fits = first_fan(q[None])
        fan = fits[0] or not _normal(q).any()  # without a normal, no triangles are better
        out.append(np.array(loop)[_fans(apex, len(q))[0] if fan else clip_ears(q)])
    return np.concatenate(out)


def _loops(place: list[tuple[float, ...]], longest: int) -> list[list[int]]:
    """Corners of a polygon in loops: one corner, one there and back, or round an area.

    place: (n, 3) the points of the corners. A walk along the outline leaves a loop at each point to which it
    comes back after at most ``longest`` corners.
    """
    n, count = len(place), Counter(place)
    plain = (k for k in range(n) if count[place[k]] == 1 and place[k - 1] != place[(k + 1) % n])
    first = next(plain, 0)
    loops: list[list[int]] = []
    walk: list[int] = []
    at: dict[tuple[float, ...], int] = {}
    for k in [*range(first, n), *range(first)]:
        begin = at.get(place[k])
        if begin is not None and len(walk) - begin <= longest:
            loops.append(walk[begin:])
            del walk[begin:]
            for corner in loops[-1]:
                at.pop(place[corner], None)
        at[place[k]] = len(walk)
        walk.append(k)
    return [*loops, walk]


def clip_ears(p: FloatArray) -> IntArray:
    """Ear clipping of one polygon. p: (n, 3) corners relative to the first. Returns (n − 2, 3) corners."""
    normal = _normal(p)
    axis = np.cross(np.eye(3)[int(np.argmin(np.abs(normal)))], normal)
    q = p @ np.stack([axis, np.cross(normal, axis)], 1)
    return np.array(Ears(q).clip(), np.int64)


def check_corners(corners: IntArray, points: int, source: Source, least: int = 0) -> None:
    """Raise InputError for a corner that names no vertex: below ``least``, or from ``points`` on."""
    bad = (corners < least) | (corners >= points)
    if bad.any():
        wrong = int(corners[bad][0])
        raise source.error(f"a face names vertex {wrong}: there are {points} (counted from 0)")


def strips(corners: IntArray, start: IntArray) -> IntArray:
    """(m, 3) triangles of strips in which −1 restarts, as places in ``corners``.

    Every second triangle of a run is reversed; triangles that repeat a vertex only join strips and are left
    out.
    """
    first = mask_of(len(corners), start[:-1][start[:-1] < len(corners)])
    first[1:] |= corners[:-1] < 0
    index = np.arange(len(corners))
    run = np.maximum.accumulate(np.where(first, index, 0))
    i = index[: max(len(corners) - 2, 0)]
    a, b, c = corners[i], corners[i + 1], corners[i + 2]
    whole = (run[i] == run[i + 2]) & (np.minimum(np.minimum(a, b), c) >= 0)
    i = i[whole & (a != b) & (b != c) & (c != a)]
    odd = (i - run[i]) % 2 == 1
    return np.stack([np.where(odd, i + 1, i), np.where(odd, i, i + 1), i + 2], 1)


def list_start(counts: IntArray) -> IntArray:
    """Offsets of groups of the given sizes, with the total behind them."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


class Ears:
    """A polygon whose ears are clipped: the first of its corners that is an ear, or of many the smallest.

    An ear is a corner that turns left and whose triangle holds no other corner. Corners at the same point as a
    corner of the triangle do not count. Otherwise a polygon with a hole, which comes back along its bridge, and
    a polygon that goes round twice would have no ear. In a polygon that does not cross itself, clipping an ear
    makes ears of its neighbours at most, so only these are looked at again. A triangle that holds a corner
    holds one that turns right, so large polygons search only those corners.
    """

    def __init__(self, q: FloatArray) -> None:
        """q: (n, 2) corners."""
        n = len(q)
        self.large = n > SHORTEST_FIRST_CORNERS
        self.q = np.nan_to_num(q)
        self.x: list[float] = q[:, 0].tolist()
        self.y: list[float] = q[:, 1].tolist()
        self.before = [n - 1, *range(n - 1)]
        self.after = [*range(1, n), 0]
        self.there = [True] * n
        self.blocks = np.array([not self.large or self._area(k) <= 0 for k in range(n)])
        self.looked = 0
        self._plant()

    def _plant(self) -> None:
        """Make a tree of the corners that can be in the way."""
        self.planted = np.flatnonzero(self.blocks)
        self.tree = kd_tree(self.q[self.planted]) if self.large else None
        self.left = len(self.planted)

    @np.errstate(over="ignore", invalid="ignore")
    def clip(self) -> list[tuple[int, int, int]]:
        """The n − 2 triangles. Where nothing is an ear, the second corner that is left is clipped.

        Raises InputError for a polygon that takes more than ``MAX_LOOKED_CORNERS``.
        """
        out: list[tuple[int, int, int]] = []
        left, first, looks = len(self.x), 0, 0
        most = LEAST_LOOKS + LOOKS_PER_CORNER * left
        waiting, every = sorted(map(self._turn, range(left))), True
        while left > 3:
            while not self.there[first]:
                first += 1
            if waiting:
                _, k = heapq.heappop(waiting)
                looks += 1
                if self.looked > MAX_LOOKED_CORNERS:
                    raise InputError("its outline is too intricate: triangulate it first")
                if not self.there[k] or not self._is_ear(k):
                    continue
            elif not every and looks < most:
                live = (k for k in range(first, len(self.x)) if self.there[k])
                waiting, every = sorted(map(self._turn, live)), True
                continue
            else:
                k = self.after[first]
            out.append((self.before[k], k, self.after[k]))
            # take a corner out; neighbours that turn left now are no obstacles
            a, b = self.before[k], self.after[k]
            self.after[a], self.before[b] = b, a
            self.there[k] = False
            for other in (k, a, b) if self.large else (k,):
                if self.blocks[other] and (other == k or self._area(other) > 0):
                    self.blocks[other] = False
                    self.left -= 1
            if 2 * self.left < len(self.planted):
                self._plant()
            left, every = left - 1, False
            for other in out[-1][::2]:
                heapq.heappush(waiting, self._turn(other))
        while not self.there[first]:
            first += 1
        out.append((first, self.after[first], self.before[first]))
        return out

    def _turn(self, k: int) -> tuple[float, int]:
        """When a corner is looked at: by the length of its diagonal in a large polygon, then by its number."""
        if not self.large:
            return 0.0, k
        i, m = self.before[k], self.after[k]
        length = abs(self.x[m] - self.x[i]) + abs(self.y[m] - self.y[i])
        return (np.inf if self._area(k) <= SLIVER_AREA_SHARE * length**2 else length), k

    def _area(self, k: int) -> float:
        """Twice the area of the triangle of a corner and its neighbours, above 0 if it turns left."""
        i, m, x, y = self.before[k], self.after[k], self.x, self.y
        return (x[k] - x[i]) * (y[m] - y[i]) - (y[k] - y[i]) * (x[m] - x[i])

    def _is_ear(self, k: int) -> bool:
        """Whether corner k turns left and its triangle holds no other corner that is left."""
        if not self._area(k) > 0:
            return False
        p = self.q[[self.before[k], k, self.after[k]]]
        near = self.planted
        if self.tree is not None:
            low, high = p.min(0), p.max(0)
            reach = float(np.hypot(*(high - low))) * HALF_AND_ROUNDING
            near = near[self.tree.query_ball_point((low + high) / 2, reach)]
        self.looked += len(near)
        side, away = p[_AFTER] - p, self.q[near[self.blocks[near]]][:, None] - p
        inside = (side[:, 0] * away[..., 1] >= side[:, 1] * away[..., 0]).all(1)
        return not (inside.any() and away[inside].any(2).all(1).any())
