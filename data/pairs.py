"""Pairs of surfaces: two heads, a creature in another pose, a part dense and coarse."""

from __future__ import annotations

import numpy as np
from implicit import BONES, bones_field, marching_tetrahedra, relaxed
from samplekit import (
    Sample,
    gltf,
    grid_points,
    grid_quads,
    number,
    obj,
    plain_material,
    ply,
    png,
    rounded,
    split,
    tuples,
    vertex_lines,
)

NECK = 2.55  # polar angle at which a head ends, from its crown down

# bumps of a head: polar angle, azimuth (0 is in front), height, width
FIRST = {
    "nose": (1.62, 0.0, 0.34, 0.2), "left eye": (1.42, 0.42, -0.09, 0.15),
    "right eye": (1.42, -0.42, -0.09, 0.15), "left ear": (1.55, 1.6, 0.26, 0.18),
    "right ear": (1.55, -1.6, 0.26, 0.18), "chin": (2.15, 0.0, 0.16, 0.25),
    "brow": (1.25, 0.0, 0.06, 0.35), "nape": (1.9, 3.1416, 0.12, 0.5),
}  # fmt: skip
SECOND = {
    "nose": (1.7, 0.0, 0.45, 0.19), "left eye": (1.48, 0.5, -0.12, 0.18),
    "right eye": (1.48, -0.5, -0.12, 0.18), "left ear": (1.45, 1.5, 0.36, 0.22),
    "right ear": (1.45, -1.5, 0.36, 0.22), "chin": (2.2, 0.0, 0.3, 0.2),
    "brow": (1.28, 0.0, 0.12, 0.3), "nape": (1.8, 3.1416, 0.02, 0.5),
}  # fmt: skip
MARKS = ("nose", "left eye", "right eye", "left ear", "right ear", "chin", "nape")


def disk_rings(rings: int, turn: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A round mesh of rings of 6, 12, 18 ... vertices: (radius 0..1, angle, faces)."""
    radius, angle, start = [np.zeros(1)], [np.zeros(1)], [0, 1]
    for r in range(1, rings + 1):
        radius.append(np.full(6 * r, r / rings))
        angle.append(2 * np.pi * (np.arange(6 * r) + turn * r) / (6 * r))
        start.append(start[-1] + 6 * r)
    faces = []
    for r in range(1, rings + 1):
        inner, outer = max(6 * (r - 1), 1), 6 * r
        for k in range(outer):  # r faces out and r − 1 in for each of six sectors
            side, at = divmod(k, r)
            a, b = start[r] + k, start[r] + (k + 1) % outer
            c = start[r - 1] + (side * (r - 1) + at) % inner
            faces.append((a, b, c))
            if at < r - 1:
                faces.append((b, start[r - 1] + (side * (r - 1) + at + 1) % inner, c))
    return np.concatenate(radius), np.concatenate(angle), np.array(faces)


def head(bumps: dict[str, tuple[float, ...]], polar: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Points of a head in directions: an egg with bumps, y up and z in front, as glTF has it."""

    def direction(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        return np.stack(
            [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1
        )

    d = direction(polar, angle)
    r = 1.0 / np.sqrt((d[:, 0] / 1.05) ** 2 + (d[:, 1] / 0.86) ** 2 + (d[:, 2] / 1.2) ** 2)
    for theta, phi, height, width in bumps.values():
        away = ((d - direction(np.array(theta), np.array(phi))) ** 2).sum(1)
        r = r + height * np.exp(-away / width**2)
    return rounded(r[:, None] * d)[:, [1, 2, 0]]


def paint(size: int) -> np.ndarray:
    """(size, size, 3) the looks of the first head, seen from its crown: hair, eyes, a mouth, cheeks."""
    y, x = (np.mgrid[:size, :size] + 0.5) / size * 2 - 1
    theta, phi = np.hypot(x, y) * NECK, np.arctan2(-y, x)
    hair = (theta < 1.0 + 0.12 * np.cos(9 * phi)) | ((np.abs(phi) > 2.0) & (theta < 2.0))
    out = np.where(hair[..., None], [92, 58, 30], [226, 178, 146]).astype(float)
    strands = 14 * np.sin(40 * phi)[..., None] * hair[..., None]

    def spot(at: float, side: float, wide: float, high: float) -> np.ndarray:
        return ((theta - at) / high) ** 2 + ((phi - side) / wide) ** 2

    for side in (0.42, -0.42):
        out[spot(1.42, side, 0.17, 0.10) < 1] = [250, 250, 246]
        out[spot(1.42, side, 0.07, 0.08) < 1] = [40, 90, 150]
        cheek = np.exp(-spot(1.75, 1.5 * side, 0.2, 0.2))[..., None]
        out += cheek * (np.array([235, 120, 110]) - out) * 0.5
    out[spot(1.9, 0.0, 0.32, 0.05) < 1] = [170, 50, 60]
    return np.clip(out + strands, 0, 255).astype(np.uint8)


def head_1() -> Sample:
    """A head, open at the neck: a star-shaped surface on rings of triangles, with a painted texture, as GLB."""
    radius, angle, f = disk_rings(22, 0.0)
    p = head(FIRST, NECK * radius, angle)
    uv = np.stack([0.5 + 0.5 * radius * np.cos(angle), 0.5 - 0.5 * radius * np.sin(angle)], 1)
    s = Sample("head-1", "a painted head, to give its looks to head-2", p, tuples(f), pair="head-2")
    s.files["head-1.glb"] = gltf(
        [("head", p, np.round(uv, 5), f, {})], [png(paint(96))], [plain_material("skin")]
    )
    pairs = np.stack([marks(FIRST, p), marks(SECOND, head_2_points()[0])], 1)
    s.files["head-1.landmarks.txt"] = lines(pairs)
    return s


def head_2_points() -> tuple[np.ndarray, np.ndarray]:
    """The other head: points and faces."""
    radius, angle, f = disk_rings(19, 0.5)
    return head(SECOND, NECK * radius**0.92, angle), f


def head_2() -> Sample:
    """Another head of the same kind: other features, other triangles, no colours, as binary PLY."""
    p, f = head_2_points()
    s = Sample("head-2", "a head of another shape and mesh", p, tuples(f), pair="head-1")
    s.files["head-2.ply"] = ply("head-2", p, f)
    return s


def marks(bumps: dict[str, tuple[float, ...]], p: np.ndarray) -> np.ndarray:
    """The vertices in the middle of the bumps."""
    d = p / np.linalg.norm(p, axis=1, keepdims=True)
    at = np.array([bumps[name][:2] for name in MARKS])
    theta, phi = at.T
    aim = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1)
    return np.argmax(np.round(aim[:, [1, 2, 0]] @ d.T, 9), 1)


def lines(pairs: np.ndarray) -> bytes:
    """Pairs of vertex numbers, one a line."""
    return "".join(f"{a} {b}\n" for a, b in pairs.tolist()).encode()


# the creature looks up, lifts a paw, and its tail hangs
POSED = {
    0: ((-1.75, 0.25, 0.95), (-0.9, 0.0, 0.75)),
    2: ((0.6, 0.0, 0.95), (1.0, 0.12, 1.55)),
    3: ((1.0, 0.12, 1.6), (1.14, 0.16, 1.64)),
    4: ((1.14, 0.16, 1.6), (1.55, 0.3, 1.75)),
    7: ((0.5, 0.28, 0.7), (1.05, 0.42, 0.25)),
    8: ((0.5, -0.28, 0.7), (0.4, -0.42, 0.0)),
    9: ((0.92, 0.3, 1.8), (0.72, 0.42, 2.06)),
    10: ((0.98, -0.06, 1.82), (0.8, -0.24, 2.1)),
}
TIPS = ((0, 0), (4, 1), (5, 1), (6, 1), (7, 1), (8, 1), (9, 1), (10, 1))  # (bone, its end)


def posed() -> list[tuple[tuple[float, ...], tuple[float, ...], float, float]]:
    """The bones in their other pose."""
    return [(*POSED.get(k, bone[:2]), *bone[2:]) for k, bone in enumerate(BONES)]


def tips(bones: list, p: np.ndarray) -> np.ndarray:
    """The vertices farthest out at the ends of tail, snout, legs and ears; then of back and belly."""
    out = []
    for bone, end in TIPS:
        a, b = np.array(bones[bone][1 - end]), np.array(bones[bone][end])
        axis = (b - a) / np.linalg.norm(b - a)
        near = np.linalg.norm(p - b, axis=1) < 0.3
        out.append(np.argmax(np.round(np.where(near, (p - b) @ axis, -9.0), 5)))
    for up in (1.0, -1.0):  # the back and the belly, half way
        middle = np.abs(p[:, 0] + 0.15) < 0.1
        out.append(np.argmax(np.round(np.where(middle, up * p[:, 2] - np.abs(p[:, 1]), -9.0), 5)))
    return np.array(out)


def creature_pose(creature: np.ndarray) -> Sample:
    """The creature with its bones in another pose, meshed anew and coarser, as binary PLY."""
    step, bones = 0.14, posed()

    def field(p: np.ndarray) -> np.ndarray:
        return bones_field(p, bones)

    low, high = np.array([-2.1, -0.85, -0.3]), np.array([2.0, 0.85, 2.4])
    axes = [np.arange(a, b, step) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    p, f = marching_tetrahedra(field(grid), low, step)
    p = rounded(relaxed(p, f, field=field))
    s = Sample(
        "creature-pose", "the creature in another pose and mesh", p, tuples(f), pair="creature"
    )
    s.files["creature-pose.ply"] = ply("creature-pose", p, f)
    s.files["creature-pose.landmarks.txt"] = lines(
        np.stack([tips(BONES, creature), tips(bones, p)], 1)
    )
    return s


def ramp(x: np.ndarray, width: float) -> np.ndarray:
    """0 below 0, 1 above the width, a straight slope between."""
    return np.clip(x / width, 0, 1)


def cover(radius: np.ndarray, angle: np.ndarray, fine: float) -> np.ndarray:
    """Points of a round cover: a dome with a rim; fine: how much of its ribs, bolts and ring it has."""
    dome = 0.35 * np.sqrt(np.maximum(1 - (radius / 1.25) ** 2, 0))
    ribs = 0.03 * ramp(np.cos(12 * angle) - 0.4, 0.4) * ramp(radius - 0.32, 0.06)
    ribs = ribs * ramp(0.74 - radius, 0.06)
    bolts = 0.05 * ramp(0.1 - np.hypot(radius - 0.84, 0.84 * np.sin(4 * angle) / 4), 0.05)
    ring = 0.04 * ramp(0.08 - np.abs(radius - 0.24), 0.05)
    z = dome + fine * (ribs + bolts + ring)
    return rounded(np.stack([radius * np.cos(angle), radius * np.sin(angle), z], 1))


def polar_mesh(around: int, rings: int, fine: float) -> tuple[np.ndarray, np.ndarray]:
    """A cover out of rings of quads; the middle is a small polygon of triangles."""
    a, r = grid_points(2 * np.pi * np.arange(around) / around, np.linspace(0.04, 1, rings))
    p = np.concatenate([cover(r, a, fine), cover(np.zeros(1), np.zeros(1), fine)])
    f = split(grid_quads(around, rings, closed_u=True)[:, ::-1])
    first = rings * np.arange(around)
    middle = np.stack([np.full(around, len(p) - 1), first, np.roll(first, -1)], 1)
    return p, np.concatenate([f, middle])


def cover_dense() -> Sample:
    """A round cover with ribs, bolts and a ring: the dense mesh whose looks a coarse one gets, binary PLY."""
    p, f = polar_mesh(96, 30, 1.0)
    s = Sample("cover-dense", "a part with fine detail", p, tuples(f), pair="cover-coarse")
    s.files["cover-dense.ply"] = ply("cover-dense", p, f)
    return s


def cover_coarse() -> Sample:
    """The same cover without its detail: a few triangles, with uv from above, as OBJ."""
    p, f = polar_mesh(16, 5, 0.0)
    uv = np.round(0.5 + 0.48 * p[:, :2], 5)
    s = Sample(
        "cover-coarse", "the same part in few triangles, with uv", p, tuples(f), pair="cover-dense"
    )
    vt = ["vt " + " ".join(map(number, t)) for t in uv.tolist()]
    corners = ["f " + " ".join(f"{i + 1}/{i + 1}" for i in t) for t in f.tolist()]
    s.files["cover-coarse.obj"] = obj("cover-coarse", vertex_lines(p), vt, corners)
    return s
