"""Landmarks: pairs of vertices that a map must take to each other, given, on boundaries, or guessed."""

import itertools
from dataclasses import field

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from trimesh.registration import icp, procrustes

from circparam.core.arrays import group_sum, normals_of, unit
from circparam.core.plural import percent
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, TopologyError
from circparam.maps.map_input import MapInput

BOUNDARY_SAMPLES = 64  # places along a boundary at which two boundaries are compared
MIRROR_ERROR_RATIO = 0.5  # error of a reflection over that of a rotation: less looks mirrored,
MIRROR_ERROR_SIZES = 0.1  # where it is also below this share of the size
GUESSED_LANDMARKS = 8  # landmarks that are guessed,
GUESSED_LANDMARKS_PER_HANDLE = 6  # and so many more for every handle
# mean distance of the aligned surfaces, in sizes, up to which a guess is made
GUESS_DISTANCE_SIZES = 0.03
ALIGNMENT_ROUNDS = 12  # of the alignment by closest points
RIGID = {"reflection": False, "scale": False}  # motions that trimesh's registration may use


@dataclass
class Landmarks:
    """a, b (k,): vertices of both meshes that correspond. exact (k,): whether they were asked for, not helpers.

    corners[l]: the landmarks on boundary l, in order along it. known: arcs that both surfaces have, such as
    boundaries (two landmarks, the vertices between them on each); paths: landmarks whose shortest paths are
    arcs. notes: assumptions.
    """

    a: list[int] = field(default_factory=list)
    b: list[int] = field(default_factory=list)
    exact: list[bool] = field(default_factory=list)
    corners: list[list[int]] = field(default_factory=list)
    known: list[tuple[int, int, IntArray, IntArray]] = field(default_factory=list)
    paths: list[list[int]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, a: int, b: int, exact: bool) -> int:
        """A further pair; returns its number."""
        self.a.append(int(a))
        self.b.append(int(b))
        self.exact.append(exact)
        return len(self.a) - 1


def given_landmarks(pairs: IntArray, a: MapInput, b: MapInput) -> Landmarks:
    """Landmarks from pairs (k, 2) of vertex numbers of the meshes, counted from 0.

    Raises InputError if a number names no vertex of a face, or two lines name the same.
    """
    out = Landmarks()
    for line, pair in enumerate(np.asarray(pairs, np.int64).reshape(-1, 2).tolist(), 1):
        found = []
        for side, number, before in zip((a, b), pair, (out.a, out.b), strict=True):
            if not 0 <= number < len(side.vertex):
                raise InputError(
                    f"landmark {line}: {side.name} has no vertex {number} (it has 0 to {len(side.vertex) - 1})"
                )
            vertex = int(side.vertex[number])
            if vertex < 0:
                raise InputError(f"landmark {line}: no face of {side.name} uses vertex {number}")
            if vertex in before:
                raise InputError(
                    f"landmark {line}: vertex {number} of {side.name} is that of landmark "
                    f"{before.index(vertex) + 1} already; leave one of them out"
                )
            found.append(vertex)
        on = a.on_boundary[found[0]] >= 0, b.on_boundary[found[1]] >= 0
        if on[0] != on[1]:
            where = (a.name, b.name) if on[0] else (b.name, a.name)
            raise InputError(
                f"landmark {line}: it is on a boundary of {where[0]} and inside {where[1]}; "
                "both must be on a boundary, or none"
            )
        out.add(found[0], found[1], True)
    return out


def add_paths(marks: Landmarks, paths: list[list[int]], a: MapInput) -> None:
    """Paths, given by vertices of the mesh of A, as sequences of landmarks.

    Raises InputError if a vertex is no landmark, or two paths join the same landmarks.
    """
    number = {v: k for k, v in enumerate(marks.a)}
    seen = set()
    for line, path in enumerate(paths, 1):
        if len(path) < 2:
            raise InputError(
                f"path {line}: it names {len(path)} landmark; a path needs two or more"
            )
        found = []
        for vertex in path:
            own = int(a.vertex[vertex]) if 0 <= vertex < len(a.vertex) else -1
            if own not in number:
                raise InputError(
                    f"path {line}: vertex {vertex} of {a.name} is not a landmark; a path joins landmarks"
                )
            found.append(number[own])
        for k, pair in enumerate(itertools.pairwise(found)):
            if len(set(pair)) == 1 or frozenset(pair) in seen:
                raise InputError(
                    f"path {line}: vertices {path[k]} and {path[k + 1]} are joined already, or the same: "
                    "put a landmark between them"
                )
            seen.add(frozenset(pair))
        marks.paths.append(found)


def points_of(side: MapInput, vertices: list[int] | IntArray) -> FloatArray:
    """(k, 3) their positions, in units of the root of the area."""
    return side.closed.points[vertices] / np.sqrt(side.area)


def refuse_mirrored(marks: Landmarks, a: MapInput, b: MapInput) -> None:
    """Raise TopologyError if the given landmarks say that one surface is the mirror image of the other."""
    if len(marks.a) < 4:
        return
    p, q = points_of(a, marks.a), points_of(b, marks.b)
    straight, mirrored = (
        float(np.sqrt(procrustes(p, q, reflection=allowed, scale=False)[2]))
        for allowed in (False, True)
    )
    size = float(np.linalg.norm(np.ptp(q, axis=0)))
    if mirrored < MIRROR_ERROR_RATIO * straight and mirrored < MIRROR_ERROR_SIZES * size:
        raise TopologyError(
            f"{b.name} looks like a mirror image of {a.name}: a reflection fits the landmarks "
            f"{straight / max(mirrored, 1e-300):.3g} times better than a rotation; "
            "say --mirrored, or check the landmarks"
        )


def add_boundaries(marks: Landmarks, a: MapInput, b: MapInput) -> None:
    """Match the boundaries; give each at least three corners and a landmark at its tip.

    Raises InputError if it is not clear which boundary belongs to which, or their landmarks come in
    another order.
    """
    # the boundary of b that each boundary of a belongs to
    partner = [-1] * len(a.loops)
    for line, (u, v) in enumerate(zip(marks.a, marks.b, strict=True), 1):
        k, j = int(a.on_boundary[u]), int(b.on_boundary[v])
        if k < 0:
            continue
        if partner[k] not in (-1, j) or (partner[k] == -1 and j in partner):
            raise InputError(
                f"landmark {line}: other landmarks of its boundary lie on another boundary of {b.name}"
            )
        partner[k] = j
    free = [k for k, j in enumerate(partner) if j < 0]
    left = [j for j in range(len(b.loops)) if j not in partner]
    if len(free) > 1:
        raise InputError(
            f"{len(free)} boundaries have no landmark, and their pairing is open: "
            "give a landmark on each but one"
        )
    for k, j in zip(free, left, strict=True):
        partner[k] = j
    for k, j in enumerate(partner):
        close_boundary(marks, (a, b), (k, j), _corners(marks, a, b, k, j))


def close_boundary(
    marks: Landmarks, sides: tuple[MapInput, MapInput], loops: tuple[int, int], corners: list[int]
) -> None:
    """Arcs between the landmarks on a pair of boundaries, in order, and from each to a new one at the tip."""
    u, v = (side.n + k for side, k in zip(sides, loops, strict=True))
    tip = marks.add(u, v, False)
    marks.corners.append(corners)
    for i, j in zip(corners, [*corners[1:], corners[0]], strict=True):
        one, two = (
            side.along_boundary(own[i], own[j])
            for side, own in zip(sides, (marks.a, marks.b), strict=True)
        )
        marks.known.append((i, j, one, two))
    for i in corners:
        one, two = (np.array([own[tip], own[i]]) for own in (marks.a, marks.b))
        marks.known.append((tip, i, one, two))


def _corners(marks: Landmarks, a: MapInput, b: MapInput, k: int, j: int) -> list[int]:
    """The landmarks on a pair of boundaries, in order, with helpers where there are fewer than three."""
    loop_a, loop_b = a.loops[k].tolist(), b.loops[j].tolist()
    own = [n for n, v in enumerate(marks.a) if v in loop_a]
    own.sort(key=lambda n: loop_a.index(marks.a[n]))
    order = [loop_b.index(marks.b[n]) for n in own]
    turns = sum(order[n] > order[(n + 1) % len(own)] for n in range(len(own)))
    if len(own) > 2 and turns != 1:
        reverse = turns == len(own) - 1
        raise InputError(
            "the landmarks on a boundary have opposite orders on the two surfaces: "
            "say --mirrored, or check them"
            if reverse
            else "the landmarks on a boundary have different orders on the two surfaces: "
            "paths between them would cross"
        )
    if len(own) >= 3:
        return own
    if not own:
        begin = _best_start(marks, a, b, k, j)
        marks.notes.append(
            "a boundary has no landmark: it starts where the rigid alignment of the two boundaries is best"
        )
        own = [marks.add(loop_a[0], loop_b[begin], False)]
    span = 3 if len(own) == 1 else 2
    out = []
    for n, mark in enumerate(own):
        out.append(mark)
        after = own[(n + 1) % len(own)]
        # helpers divide the boundary up to the next landmark, or round, by length
        one = a.along_boundary(marks.a[mark], marks.a[after])
        two = b.along_boundary(marks.b[mark], marks.b[after])
        at = zip(a.closed.divided(one, span), b.closed.divided(two, span), strict=True)
        out += [marks.add(one[x], two[y], False) for x, y in at]
    return out


def _best_start(marks: Landmarks, a: MapInput, b: MapInput, k: int, j: int) -> int:
    """The entry of boundary j of b that belongs to entry 0 of boundary k of a, by the best rigid alignment."""
    evenly = np.arange(BOUNDARY_SAMPLES) / BOUNDARY_SAMPLES
    sampled = []
    for side, loop in ((a, a.loops[k]), (b, b.loops[j])):
        path = np.r_[loop, loop[0]]
        p, at = points_of(side, path), side.closed.shares(path)
        sampled.append(np.stack([np.interp(evenly, at, p[:, d]) for d in range(3)], 1))
    own = np.concatenate([sampled[0], *[points_of(a, marks.a)] * 4])
    known = [points_of(b, marks.b)] * 4
    errors = [
        procrustes(own, np.concatenate([np.roll(sampled[1], -n, 0), *known]), **RIGID)[2]
        for n in range(BOUNDARY_SAMPLES)
    ]
    gap = np.abs(at[:-1] - np.argmin(np.round(np.sqrt(errors), 12)) / BOUNDARY_SAMPLES)
    return int(np.minimum(gap, 1 - gap).argmin())


def guess(a: MapInput, b: MapInput) -> Landmarks:
    """Landmarks for two surfaces in similar poses: far-apart vertices of a and the nearest ones of b, more for
    every handle, none on boundaries.

    The surfaces are aligned by their axes of inertia and closest points, by a reflection where their fronts
    face opposite ways else. Raises InputError if the fit is too poor to be trusted, TopologyError if one
    surface is inside out.
    """
    p = points_of(a, np.arange(a.n))
    q = points_of(b, np.arange(b.n))
    size = float(np.linalg.norm(np.ptp(q, axis=0)))
    error, motion = _best_motion(p, q)
    if _faces_away(a, b, p, q, motion):
        error, motion = _best_motion(p, q, mirror=True)
        if error > GUESS_DISTANCE_SIZES * size or _faces_away(a, b, p, q, motion):
            raise TopologyError(
                f"{b.name} is inside out beside {a.name}: where they lie on each other, their fronts face "
                "opposite ways; turn the faces of one round, which --mirrored does"
            )
    moved = p @ motion[:, :3].T + motion[:, 3]
    if error > GUESS_DISTANCE_SIZES * size:
        raise InputError(
            f"{a.name} and {b.name} are too unlike to guess landmarks (aligned, {percent(error / size)} of "
            f"the size apart, {percent(GUESS_DISTANCE_SIZES)} at most): give --landmarks with 3 or more pairs"
        )
    inside = a.on_boundary < 0
    out_there = np.linalg.norm(moved - moved.mean(0), axis=1)
    chosen = [int(np.where(inside, out_there, -1).argmax())]
    distance = np.where(inside, np.inf, -1.0)
    while len(chosen) < min(GUESSED_LANDMARKS + GUESSED_LANDMARKS_PER_HANDLE * a.genus, len(p)):
        distance = np.minimum(distance, np.linalg.norm(p - p[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    own = np.flatnonzero(b.on_boundary < 0)
    nearest: list[int] = own[cKDTree(q[own]).query(moved[chosen])[1]].tolist()
    out = Landmarks()
    for u, v in zip(chosen, nearest, strict=True):
        if v not in out.b and u not in out.a:
            out.add(u, v, False)
    if len(out.a) < 4:
        raise InputError(
            "no landmarks, and none could be guessed: give --landmarks with 3 or more pairs"
        )
    out.notes.append(
        f"{len(out.a)} landmarks guessed from the alignment of the surfaces "
        f"(mean distance {percent(error / size)} of the size)"
    )
    return out


def _faces_away(a: MapInput, b: MapInput, p: FloatArray, q: FloatArray, motion: FloatArray) -> bool:
    """Whether most fronts of b face against those of a after a motion (3, 4), by the nearest vertices."""
    normals = []
    for side in (a, b):
        corner = side.surface.corner_vertex
        face = normals_of(side.surface.vertex_points[corner])
        normals.append(unit(group_sum(np.repeat(face, 3, axis=0), corner.ravel(), side.n)))
    turn = motion[:, :3]
    near = cKDTree(q).query(p @ turn.T + motion[:, 3])[1]
    # a reflection turns the winding of the triangles that it moves
    moved = normals[0] @ turn.T * np.sign(np.linalg.det(turn))
    return bool((moved * normals[1][near]).sum(1).mean() < -0.5)


def _best_motion(p: FloatArray, q: FloatArray, mirror: bool = False) -> tuple[float, FloatArray]:
    """(mean distance both ways, motion (3, 4) of p) after aligning axes of inertia in all proper ways, then
    closest points. mirror: all motions with a reflection.
    """
    axes_p, axes_q = (
        axes * np.linalg.det(axes)
        for axes in (np.linalg.svd(x - x.mean(0), full_matrices=False)[2] for x in (p, q))
    )
    step_p, step_q = (x[:: max(1, len(x) // 2000)] for x in (p, q))
    tree = cKDTree(q)
    best, best_motion = np.inf, np.eye(4)
    cube = Rotation.create_group("O").as_matrix()
    for proper in (np.eye(3), *(axes_q.T @ swap @ axes_p for swap in cube)):
        turn = -proper if mirror else proper
        start = np.eye(4)
        start[:3, :3], start[:3, 3] = turn, q.mean(0) - turn @ p.mean(0)
        motion, moved, _ = icp(step_p, q, start, max_iterations=ALIGNMENT_ROUNDS, **RIGID)  # type: ignore[no-untyped-call]
        there = float(np.mean(tree.query(moved)[0]))
        error = (there + float(np.mean(cKDTree(moved).query(step_q)[0]))) / 2
        if error < best - 1e-9:
            best, best_motion = error, motion
    return best, best_motion[:3]
