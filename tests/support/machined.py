"""More machine parts: with rows of holes, fillets and bosses, cones, steps and keyways."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from tests.support import parts
from tests.support.parts import Builder, Floats, Part, add_walls, circle, extrude, fill, lift


def perforated() -> Part:
    """A plate with two rows of holes and a pocket: the ears of its flats are slivers from hole to hole."""
    holes = [circle(12, 0.09, x, y) for y in (-0.8, 0.8) for x in np.linspace(-1.5, 1.5, 7)]
    outer = parts.rectangle(4.0, 2.4)
    return extrude(outer, holes, 0.3, [(parts.rectangle(3.0, 0.7), 0.15)])


def rounded(width: float, height: float, radius: float) -> Floats:
    """A rectangle whose corners are rounded, counter-clockwise."""
    t = np.pi / 2 * np.arange(9) / 8
    out = []
    for k, (sx, sy) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        a = t + k * np.pi / 2
        centre = [sx * (width / 2 - radius), sy * (height / 2 - radius)]
        out.append(np.stack([np.cos(a), np.sin(a)], 1) * radius + centre)
    return np.concatenate(out)


def housing() -> Part:
    """A box with rounded walls, hollow, with four bosses on its floor."""
    build = Builder()
    outer, inner = rounded(3.0, 2.0, 0.4), rounded(2.7, 1.7, 0.25)
    bosses = [circle(20, 0.18, x, y) for x in (-0.9, 0.9) for y in (-0.5, 0.5)]
    bores = [circle(12, 0.08, x, y) for x in (-0.9, 0.9) for y in (-0.5, 0.5)]
    build.add(lift(fill(outer), 0.0, False), True)
    add_walls(build, outer, 0.0, 1.0, True)
    build.add(lift(fill(outer, [inner]), 1.0, True), True)
    add_walls(build, inner, 0.15, 1.0, False)
    build.add(lift(fill(inner, bosses), 0.15, True), True)
    for boss, bore in zip(bosses, bores, strict=True):
        add_walls(build, boss, 0.15, 0.6, True)
        build.add(lift(fill(boss, [bore]), 0.6, True), True)
        add_walls(build, bore, 0.3, 0.6, False)
        build.add(lift(fill(bore), 0.3, True), True)
    return build.part()


def nozzle() -> Part:
    """A turned nozzle: cylinder, cone, flange, and a bore that narrows."""
    profile = [
        [0.2, 0], [0.4, 0], [0.7, 0.3], [0.7, 1.8], [1.1, 1.8], [1.1, 2.0], [0.5, 2.0], [0.5, 0.8], [0.2, 0.5],
    ]  # fmt: skip
    return parts.lathe(np.array(profile), 40)


def shaft() -> Part:
    """A shaft of three steps, the second with a keyway along it."""
    build = Builder()
    t = 2 * np.pi * np.arange(48) / 48
    ring = np.stack([np.cos(t), np.sin(t)], 1) * 0.7
    key = np.abs(ring[:, 1]) < 0.15
    before = ring[~(key & (ring[:, 0] > 0))]
    y = 0.15
    x = float(np.sqrt(0.49 - y * y))
    # the outline begins after the keyway, counter-clockwise, and ends with its three sides
    keyed = np.concatenate([[[x, y]], before, [[x, -y], [0.5, -y], [0.5, y]]])
    steps = [circle(48, 1.0), keyed, circle(32, 0.4)]
    heights = [0.0, 0.8, 2.4, 3.2]
    build.add(lift(fill(steps[0]), 0.0, False), True)
    for k, loop in enumerate(steps):
        add_walls(build, loop, heights[k], heights[k + 1], True)
        inside = [steps[k + 1]] if k < 2 else []
        build.add(lift(fill(loop, inside), heights[k + 1], True), True)
    return build.part()


def flange() -> Part:
    """A disk with a ring of six bolt holes, and a neck with a bore on it."""
    build = Builder()
    outer, neck, bore = circle(48, 1.0), circle(48, 0.5), circle(48, 0.38)
    bolts = [circle(20, 0.08, x, y) for x, y in circle(6, 0.77)]
    build.add(lift(fill(outer, [bore, *bolts]), 0.0, False), True)
    build.add(lift(fill(outer, [neck, *bolts]), 0.2, True), True)
    for loop in (outer, *bolts):
        add_walls(build, loop, 0.0, 0.2, loop is outer)
    add_walls(build, neck, 0.2, 0.8, True)
    build.add(lift(fill(neck, [bore]), 0.8, True), True)
    add_walls(build, bore, 0.0, 0.8, False)
    return build.part()


def barrel(staves: int = 20, rings: int = 6) -> Part:
    """A barrel of staves that bulge, with four bolts sunk into each lid."""
    build = Builder()
    height = np.linspace(-1, 1, rings + 1)
    loops = [np.c_[circle(staves, 1 - 0.2 * z * z), np.full(staves, z)] for z in height]
    for low, high in pairwise(loops):
        a, b, c, d = low, np.roll(low, -1, 0), np.roll(high, -1, 0), high
        quads = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1)
        for quad in quads:
            build.add(quad, True)
    bolts = [circle(16, 0.08, x, y) for x, y in circle(4, 0.5)]
    for side in (-1.0, 1.0):
        build.add(lift(fill(circle(staves, 0.8), bolts), side, side > 0), True)
        for bolt in bolts:
            add_walls(build, bolt, min(side, 0.8 * side), max(side, 0.8 * side), False)
            build.add(lift(fill(bolt), 0.8 * side, side > 0), True)
    return build.part()


MACHINED: dict[str, Callable[[], Part]] = {
    "perforated": perforated, "housing": housing, "nozzle": nozzle, "shaft": shaft,
}  # fmt: skip
