"""Components of one shape up to a motion or a mirror, whatever the order of their vertices and faces.

1. Numbers that no motion changes (counts, area, second moment, distances of vertices) part the components into
   classes; the first of each class leads it.
2. A leader has a frame: its centroid and two vertices of few like them. Every pair of vertices of a copy that
   may stand for these two gives a motion. One nearest-neighbour query decides whether the motion carries all
   vertices over. All components are tried at once.
3. Faces are compared through the vertices that belong together; where triangles differ, outlines of flats.
"""

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from circparam.core.arrays import (
    first_of_groups,
    group_count,
    group_max,
    group_sum,
    mask_of,
    normals_of,
    numbered,
    ranges,
    scattered,
    sorted_distinct,
    unit,
)
from circparam.core.compiled import kd_tree
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.congruent_flats import Copies, Flats, find_flats, same_flats

ALIKE_RADII = 2e-5  # of the radius of a component: how far points of copies may lie apart
# of the largest coordinate: the error of two points by single precision and a rotation
NOISE_SHARE = 1.2e-6
BENT_RADIANS = 0.1  # radians by which the sums of the angles at two vertices may differ
BASE_TRIALS = (16, 8)  # vertices that are tried for the first and the second of a leader's frame
# looked at: enough to tell the corners of an icosahedron in a finer sphere from its other vertices
NEAREST_VERTICES = 6
# Rounds in which components unlike every leader of their class get a leader of their own: 30 meshes of several
# components take three at most.
LEADER_ROUNDS = 16
# Of the radius: least distance of the first vertex from the centroid, and of the second from the line
# through both.
FAR_RADII, WIDE_RADII = 0.3, 0.1


@dataclass(frozen=True, eq=False)
class Congruent:
    """corner: (m, 3) corner 3f + k of the leading component that each corner is a copy of, itself where it
    is none. copy: (m,) bool, faces of copies. turned: (m,) bool, copies whose faces run the other way round.
    whole: (m,) flat of each face of a leader, some copy of which has other triangles in its flats; −1
    elsewhere. No seam may run inside such a flat: corners there are those of another face.
    """

    corner: IntArray
    copy: BoolArray
    turned: BoolArray
    whole: IntArray


@dataclass(frozen=True, eq=False)
class _Parts:
    """Components with vertices of their own. vertex: (m, 3) number of each corner's vertex, ascending by
    component; points: (v, 3) from the centroid of the component; owner: (v,) component; first: (n + 1,) first
    vertex of each; radius, slack: (n,) farthest vertex, and tolerance of copies; distance, angle: (v,) from the
    centroid, and sum of the face angles; label: (m,) labels that copies share face by face; area: (m,)."""

    component: IntArray
    vertex: IntArray
    points: FloatArray
    owner: IntArray
    first: IntArray
    radius: FloatArray
    slack: FloatArray
    distance: FloatArray
    angle: FloatArray
    label: IntArray
    area: FloatArray

    @cached_property
    def crowding(self) -> FloatArray:
        """(v,) mean distance to the nearest vertices of the component; only copies with many like vertices ask
        for them."""
        scale = np.maximum(self.radius, 1e-300)[self.owner]
        apart = _apart(self.points / scale[:, None], self.owner)
        away, _ = kd_tree(apart).query(apart, k=NEAREST_VERTICES + 1)
        return np.asarray(np.minimum(np.asarray(away)[:, 1:], 2.0).mean(1) * scale)

    @cached_property
    def flats(self) -> Flats:
        """The flats of all components; only copies with other triangles ask for them."""
        return find_flats(self.points, self.vertex, self.slack[self.component], self.label)


def find_congruent(
    points: FloatArray,
    faces: IntArray,
    component: IntArray,
    label: IntArray,
    mirror: bool = False,
    flats: bool = True,
) -> Congruent:
    """Components of the same shape: points (n, 3), faces (m, 3), component (m,) from 0 on without gaps.

    label: (m,) labels that copies must share face by face, such as their material. mirror: mirror images and
    components turned inside out are copies as well. flats: so are those with other triangles in their flats.
    """
    parts = _parts(points, faces, component, label)
    count = len(parts.first) - 1
    group = _classes(parts)
    lead = np.arange(count)
    corner = np.arange(faces.size).reshape(-1, 3)
    turned, uneven = np.zeros(len(faces), bool), np.zeros(count, bool)
    left = group_count(group, count)[group] > 1
    for _ in range(LEADER_ROUNDS):
        if not left.any():
            break
        first = np.full(count, count)
        np.minimum.at(first, group[left], np.flatnonzero(left))
        leader = np.where(left, first[group], np.arange(count))
        left &= leader != np.arange(count)
        found = _copies_of(parts, leader, left, mirror, flats)
        lead[found.component] = leader[found.component]
        corner[found.face] = found.corner
        turned[found.face] = found.turned
        uneven[leader[found.uneven]] = True
        left[found.component] = False
        left &= group_count(group[left], count)[group] > 1
    whole = np.where(uneven[component], parts.flats.label if uneven.any() else 0, -1)
    return Congruent(corner, (lead != np.arange(count))[component], turned, whole)


def _parts(points: FloatArray, faces: IntArray, component: IntArray, label: IntArray) -> _Parts:
    n = int(component.max(initial=-1)) + 1
    key, corner_vertex = numbered((component[:, None] * len(points) + faces).ravel())
    vertex = corner_vertex.reshape(-1, 3)
    owner = key // len(points)
    own = points[key % len(points)]
    corner = own[vertex]
    cross = normals_of(corner)
    area = np.linalg.norm(cross, axis=1) / 2
    total = np.maximum(group_sum(area, component, n), 1e-300)
    middle = corner.mean(1)
    centre = group_sum(area[:, None] * middle, component, n) / total[:, None]
    local = own - centre[owner]
    distance = np.linalg.norm(local, axis=1)
    radius = group_max(distance, owner, n)
    forward = corner[:, [1, 2, 0]] - corner
    back = corner[:, [2, 0, 1]] - corner
    across = np.linalg.norm(np.cross(forward, back), axis=2)
    angle = group_sum(np.arctan2(across, (forward * back).sum(2)).ravel(), vertex.ravel(), len(own))
    reach = float(np.abs(own).max(initial=0.0))
    first = np.searchsorted(owner, np.arange(n + 1))
    return _Parts(
        component,
        vertex,
        local,
        owner,
        first,
        radius,
        ALIKE_RADII * radius + NOISE_SHARE * reach,
        distance,
        angle,
        label,
        area,
    )


def _classes(parts: _Parts) -> IntArray:
    """(n,) class of each component: those in different ones cannot be congruent."""
    n = len(parts.radius)
    corner, area = parts.points[parts.vertex], parts.area
    # the second moment of a triangle about the origin: A / 12 (Σ |p|² + |Σ p|²)
    moment = area / 12 * ((corner**2).sum((1, 2)) + (corner.sum(1) ** 2).sum(1))
    total = np.maximum(group_sum(area, parts.component, n), 1e-300)
    size = group_count(parts.owner, n)
    counts = np.stack([group_count(parts.component, n), size], 1)
    group = np.unique(counts, axis=0, return_inverse=True)[1].reshape(-1)
    lengths = (
        parts.radius,
        np.sqrt(total),
        np.sqrt(group_sum(moment, parts.component, n) / total),
        group_sum(parts.distance, parts.owner, n) / np.maximum(size, 1),
    )
    for length in lengths:
        order = np.lexsort((length, group))
        slack = parts.slack[order]
        gap = np.diff(length[order]) > 4 * np.maximum(slack[1:], slack[:-1])
        new = np.r_[True, gap | (np.diff(group[order]) != 0)]
        group = scattered(n, order, np.cumsum(new) - 1)
    return group


def _copies_of(
    parts: _Parts, leader: IntArray, asked: BoolArray, mirror: bool, flats: bool
) -> Copies:
    """Which of the components ``asked`` ((n,) bool) are copies of their leaders (n,)."""
    n = len(leader)
    leads = mask_of(n, leader[asked])
    detail = np.zeros(len(parts.owner))
    frames = _frames(parts, leads, detail)
    bases = _like(parts, frames[0], leader, asked, detail)
    if group_count(parts.owner[bases], n).max() > BASE_TRIALS[0]:
        detail = parts.crowding
        frames = _frames(parts, leads, detail)
        bases = _like(parts, frames[0], leader, asked, detail)
    sides = _like(parts, frames[1], leader, asked, detail)
    mine = np.flatnonzero(leads[parts.owner])
    scale = np.maximum(parts.radius, 1e-300)
    # leaders lie one after the other along a fourth axis, too far apart to be neighbours
    tree = kd_tree(_apart(parts.points[mine] / scale[parts.owner[mine], None], parts.owner[mine]))
    reach = 2 * float((parts.slack / scale)[asked].max(initial=0.0)) + 1e-9
    order = np.lexsort((*np.sort(parts.vertex, 1).T[::-1], parts.component))
    begin = np.searchsorted(parts.component[order], np.arange(n + 1))
    none = np.zeros(0, np.int64)
    found = [Copies(none, none, none.reshape(0, 3), none.astype(bool), none)]
    left = asked.copy()
    for handed in (1.0, -1.0) if mirror else (1.0,):
        for own, base, side in _trials(parts, frames, leader, left, bases, sides):
            # rotations, or mirrored ones, that carry the frame of each copy onto the leader's
            lead = leader[own]
            target = _axes(parts.points[frames[0][lead]], parts.points[frames[1][lead]], 1.0)
            source = _axes(parts.points[base], parts.points[side], handed)
            motion = np.einsum("kai,kaj->kij", target, source)
            size = parts.first[own + 1] - parts.first[own]
            vertex = np.repeat(parts.first[own], size) + ranges(size)
            which = np.repeat(np.arange(len(own)), size)
            moved = np.einsum("kij,kj->ki", motion[which], parts.points[vertex])
            to = leader[own][which]
            away, near = tree.query(_apart(moved / scale[to, None], to), distance_upper_bound=reach)
            n_vertices = len(parts.owner)
            match = scattered(n_vertices, vertex, mine[np.minimum(near, len(mine) - 1)])
            wrong = away * scale[to] > parts.slack[own][which]
            fits = group_count(which[wrong], len(own)) == 0
            # as many different partners as vertices
            partners = sorted_distinct(which * n_vertices + match[vertex]) // n_vertices
            fits &= group_count(partners, len(own)) == size
            if fits.any():
                found.append(
                    _same_faces(parts, leader, own[fits], match, (order, begin), mirror, flats)
                )
                left[found[-1].component] = False
    return Copies.joined(found)


def _apart(points: FloatArray, leader: IntArray) -> FloatArray:
    return np.concatenate([points, 8.0 * leader[:, None]], 1)


def _frames(parts: _Parts, leads: BoolArray, detail: FloatArray) -> tuple[IntArray, IntArray]:
    """((n,), (n,)) two rare vertices of each leader, not on one line with the centroid, −1 for components that
    lead nothing. detail: (v,) a length that no motion changes."""
    n = len(leads)
    vertex = np.flatnonzero(leads[parts.owner])
    owner = parts.owner[vertex]
    radius, step = np.maximum(parts.radius[owner], 1e-300), 4 * parts.slack[owner]
    far = parts.distance[vertex] >= FAR_RADII * radius
    traits = (
        parts.distance[vertex] / step,
        parts.angle[vertex] / BENT_RADIANS,
        detail[vertex] / step,
    )
    kind = np.stack([owner, *np.round(traits)], 1)
    base = scattered(n, owner, _rarest(vertex, owner, kind, ~far, parts.distance[vertex]))
    along = unit(parts.points[base[owner]])
    p = parts.points[vertex]
    off = np.linalg.norm(p - (p * along).sum(1)[:, None] * along, axis=1)
    widest = group_max(off, owner, n)[owner]
    between = np.round(np.linalg.norm(p - parts.points[base[owner]], axis=1) / step)
    thin = off < np.minimum(WIDE_RADII * radius, widest)
    return base, scattered(n, owner, _rarest(vertex, owner, np.c_[kind, between], thin, off))


def _rarest(
    vertex: IntArray, owner: IntArray, kind: FloatArray, worse: BoolArray, size: FloatArray
) -> IntArray:
    """For each row the vertex of its owner that has the fewest of its kind; of these the one of largest size.
    worse: (k,) bool, only where the owner has no other."""
    _, label, number = np.unique(kind, axis=0, return_inverse=True, return_counts=True)
    lead = first_of_groups(owner, worse, number[label.reshape(-1)], -size, vertex)
    return scattered(int(owner.max(initial=-1)) + 1, owner[lead], vertex[lead])[owner]


def _like(
    parts: _Parts, frame: IntArray, leader: IntArray, asked: BoolArray, detail: FloatArray
) -> BoolArray:
    """(v,) bool: vertices of the components asked that are as far out as the leader's vertex, as bent, and
    alike in ``detail``."""
    own = np.flatnonzero(asked[parts.owner])
    of = frame[leader[parts.owner[own]]]
    out = np.zeros(len(parts.owner), bool)
    slack = 2 * parts.slack[parts.owner[own]]
    near = np.abs(parts.distance[own] - parts.distance[of]) <= slack
    near &= np.abs(detail[own] - detail[of]) <= slack
    out[own] = near & (np.abs(parts.angle[own] - parts.angle[of]) <= BENT_RADIANS)
    return out


def _trials(
    parts: _Parts,
    frames: tuple[IntArray, IntArray],
    leader: IntArray,
    left: BoolArray,
    bases: BoolArray,
    sides: BoolArray,
) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
    """(components, base, side) of one motion for each, until none is left; ``left`` shrinks meanwhile."""
    n = len(leader)
    base = np.flatnonzero(bases)
    rank = ranges(group_count(parts.owner[base], n))
    for k in range(min(BASE_TRIALS[0], int(rank.max(initial=-1)) + 1)):
        now = base[(rank == k) & left[parts.owner[base]]]
        if not len(now):
            continue
        of = scattered(n, parts.owner[now], now)
        side = np.flatnonzero(sides & (of[parts.owner] >= 0))
        own = parts.owner[side]
        first, last = (parts.points[ends[leader[own]]] for ends in frames)
        wanted = np.linalg.norm(last - first, axis=1)
        apart = np.linalg.norm(parts.points[side] - parts.points[of[own]], axis=1)
        side = side[np.abs(apart - wanted) <= 2 * parts.slack[own]]
        second = ranges(group_count(parts.owner[side], n))
        for j in range(min(BASE_TRIALS[1], int(second.max(initial=-1)) + 1)):
            chosen = side[(second == j) & left[parts.owner[side]]]
            if len(chosen):
                own = parts.owner[chosen]
                yield own, of[own], chosen


def _axes(a: FloatArray, b: FloatArray, handed: float) -> FloatArray:
    """(k, 3, 3) orthonormal rows: along a, in the plane of a and b, and across it."""
    x = unit(a)
    y = unit(b - (b * x).sum(1)[:, None] * x)
    return np.stack([x, y, handed * np.cross(x, y)], 1)


def _same_faces(
    parts: _Parts,
    leader: IntArray,
    own: IntArray,
    match: IntArray,
    faces: tuple[IntArray, IntArray],
    mirror: bool,
    flats: bool,
) -> Copies:
    """Of components whose vertices match those of their leaders, the ones whose faces or flats do as well.

    match: (v,) vertex of the leader. faces: numbers of the faces by component and vertices, and where each
    component begins.
    """
    order, begin = faces
    size = begin[own + 1] - begin[own]
    which = np.repeat(np.arange(len(own)), size)
    face = order[np.repeat(begin[own], size) + ranges(size)]
    mapped = match[parts.vertex[face]]
    rank = np.lexsort((*np.sort(mapped, 1).T[::-1], which))
    face, mapped = face[rank], mapped[rank]
    theirs = order[np.repeat(begin[leader[own]], size) + ranges(size)]
    at = mapped[:, :, None] == parts.vertex[theirs][:, None, :]
    place = at.argmax(2)
    odd = (place[:, 1] - place[:, 0]) % 3 != 1
    count = len(own)
    bad = ~at.any(2).all(1) | (parts.label[face] != parts.label[theirs])
    odds = group_count(which[odd], count)
    good = (group_count(which[bad], count) == 0) & ((odds == 0) | (mirror & (odds == size)))
    keep = good[which]
    exact = Copies(
        own[good], face[keep], 3 * theirs[keep][:, None] + place[keep], odd[keep], own[:0]
    )
    if good.all() or not flats:
        return exact
    rest = own[~good]
    level = same_flats(
        parts.flats, parts.vertex, parts.component, parts.label, (rest, leader[rest]), match, mirror
    )
    return Copies.joined([exact, level])
