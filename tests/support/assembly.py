"""An assembly as a CAD kernel exports one: a few kinds of parts, each many times, anywhere and in any order."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tests.support.parts import Floats, Ints, circle, extrude, lathe
from tests.support.writers import obj


@dataclass(frozen=True)
class Assembly:
    """points (n, 3), faces (m, 3); part (m,) number of the part of each face; kind, mirrored (parts,)."""

    points: Floats
    faces: Ints
    part: Ints
    kind: Ints
    mirrored: npt.NDArray[np.bool_]


def bolt(sides: int = 6, length: float = 1.0) -> tuple[Floats, Ints]:
    """A prism as head on a round shaft, of one lathe: 60 faces with 6 sides."""
    profile = [
        [0, 0], [0.5, 0], [0.5, 0.3], [0.25, 0.3], [0.25, length - 0.1], [0.2, length], [0, length],
    ]  # fmt: skip
    part = lathe(np.array(profile, np.float64), sides)
    a, b, c = part.faces.T  # a profile makes faces of no area on its axis
    return part.points, part.faces[(a != b) & (b != c) & (c != a)]


def kinds(count: int = 40) -> list[tuple[Floats, Ints]]:
    """So many parts, no two congruent: bolts, rings, rods, plates with a hole off the middle."""
    out = []
    for k in range(count):
        s = 1.0 + 0.037 * k
        if k % 4 == 0:
            out.append(bolt(6 + k % 3, s))
            continue
        if k % 4 == 1:
            part = lathe(np.array([[0.3, 0], [0.6 * s, 0], [0.6 * s, 0.2], [0.3, 0.2]]), 12)
        elif k % 4 == 2:
            part = extrude(circle(8, 0.2 * s), (), 1.5)
        else:  # no mirror image of itself
            outer = np.array([[0, 0], [2 * s, 0], [2 * s, 1], [0.7, 1], [0, 0.6]])
            part = extrude(outer, [circle(8, 0.2, 0.5, 0.35)], 0.3)
        out.append((part.points, part.faces))
    return out


def assemble(
    shapes: Sequence[tuple[Floats, Ints]],
    parts: int,
    seed: int = 0,
    mirror: float = 0.0,
    gap: float = 5.0,
) -> Assembly:
    """So many parts of the given kinds, each turned at random, its vertices and faces in any order.

    mirror: share of the parts that are mirror images. gap: of the places that the parts take.
    """
    rng = np.random.default_rng(seed)
    more = rng.integers(0, len(shapes), max(parts - len(shapes), 0))
    kind = np.r_[np.arange(len(shapes)), more][:parts]
    side = int(np.ceil(parts ** (1 / 3)))
    image = rng.random(parts) < mirror
    points, faces, owner, start = [], [], [], 0
    for number, (which, flip) in enumerate(zip(kind, image, strict=True)):
        p, f = shapes[which]
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn)) * (-1 if flip else 1)
        place = gap * np.array([number % side, number // side % side, number // side**2])
        order = rng.permutation(len(p))
        where = np.empty(len(p), np.int64)
        where[order] = np.arange(len(p))
        new = where[f][rng.permutation(len(f))]
        step = rng.integers(0, 3, len(f))[:, None] + np.arange(3)
        new = np.take_along_axis(new, step % 3, 1)
        points.append(p[order] @ turn.T + place)
        faces.append((new[:, ::-1] if flip else new) + start)
        owner.append(np.full(len(f), number))
        start += len(p)
    return Assembly(*map(np.concatenate, (points, faces, owner)), kind, image)


def other_triangles(points: Floats, faces: Ints, seed: int = 0) -> Ints:
    """The same surface with other diagonals, drawn from pairs of faces in one plane that make a convex quad."""
    rng = np.random.default_rng(seed)
    faces = faces.copy()
    for _ in range(3 * len(faces)):
        f = int(rng.integers(len(faces)))
        k = int(rng.integers(3))
        a, b, c = np.roll(faces[f], -k)
        hit = np.flatnonzero(((faces == b) & (np.roll(faces, -1, 1) == a)).any(1))
        if len(hit) != 1:
            continue
        g = int(hit[0])
        d = int(faces[g][(faces[g] != a) & (faces[g] != b)][0])
        p, q, r, s = points[[a, d, b, c]]
        turns = [np.cross(y - x, z - y) for x, y, z in ((p, q, r), (q, r, s), (r, s, p), (s, p, q))]
        up = turns[0] / np.linalg.norm(turns[0])
        level = abs(np.dot(s - p, up)) < 1e-9
        if level and all(np.dot(t, up) > 1e-6 for t in turns):
            faces[f], faces[g] = [a, d, c], [d, b, c]
    return faces


def write_parts(path: Path, a: Assembly) -> None:
    """An assembly as an OBJ in which every third kind is of the materials body, trim and bolts."""
    material = (a.kind % 3)[a.part]
    chosen = {name: material == k for k, name in enumerate(("body", "trim", "bolts"))}
    path.write_bytes(obj(a.points, a.faces, materials=chosen))
