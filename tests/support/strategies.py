"""Hypothesis strategies for meshes: well-behaved ones for mathematics, hostile ones for robustness.

Every strategy yields (points (n, 3) float64, faces (m, 3) int64). Sizes stay small so that thousands of
cases fit in a minute; deterministic shapes with known answers are in ``tests.support.shapes``.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from hypothesis import strategies as st

from tests.support import shapes
from tests.support.shapes import Shape

seeds = st.integers(0, 2**20)


# well-behaved --------------------------------------------------------------------------------------


@st.composite
def planar_disks(draw: st.DrawFn, largest: int) -> Shape:
    """Flat random Delaunay disks with a convex border."""
    make = draw(st.sampled_from([shapes.delaunay_disk, shapes.delaunay_square]))
    return make(draw(st.integers(4, largest)), draw(seeds))


@st.composite
def disks(draw: st.DrawFn, largest: int = 120) -> Shape:
    """Random disks in space: Delaunay meshes, bent by random waves, stretched and rotated."""
    p, f = draw(planar_disks(largest))
    rng = np.random.default_rng(draw(seeds))
    height = draw(st.sampled_from([0.0, 0.1, 0.5, 2.0]))
    z = height * np.sin(p[:, :2] @ rng.normal(0, 4, (2, 3))).sum(1)
    p = np.c_[p[:, :2], z] * np.exp(rng.normal(0, 0.5, 3))
    return p @ shapes.rotation(draw(seeds)).T, f


@st.composite
def holed_disks(draw: st.DrawFn) -> Shape:
    """Random hills over a figure with one to four holes."""
    return shapes.waved(shapes.planar_holes(draw(st.integers(1, 4)), draw(seeds), n=200))


@st.composite
def folding_disks(draw: st.DrawFn) -> Shape:
    """Disks so rough and so stretched that methods without a guarantee flip faces of nearly all of them."""
    p, f = shapes.delaunay_disk(draw(st.integers(40, 120)), draw(seeds))
    waves = np.random.default_rng(draw(seeds)).normal(0, 6, (2, 3))
    p = p.copy()
    p[:, 2] = draw(st.sampled_from([1.5, 3.0])) * np.sin(p[:, :2] @ waves).sum(1)
    p *= [1.0, draw(st.sampled_from([0.15, 0.05])), 1.0]
    return p, f


SURFACES: list[Callable[[], Shape]] = [
    partial(shapes.icosphere, 1), partial(shapes.torus, 8, 6), partial(shapes.handles, 2, 1),
    partial(shapes.cube, 2), partial(shapes.cylinder, 8, 3), partial(shapes.cylinder, 8, 3, caps=True),
    partial(shapes.holed_sheet, 9, 3), partial(shapes.cone, 8, 3),
    lambda: shapes.row_of(shapes.icosphere(0), 3), partial(shapes.tube, 2.0, 8),
]  # fmt: skip


@st.composite
def surfaces(draw: st.DrawFn) -> Shape:
    """Manifold, oriented surfaces of every kind: closed, with handles, holes, several components."""
    made = draw(st.sampled_from(SURFACES))()
    amount = draw(st.sampled_from([0.0, 0.01, 0.1]))
    return shapes.noisy(*made, amount=amount, seed=draw(seeds))


# hostile -------------------------------------------------------------------------------------------


@st.composite
def soups(draw: st.DrawFn) -> Shape:
    """Random triangles over few points: degenerate, duplicate, non-manifold, unreferenced."""
    rng = np.random.default_rng(draw(seeds))
    n, m = draw(st.integers(1, 40)), draw(st.integers(1, 80))
    p = rng.normal(size=(n, 3))
    if draw(st.booleans()):
        p = np.round(p, 1)  # coincident and collinear points
    return p, rng.integers(0, n, (m, 3))


@st.composite
def glued_triangles(draw: st.DrawFn) -> Shape:
    """Triangles glued one after another to a random earlier edge, with random winding: any 2-complex."""
    rng = np.random.default_rng(draw(seeds))
    faces = [(0, 1, 2)]
    n = 3
    for _ in range(draw(st.integers(0, 30))):
        a, b, c = faces[rng.integers(len(faces))]
        if rng.random() < 0.25:
            apex = int(rng.integers(n))
        else:
            apex, n = n, n + 1
        edge = [(a, b), (b, c), (c, a)][rng.integers(3)]
        faces.append((*(edge if rng.random() < 0.3 else edge[::-1]), apex))
    return rng.normal(size=(n, 3)), np.array(faces, np.int64)


@st.composite
def sheets(draw: st.DrawFn) -> Shape:
    """Coincident and nearly coincident layers, some turned over, welded or not."""
    p, f = shapes.grid(4, 4)
    lift = draw(st.sampled_from([0.0, 1e-17, 1e-9]))
    parts = [(p, f)]
    for k in range(draw(st.integers(1, 3))):
        parts.append((p + np.array([0, 0, k * lift]), f if draw(st.booleans()) else f[:, ::-1]))
    q, g = shapes.join(*parts)
    return (q, g % len(p)) if draw(st.booleans()) else (q, g)


@st.composite
def needles(draw: st.DrawFn) -> Shape:
    """A disk squeezed until its triangles are needles, or with points slid along its edges."""
    p, f = draw(planar_disks(40))
    p = p * [1.0, 10.0 ** -draw(st.integers(0, 16)), 1.0]
    if draw(st.booleans()):
        move = np.random.default_rng(draw(seeds)).random(len(p)) < 0.2
        p = np.where(move[:, None], p[f[0, 0]] + 1e-14 * p, p)
    return p, f


@st.composite
def one_sided(draw: st.DrawFn) -> Shape:
    """Möbius strips, Klein bottles, and closed shapes with part of the faces turned."""
    kind = draw(st.sampled_from(["moebius", "klein", "turned"]))
    if kind == "moebius":
        return shapes.moebius(draw(st.integers(3, 12)), draw(st.integers(1, 3)))
    if kind == "klein":
        return shapes.klein(draw(st.integers(3, 8)), draw(st.integers(3, 8)))
    p, f = draw(surfaces())
    share = draw(st.sampled_from([0.05, 0.5, 1.0]))
    turn = np.random.default_rng(draw(seeds)).random(len(f)) < share
    return p, np.where(turn[:, None], f[:, ::-1], f)


@st.composite
def joints(draw: st.DrawFn) -> Shape:
    """Fins on one edge, squares that meet in a vertex, cubes that touch in an edge or a corner."""
    kind = draw(st.sampled_from(["fins", "pinched", "cubes"]))
    if kind == "fins":
        return shapes.fins(draw(st.integers(3, 6)), draw(st.integers(2, 4)))
    if kind == "pinched":
        return shapes.pinched(draw(st.integers(2, 4)))
    mask = np.random.default_rng(draw(seeds)).random((3, 3, 2)) < 0.5
    mask[0, 0, 0] = True
    return shapes.voxels(mask)


@st.composite
def scaled(draw: st.DrawFn, base: st.SearchStrategy[Shape]) -> Shape:
    """Any mesh at a scale of 1e-30 to 1e30, perhaps far from the origin, perhaps flattened."""
    p, f = draw(base)
    power = draw(st.sampled_from([0, 0, 0, -3, 3, -12, 12, -30, 30]))
    p = p * 10.0**power
    if draw(st.integers(0, 3)) == 0:
        p = p + 10.0 ** (power + draw(st.sampled_from([3, 8, 15])))
    if draw(st.integers(0, 7)) == 0:
        p = p * [1.0, 1.0, 0.0]
    return p, f


def hostile() -> st.SearchStrategy[Shape]:
    """Whatever a file found somewhere may hold."""
    bad = soups(), glued_triangles(), sheets(), needles(), one_sided(), joints()
    return scaled(st.one_of(*bad, surfaces(), disks(40)))
