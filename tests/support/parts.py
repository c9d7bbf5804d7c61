"""Machine parts as CAD kernels export them: exact flats and tubes, cut into fans and slivers.

Every part knows which surface of the model (a flat, a tube ...) each of its triangles belongs to, so that
tests and benchmarks can ask whether an atlas cuts one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Part:
    """points (n, 3), faces (m, 3) wound outwards; surface (m,) which surface each face lies in; flat, tube
    (surfaces,) bool, that surface is plane, or closes round an axis and unrolls."""

    points: Floats
    faces: Ints
    surface: Ints
    flat: npt.NDArray[np.bool_]
    tube: npt.NDArray[np.bool_]


class Builder:
    """Collects surfaces; points are welded at the end."""

    def __init__(self) -> None:
        self.corners: list[Floats] = []
        self.labels: list[Ints] = []
        self.flat: list[bool] = []
        self.tube: list[bool] = []

    def add(self, corners: Floats, flat: bool, tube: bool = False) -> None:
        """One surface from its triangles (k, 3, 3)."""
        self.corners.append(corners)
        self.labels.append(np.full(len(corners), len(self.flat)))
        self.flat.append(flat)
        self.tube.append(tube)

    def part(self) -> Part:
        """All of it, welded to 9 digits."""
        corners = np.concatenate(self.corners)
        keys = np.round(corners.reshape(-1, 3), 9) + 0.0
        points, faces = np.unique(keys, axis=0, return_inverse=True)
        faces = faces.reshape(-1, 3).astype(np.int64)
        flags = np.array(self.flat), np.array(self.tube)
        return Part(points, faces, np.concatenate(self.labels), *flags)


def circle(n: int, radius: float, x: float = 0.0, y: float = 0.0) -> Floats:
    """(n, 2) points of a circle, counter-clockwise."""
    t = 2 * np.pi * np.arange(n) / n
    return np.stack([x + radius * np.cos(t), y + radius * np.sin(t)], 1)


def rectangle(width: float, height: float, x: float = 0.0, y: float = 0.0) -> Floats:
    """(4, 2) corners of a rectangle round (x, y), counter-clockwise."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    return corners * [width, height] + [x, y]


def _cross(o: Floats, a: Floats, b: Floats) -> float:
    return float((a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]))


def _bridged(outer: Floats, holes: Sequence[Floats]) -> Floats:
    """One polygon from an outline and its holes, joined by bridges, the holes with the largest x first."""
    ring = outer
    for hole in sorted(holes, key=lambda h: -h[:, 0].max()):
        clockwise = hole[::-1]
        inner = np.roll(clockwise, -int(clockwise[:, 0].argmax()), axis=0)
        nearest = np.argsort(((ring - inner[0]) ** 2).sum(1))
        at = next(int(k) for k in nearest if _sees([ring, *holes], inner[0], ring[k]))
        ring = np.concatenate([ring[: at + 1], inner, inner[:1], ring[at:]])
    return ring


def _sees(loops: Sequence[Floats], a: Floats, b: Floats) -> bool:
    """Whether no edge of some loops properly crosses the way from a to b."""
    return not any(
        _cross(a, b, p) * _cross(a, b, q) < 0 and _cross(p, q, a) * _cross(p, q, b) < 0
        for loop in loops
        for p, q in zip(loop, np.roll(loop, -1, axis=0), strict=True)
    )


def fill(outer: Floats, holes: Sequence[Floats] = ()) -> Floats:
    """(k, 3, 2) triangles of a polygon with holes by clipping ears as they come: fans and slivers."""
    ring = [*_bridged(outer, holes)]
    out = []
    while len(ring) > 3:
        for i in range(len(ring)):
            a, b, c = ring[i - 1], ring[i], ring[(i + 1) % len(ring)]
            if _cross(a, b, c) <= 1e-14:
                continue
            rest = np.array([p for p in ring if not any((p == v).all() for v in (a, b, c))])
            sides = [
                (q[0] - p[0]) * (rest[:, 1] - p[1]) - (q[1] - p[1]) * (rest[:, 0] - p[0]) >= -1e-12
                for p, q in ((a, b), (b, c), (c, a))
            ]
            if np.all(sides, axis=0).any():
                continue
            out.append([a, b, c])
            del ring[i]
            break
        else:
            raise ValueError("the outline crosses itself")
    out.append(ring)
    return np.array(out)


def lift(triangles: Floats, z: float, up: bool) -> Floats:
    """Plane triangles (k, 3, 2) at a height, facing up or down."""
    corners = np.concatenate([triangles, np.full((*triangles.shape[:2], 1), z)], 2)
    return corners if up else corners[:, ::-1]


def _walls(loop: Floats, low: float, high: float) -> Floats:
    """(n, 2, 3, 3) two triangles for every edge of an outline that is walked with the inside on its left."""
    after = np.roll(loop, -1, axis=0)
    a, b = np.c_[loop, np.full(len(loop), low)], np.c_[after, np.full(len(loop), low)]
    c, d = np.c_[after, np.full(len(loop), high)], np.c_[loop, np.full(len(loop), high)]
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1)


def add_walls(build: Builder, loop: Floats, low: float, high: float, outward: bool) -> None:
    """Walls of an outline: one surface for all that turn smoothly, so a circle is one tube."""
    quads = _walls(loop, low, high)
    if not outward:
        quads = quads[:, :, ::-1]
    along = np.roll(loop, -1, axis=0) - loop
    angle = np.arctan2(along[:, 1], along[:, 0])
    turn = np.abs(np.mod(np.roll(angle, -1) - angle + np.pi, 2 * np.pi) - np.pi)
    ends = np.flatnonzero(turn > np.radians(20))
    if len(ends) == 0:
        build.add(quads.reshape(-1, 3, 3), False, True)
        return
    quads = np.roll(quads, -(ends[0] + 1), axis=0)
    cuts = (ends - ends[0])[1:]
    for run in np.split(quads, cuts):
        build.add(run.reshape(-1, 3, 3), len(run) == 1)


def extrude(
    outer: Floats,
    holes: Sequence[Floats] = (),
    height: float = 1.0,
    pockets: Sequence[tuple[Floats, float]] = (),
) -> Part:
    """A plate: outline, through holes, pockets sunk from the top by a depth; loops are counter-clockwise."""
    build = Builder()
    build.add(lift(fill(outer, holes), 0.0, False), True)
    build.add(lift(fill(outer, [*holes, *(p for p, _ in pockets)]), height, True), True)
    add_walls(build, outer, 0.0, height, True)
    for hole in holes:
        add_walls(build, hole, 0.0, height, False)
    for loop, depth in pockets:
        build.add(lift(fill(loop), height - depth, True), True)
        add_walls(build, loop, height - depth, height, False)
    return build.part()


def lathe(profile: Floats, n: int = 48) -> Part:
    """A turned part: profile (k, 2) of radius and height, a closed loop, counter-clockwise with the radius to
    the right; one surface an edge."""
    build = Builder()
    t = 2 * np.pi * np.arange(n + 1) / n
    t[-1] = 0.0
    for (r0, z0), (r1, z1) in zip(profile, np.roll(profile, -1, axis=0), strict=True):
        a = np.stack([r0 * np.cos(t), r0 * np.sin(t), np.full(n + 1, z0)], 1)
        b = np.stack([r1 * np.cos(t), r1 * np.sin(t), np.full(n + 1, z1)], 1)
        first = np.stack([a[:-1], a[1:], b[1:]], 1)
        second = np.stack([a[:-1], b[1:], b[:-1]], 1)
        build.add(np.concatenate([first, second]), z0 == z1, r0 == r1)
    return build.part()


def gear(teeth: int = 16) -> Part:
    """A spur gear with a bore and a keyway."""
    t = 2 * np.pi * (np.arange(4 * teeth) / 4) / teeth
    radius = np.tile([1.0, 1.0, 1.22, 1.22], teeth)
    outline = np.stack([radius * np.cos(t), radius * np.sin(t)], 1)
    return extrude(outline, [circle(40, 0.4)], 0.35)


def bracket(fillet: float = 0.3, n: int = 12) -> Part:
    """An angle bracket whose inner corner is filleted, with a slot through it."""
    t = np.pi + np.pi / 2 * np.arange(n + 1) / n
    inner = np.stack([0.3 + fillet + fillet * np.cos(t), 0.3 + fillet + fillet * np.sin(t)], 1)
    outline = np.concatenate([[[0, 0], [2, 0], [2, 0.3]], inner[::-1], [[0.3, 1.6], [0, 1.6]]])
    return extrude(outline, [circle(24, 0.08, 1.7, 0.15)], 1.0)


def letters() -> Part:
    """A plaque with letters sunk into it."""
    h = np.array(
        [[0, 0], [1, 0], [1, 2], [2, 2], [2, 0], [3, 0], [3, 5], [2, 5], [2, 3], [1, 3], [1, 5], [0, 5]]
    )  # fmt: skip
    e = np.array(
        [[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [2, 2], [2, 3], [1, 3], [1, 4], [3, 4], [3, 5], [0, 5]]
    )  # fmt: skip
    sunk = [(h * 0.1 + [-0.7, -0.25], 0.1), (e * 0.1 + [-0.1, -0.25], 0.1)]
    return extrude(rectangle(2.0, 1.0), (), 0.3, [*sunk, (circle(32, 0.2, 0.6, 0.0), 0.1)])


def plate() -> Part:
    """A plate with bolt holes and two pockets."""
    bolts = [circle(24, 0.1, x, y) for x in (-1.3, 1.3) for y in (-0.7, 0.7)]
    sunk = [(rectangle(0.9, 0.8, -0.55, 0.0), 0.2), (circle(48, 0.4, 0.6, 0.0), 0.3)]
    return extrude(rectangle(3.0, 1.8), bolts, 0.5, sunk)


def flanged_pipe() -> Part:
    """A pipe with a flange at either end."""
    profile = np.array(
        [[0.5, 0], [1, 0], [1, 0.2], [0.6, 0.2], [0.6, 2], [1.1, 2], [1.1, 2.2], [0.5, 2.2]]
    )
    return lathe(profile)


def bushing() -> Part:
    """A turned bushing with a chamfer."""
    return lathe(np.array([[0.4, 0], [0.9, 0], [1.0, 0.1], [1.0, 0.8], [0.4, 0.8]]), 64)


def cube() -> Part:
    """Six flats."""
    return extrude(rectangle(1.0, 1.0))


def rounded_box(steps: int = 4, radius: float = 0.25) -> Part:
    """A box without a sharp edge: flats, fillets and eighths of a ball."""
    build = Builder()
    bend = np.pi / 4 * np.arange(steps + 1) / steps
    angle = np.concatenate([-bend[::-1], [0.0], bend])
    place = np.concatenate([np.full(steps + 1, -1.0), [0.0], np.full(steps + 1, 1.0)])
    size = np.array([1.0, 0.7, 0.4])
    x, y = np.meshgrid(np.arange(len(angle)), np.arange(len(angle)), indexing="ij")
    normal = np.stack([np.tan(angle[x]), np.tan(angle[y]), np.ones(x.shape)], 2)
    normal /= np.linalg.norm(normal, axis=2)[:, :, None]
    core = np.stack([place[x], place[y], np.ones(x.shape)], 2)
    for axis in range(3):
        for sign in (1.0, -1.0):
            way = np.array([sign, 1.0, sign])
            turned = [np.roll(v * way, axis, 2) for v in (core, normal)]
            p = turned[0] * size + radius * turned[1]
            a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
            quads = np.stack([np.stack([a, b, c], 2), np.stack([a, c, d], 2)], 2)
            flat = np.zeros(quads.shape[:2], bool)
            flat[steps : steps + 2, steps : steps + 2] = True
            build.add(quads[flat].reshape(-1, 3, 3), True)
            build.add(quads[~flat].reshape(-1, 3, 3), False)
    return build.part()


PARTS: dict[str, Callable[[], Part]] = {
    "plate": plate, "gear": gear, "flanged pipe": flanged_pipe, "bushing": bushing, "bracket": bracket,
    "letters": letters, "cube": cube,
}  # fmt: skip


def shaken(part: Part, size: float) -> Part:
    """The part with every point moved by up to size times its extent, as exporters of few digits do."""
    noise = np.random.default_rng(0).uniform(-1, 1, part.points.shape)
    points = part.points + size * np.ptp(part.points, axis=0).max() * noise
    return Part(points, part.faces, part.surface, part.flat, part.tube)
