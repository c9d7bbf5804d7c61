"""Meshes with known answers, made on the spot: every function returns (points (n, 3), faces (m, 3)).

All are wound counter-clockwise seen from outside (or from +z), and the same arguments always give the same
arrays. Topology is in the name or the docstring, so a test can say what it expects.
"""

import numpy as np
from scipy.spatial import Delaunay

from circparam.core.graph import components
from circparam.mesh.halfedge import shared_edges

Shape = tuple[np.ndarray, np.ndarray]


def compact(points: np.ndarray, faces: np.ndarray) -> Shape:
    """Drop unused vertices."""
    used, inverse = np.unique(faces, return_inverse=True)
    return points[used], inverse.reshape(-1, 3).astype(np.int64)


def weld(points: np.ndarray, faces: np.ndarray) -> Shape:
    """Join vertices that agree in 9 digits, keep the first position, drop collapsed faces."""
    keys = np.round(points, 9) + 0.0
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[faces]
    ok = (faces != np.roll(faces, 1, 1)).all(1)
    return compact(points[first], faces[ok])


def _grid_faces(nu: int, nv: int, closed_u: bool = False, closed_v: bool = False) -> np.ndarray:
    """Faces of a grid of nu × nv vertices, numbered u-major; (∂u, ∂v) is right-handed."""
    i, j = np.meshgrid(
        np.arange(nu if closed_u else nu - 1), np.arange(nv if closed_v else nv - 1), indexing="ij"
    )
    i, j = i.ravel(), j.ravel()
    i1, j1 = (i + 1) % nu, (j + 1) % nv
    a, b, c, d = i * nv + j, i1 * nv + j, i1 * nv + j1, i * nv + j1
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3)


def sheet_faces(rows: int, columns: int) -> np.ndarray:
    """Faces of rows × columns squares, corners numbered row by row; first the faces below the diagonals."""
    i = np.arange(rows * (columns + 1)).reshape(rows, columns + 1)[:, :-1].ravel()
    j = i + columns + 1
    return np.concatenate([np.stack([i, i + 1, j + 1], 1), np.stack([i, j + 1, j], 1)])


def _mesh_grid(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b = np.meshgrid(u, v, indexing="ij")
    return a.ravel(), b.ravel()


# disks ---------------------------------------------------------------------------------------------


def triangle() -> Shape:
    """One right triangle."""
    return np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])


def grid(nx: int = 9, ny: int = 7, width: float = 1.0, height: float = 1.0) -> Shape:
    """A flat rectangle of nx × ny vertices in the plane z = 0; all diagonals alike."""
    x, y = _mesh_grid(np.linspace(0, width, nx), np.linspace(0, height, ny))
    return np.stack([x, y, 0 * x], 1), _grid_faces(nx, ny)


def delaunay_square(n: int = 300, seed: int = 0) -> Shape:
    """A flat unit square, n random interior points, evenly spaced border, Delaunay triangles."""
    rng = np.random.default_rng(seed)
    k = max(2, round(np.sqrt(n)))
    t = np.arange(k) / k
    sides = [(t, 0 * t), (1 + 0 * t, t), (1 - t, 1 + 0 * t), (0 * t, 1 - t)]
    border = np.concatenate([np.stack(s, 1) for s in sides])
    margin = 0.3 / k
    p = np.concatenate([border, margin + (1 - 2 * margin) * rng.random((n, 2))])
    return _planar(p)


def delaunay_disk(n: int = 300, seed: int = 0) -> Shape:
    """A flat unit disk, n random interior points, evenly spaced border, Delaunay triangles."""
    rng = np.random.default_rng(seed)
    k = max(6, round(2 * np.sqrt(np.pi * n)))
    a = 2 * np.pi * np.arange(k) / k
    r, b = np.sqrt(rng.random(n)) * (1 - 3 / k), 2 * np.pi * rng.random(n)
    return _planar(np.stack([np.r_[np.cos(a), r * np.cos(b)], np.r_[np.sin(a), r * np.sin(b)]], 1))


def _planar(p: np.ndarray) -> Shape:
    faces = Delaunay(p).simplices.astype(np.int64)
    area = 2 * areas(p[faces])
    faces = np.where((area < 0)[:, None], faces[:, [0, 2, 1]], faces)[np.abs(area) > 1e-12]
    return compact(np.c_[p, np.zeros(len(p))], faces)


def rings(n: int = 6) -> Shape:
    """A flat disk of equilateral triangles (hexagon): all neighbours of an inner vertex equidistant."""
    points = [np.zeros((1, 2))]
    a = np.pi / 3 * np.arange(7)
    corner = np.stack([np.cos(a), np.sin(a)], 1)
    for r in range(1, n + 1):
        t = (np.arange(r) / r)[None, :, None]
        side = r * (corner[:-1, None] * (1 - t) + corner[1:, None] * t)
        points.append(side.reshape(-1, 2))
    return _planar(np.concatenate(points))


def bumped_disk(n: int = 1000, height: float = 0.6, seed: int = 0) -> Shape:
    """A disk with three smooth bumps, about n vertices."""
    p, f = delaunay_disk(n, seed)
    x, y = p[:, 0], p[:, 1]
    z = sum(
        h * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / w)
        for cx, cy, w, h in ((0.3, 0.2, 0.05, 1.0), (-0.4, 0.1, 0.09, -0.7), (0.0, -0.5, 0.04, 0.8))
    )
    return np.stack([x, y, height * z], 1), f


def hemisphere(n: int = 12) -> Shape:
    """The upper half of the unit sphere, n rings: a disk whose border is the equator."""
    p, f = rings(n)
    # hexagonal ring number of each vertex becomes its latitude, so the equator is met exactly
    a = np.arctan2(p[:, 1], p[:, 0])
    sector = (a % (np.pi / 3)) - np.pi / 6
    r = np.hypot(p[:, 0], p[:, 1]) * np.cos(sector) / np.cos(np.pi / 6) / n
    theta = r * np.pi / 2
    z = np.where(r > 1 - 1e-9, 0.0, np.cos(theta))
    return np.stack([np.sin(theta) * np.cos(a), np.sin(theta) * np.sin(a), z], 1), f


def tube(ratio: float = 5.0, around: int = 24, closed: bool = True, flare: float = 0.0) -> Shape:
    """A round tube of circumference 1 and length ``ratio``, capped at the far end: a disk that a convex map
    crushes by exp(−2π ratio). closed=False leaves both ends open (an annulus)."""
    along = max(2, round(ratio * around))
    h, a = _mesh_grid(np.linspace(0, ratio, along + 1), 2 * np.pi * np.arange(around) / around)
    r = (1 + flare * (1 - h / ratio)) / (2 * np.pi)
    p = np.stack([r * np.cos(a), r * np.sin(a), h], 1)
    f = _grid_faces(along + 1, around, closed_v=True)[:, [0, 2, 1]]
    if closed:
        top = len(p) - around + np.arange(around)
        p = np.r_[p, [[0, 0, ratio]]]
        f = np.r_[f, np.stack([top, np.roll(top, -1), np.full(around, len(p) - 1)], 1)]
    return p, f


def cone(around: int = 32, along: int = 12, slit: bool = False) -> Shape:
    """A cone without its base: a disk with an apex (slit=False), or cut along a generator: developable."""
    n = around + 1 if slit else around
    t, a = _mesh_grid(np.arange(1, along + 1) / along, 2 * np.pi * np.arange(n) / around)
    p = np.stack([t * np.cos(a), t * np.sin(a), 1.5 * (1 - t)], 1)
    p = np.r_[p, [[0, 0, 1.5]]]
    f = _grid_faces(along, n, closed_v=not slit)
    first = np.arange(n)
    fan = np.stack([np.full(n, len(p) - 1), first, np.roll(first, -1)], 1)
    return p, np.r_[f, fan[:-1] if slit else fan]


def half_cylinder(around: int = 24, along: int = 12) -> Shape:
    """A bent rectangle: a developable disk."""
    a, z = _mesh_grid(np.linspace(0, np.pi, around + 1), np.linspace(0, 1, along + 1))
    return np.stack([np.cos(a), np.sin(a), z], 1), _grid_faces(around + 1, along + 1)


def spiked_disk(n: int = 400, ratio: float = 20.0) -> Shape:
    """A flat disk with one long thin closed protrusion: no convex map of it survives double precision."""
    p, f = delaunay_disk(n)
    r, radius = np.hypot(p[:, 0], p[:, 1]), max(0.15, 4.0 / np.sqrt(n))
    z = np.where(r < radius, ratio * radius * (1 - r / radius), 0.0)
    return np.stack([p[:, 0], p[:, 1], z], 1), f


def wound(turn: float, around: int = 60, along: int = 4, inner: float = 0.7) -> Shape:
    """A flat ring of radii ``inner`` to 1 that runs through an angle: beyond a full turn it lies over itself,
    each turn a little higher."""
    t, r = _mesh_grid(np.linspace(0, turn, around), np.linspace(inner, 1, along))
    faces = _grid_faces(around, along)[:, ::-1]
    return np.stack([r * np.cos(t), r * np.sin(t), 1e-4 * t], 1), faces


# several borders -----------------------------------------------------------------------------------


def flat_ring(inner: float, outer: float, n: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """(uv (2n, 2), faces) of a ring of n quads between two circles, the inner one first."""
    points, faces = annulus(n, 1, inner / outer)
    return outer * points[:, :2], faces


def annulus(around: int = 32, along: int = 6, inner: float = 0.4) -> Shape:
    """A flat ring: one hole."""
    r, a = _mesh_grid(np.linspace(inner, 1, along + 1), 2 * np.pi * np.arange(around) / around)
    faces = _grid_faces(along + 1, around, closed_v=True)
    return np.stack([r * np.cos(a), r * np.sin(a), 0 * r], 1), faces


def cylinder(around: int = 24, along: int = 12, caps: bool = False, height: float = 2.0) -> Shape:
    """A cylinder of radius 1: open (two borders), or with flat caps (a sphere)."""
    z, a = _mesh_grid(np.linspace(0, height, along + 1), 2 * np.pi * np.arange(around) / around)
    p = np.stack([np.cos(a), np.sin(a), z], 1)
    f = _grid_faces(along + 1, around, closed_v=True)[:, [0, 2, 1]]
    if caps:
        low, n = np.arange(around), len(p)
        high = n - around + low
        p = np.r_[p, [[0, 0, 0], [0, 0, height]]]
        f = np.r_[
            f,
            np.stack([np.full(around, n), np.roll(low, -1), low], 1),
            np.stack([np.full(around, n + 1), high, np.roll(high, -1)], 1),
        ]
    return p, f


def rod() -> Shape:
    """A closed tube with round ends, its points in rows along the axis: each facet is a flat of many faces.

    The rows are where the lines of a lattice meet the circle, whose radius has a length of 6.4 cells.
    """
    cells, along, caps, length = 6.4, 80, 8, 6.0
    k = np.arange(-int(cells), int(cells) + 1) / cells
    u = np.r_[np.arccos(k), -np.arccos(k), np.arcsin(k), np.pi - np.arcsin(k)]
    u = np.unique(u % (2 * np.pi))
    u = u[np.diff(u, append=u[0] + 2 * np.pi) > 1e-6]
    around = len(u)
    v = np.linspace(0, np.pi / 2, caps + 1)[1:]
    r = np.r_[np.sin(v), np.ones(along - 1), np.sin(v[::-1])]
    z = np.r_[-np.cos(v), np.linspace(0, length, along + 1)[1:-1], length + np.cos(v[::-1])]
    sides = np.stack([r[:, None] * np.cos(u), r[:, None] * np.sin(u), z[:, None] + 0 * u], 2)
    n = len(z)
    i, j = np.divmod(np.arange((n - 1) * around), around)
    a, b = i * around + j, i * around + (j + 1) % around
    first, last = np.arange(around), (n - 1) * around + np.arange(around)
    faces = [np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)]
    faces.append(np.stack([np.full(around, n * around), np.roll(first, -1), first], 1))
    faces.append(np.stack([np.full(around, n * around + 1), last, np.roll(last, -1)], 1))
    points = np.r_[sides.reshape(-1, 3), [[0, 0, -1.0]], [[0, 0, length + 1.0]]]
    return points, np.concatenate(faces)


def holed_sheet(holes: int = 25, per_hole: int = 4) -> Shape:
    """A flat square with ``holes`` square holes (rounded up to a square number) in a regular grid."""
    k = int(np.ceil(np.sqrt(holes)))
    n = k * per_hole + 1
    p, f = grid(n + 1, n + 1)
    cell = np.arange(len(f)) // 2
    i, j = cell // n, cell % n
    hole = (i % per_hole == per_hole // 2) & (j % per_hole == per_hole // 2)
    number = (i // per_hole) * k + j // per_hole
    return compact(p, f[~(hole & (number < holes))])


def _inside(polygon: np.ndarray, p: np.ndarray) -> np.ndarray:
    """(n,) bool: points (n, 2) inside a polygon (k, 2), by crossings."""
    a, b = polygon, np.roll(polygon, -1, 0)
    spans = (a[:, 1] > p[:, None, 1]) != (b[:, 1] > p[:, None, 1])
    slope = (b - a)[:, 0] / np.where((b - a)[:, 1] == 0, 1.0, (b - a)[:, 1])
    x = a[:, 0] + (p[:, None, 1] - a[:, 1]) * slope
    return (spans & (p[:, None, 0] < x)).sum(1) % 2 == 1


def _star(rng: np.random.Generator, centre: np.ndarray, radius: float, rough: float) -> np.ndarray:
    """A random star-shaped polygon (k, 2), its corners at (1 − rough) to 1 times the radius."""
    k = int(rng.integers(4, 12))
    angle = 2 * np.pi * (np.arange(k) + 0.6 * rng.random(k)) / k
    r = radius * (1 - rough * rng.random(k))
    return centre + np.stack([r * np.cos(angle), r * np.sin(angle)], 1)


def cut_out(shape: Shape, holes: int, seed: int = 0, outline: bool = True) -> Shape:
    """The faces of a mesh over [−1, 1]² that lie in a random polygon with that many (0..6) polygonal holes.

    outline: a random star, not convex, in place of the square. The borders are as ragged as the mesh is coarse.
    """
    rng = np.random.default_rng(seed)
    p, f = shape
    c = p[f].mean(1)[:, :2]
    keep = _inside(_star(rng, np.zeros(2), 1.0, 0.3), c) if outline else np.ones(len(f), bool)
    angle = 2 * np.pi * (np.arange(5) + rng.random()) / 5
    centres = np.r_[[[0.0, 0.0]], 0.42 * np.stack([np.cos(angle), np.sin(angle)], 1)]
    for centre in centres[rng.permutation(6)[:holes]]:
        keep &= ~_inside(_star(rng, centre, rng.uniform(0.11, 0.17), 0.4), c)
    f = f[keep]
    # the largest part, faces joined across edges
    part = components(len(f), *(shared_edges(f) // 3).T)[1]
    return compact(p, f[part == np.bincount(part).argmax()])


def planar_holes(holes: int = 3, seed: int = 0, n: int = 700) -> Shape:
    """A flat figure of random Delaunay triangles: a polygon that is not convex, with polygonal holes (0..6)."""
    p = np.random.default_rng(seed).uniform(-1.1, 1.1, (n, 2))
    return cut_out(_planar(p), holes, seed)


def ruled_holes(holes: int = 3, seed: int = 0) -> Shape:
    """A rectangle with holes over [−1, 1]²; its vertices lie on lines x = const, so that bending along x, or
    turning these lines into the rays of a cone, stretches nothing."""
    rng = np.random.default_rng(seed)
    x, y = _mesh_grid(np.linspace(-1, 1, 27), np.linspace(-1, 1, 27))
    y = y + np.where(np.abs(y) < 0.99, rng.uniform(-0.02, 0.02, len(y)), 0.0)
    return cut_out((np.stack([x, y, 0 * x], 1), _grid_faces(27, 27)), holes, seed, outline=False)


def waved(shape: Shape, height: float = 0.2) -> Shape:
    """A flat shape lifted to smooth hills."""
    p, f = shape
    return np.stack([p[:, 0], p[:, 1], height * np.sin(4 * p[:, 0]) * np.cos(3 * p[:, 1])], 1), f


# closed --------------------------------------------------------------------------------------------


def icosphere(level: int = 2) -> Shape:
    """The unit sphere: 20·4^level faces."""
    g = (1 + np.sqrt(5)) / 2
    p = np.array(
        [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
         [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]], float,
    )  # fmt: skip
    f = np.array(
        [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2],
         [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11],
         [6, 2, 10], [8, 6, 7], [9, 8, 1]],
    )  # fmt: skip
    for _ in range(level):
        p, f = subdivide(p, f)
    return p / np.linalg.norm(p, axis=1, keepdims=True), f


def bumpy(level: int = 2) -> Shape:
    """A ball with bumps, for which several searches come to different charts."""
    p, f = icosphere(level)
    return p * (1 + 0.35 * np.sin(3 * p[:, :1]) * np.cos(4 * p[:, 1:2])), f


def stone(level: int = 3, rough: float = 0.1) -> Shape:
    """A round shape of few faces whose edges turn as sharply as those of a machined part."""
    points, faces = icosphere(level)
    far = 1 + rough * np.random.default_rng(0).uniform(-1, 1, (len(points), 1))
    return points * far, faces


def subdivide(points: np.ndarray, faces: np.ndarray) -> Shape:
    """Split every triangle in four at its edge midpoints."""
    half = np.stack([faces, np.roll(faces, -1, 1)], 2).reshape(-1, 2)
    edges, inverse = np.unique(np.sort(half, 1), axis=0, return_inverse=True)
    mid = inverse.reshape(-1, 3) + len(points)
    a, b, c = faces.T
    x, y, z = mid.T
    out = np.stack([a, x, z, x, b, y, z, y, c, x, y, z], 1).reshape(-1, 3)
    return np.r_[points, points[edges].mean(1)], out


def torus(nu: int = 32, nv: int = 16, major: float = 1.0, minor: float = 0.35) -> Shape:
    """A torus: closed, genus 1."""
    a, b = _mesh_grid(2 * np.pi * np.arange(nu) / nu, 2 * np.pi * np.arange(nv) / nv)
    r = major + minor * np.cos(b)
    p = np.stack([r * np.cos(a), r * np.sin(a), minor * np.sin(b)], 1)
    return p, _grid_faces(nu, nv, closed_u=True, closed_v=True)


def voxels(mask: np.ndarray, refine: int = 1) -> Shape:
    """The surface of a set of unit cubes, each side refine × refine quads, two triangles each."""
    solid = np.pad(np.kron(mask, np.ones((refine,) * 3, bool)).astype(bool), 1)
    points, faces = [], []
    for axis in range(3):
        step = np.eye(3, dtype=int)[axis]
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        for sign in (1, -1):
            cells = np.argwhere(solid & ~np.roll(solid, -sign, axis))
            base = cells + (step if sign > 0 else 0 * step)
            quad = [base, base + u, base + u + v, base + v]
            if sign < 0:
                quad = quad[::-1]
            points.append(np.stack(quad, 1).reshape(-1, 3))
    p = np.concatenate(points)
    q = np.arange(len(p)).reshape(-1, 4)
    faces = np.stack([q[:, [0, 1, 2]], q[:, [0, 2, 3]]], 1).reshape(-1, 3)
    return weld((p - 1) / refine, faces)


def cube(refine: int = 4) -> Shape:
    """The unit cube: closed, genus 0, 12·refine² faces."""
    return voxels(np.ones((1, 1, 1), bool), refine)


def handles(genus: int = 2, refine: int = 2) -> Shape:
    """A plate with ``genus`` square holes through it: closed, of that genus, sharp edges."""
    mask = np.ones((2 * genus + 1, 3, 1), bool)
    mask[1::2, 1] = False
    return voxels(mask, refine)


def double_torus(refine: int = 3) -> Shape:
    """A smooth closed surface of genus 2: a plate with two holes, rounded by averaging neighbours."""
    p, f = handles(2, refine)
    h = np.r_[f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]
    count = np.bincount(h[:, 0], minlength=len(p))[:, None]
    for _ in range(10):
        mean = np.stack([np.bincount(h[:, 0], p[h[:, 1], k], len(p)) for k in range(3)], 1) / count
        p = 0.5 * p + 0.5 * mean
    return p, f


# not manifold, not orientable ----------------------------------------------------------------------


def moebius(around: int = 24, across: int = 4) -> Shape:
    """A Möbius strip: one border, no orientation."""
    a, t = _mesh_grid(2 * np.pi * np.arange(around) / around, np.linspace(-0.4, 0.4, across + 1))
    r = 1 + t * np.cos(a / 2)
    p = np.stack([r * np.cos(a), r * np.sin(a), t * np.sin(a / 2)], 1)
    n = across + 1
    f = _grid_faces(around + 1, n)
    last = around * n
    return p, np.where(f >= last, across - (f - last), f)


def klein(nu: int = 24, nv: int = 12) -> Shape:
    """A Klein bottle (figure-8 immersion): closed, no orientation, Euler characteristic 0."""
    a, b = _mesh_grid(2 * np.pi * np.arange(nu) / nu, 2 * np.pi * np.arange(nv) / nv)
    w = np.cos(a / 2) * np.sin(b) - np.sin(a / 2) * np.sin(2 * b)
    z = np.sin(a / 2) * np.sin(b) + np.cos(a / 2) * np.sin(2 * b)
    p = np.stack([(2 + w) * np.cos(a), (2 + w) * np.sin(a), z], 1)
    f = _grid_faces(nu + 1, nv, closed_v=True)
    last = nu * nv
    return p, np.where(f >= last, (nv - (f - last)) % nv, f)


def fins(sheets: int = 3, n: int = 5) -> Shape:
    """``layers`` rectangles that share one edge line: non-manifold edges where layers > 2."""
    parts = []
    for k in range(sheets):
        p, f = grid(n, n)
        a = 2 * np.pi * k / sheets
        x, y = p[:, 0], p[:, 1]
        parts.append((np.stack([x * np.cos(a), x * np.sin(a), y], 1), f))
    return weld(*join(*parts))


def pinched(n: int = 4) -> Shape:
    """Two squares that meet in one vertex."""
    p, f = grid(n, n)
    return weld(*join((p, f), (p - [1, 1, 0], f)))


def boundary(faces: np.ndarray) -> np.ndarray:
    """(k,) vertices of the edges that one face has alone."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1)
    edge, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(edge[count == 1])


# changing shapes -----------------------------------------------------------------------------------


def join(*parts: Shape) -> Shape:
    """Several shapes in one mesh, nothing welded."""
    offset = np.cumsum([0] + [len(p) for p, _ in parts])
    return (
        np.concatenate([p for p, _ in parts]),
        np.concatenate([f + o for (_, f), o in zip(parts, offset, strict=False)]),
    )


def mirrored(shape: Shape) -> Shape:
    """A shape and its mirror image across x = 0, joined where they meet there."""
    p, f = shape
    return weld(np.concatenate([p, p * [-1, 1, 1]]), np.concatenate([f, f[:, ::-1] + len(p)]))


def row_of(shape: Shape, copies: int, gap: float = 0.5) -> Shape:
    """Copies of one shape side by side: many components."""
    p, f = shape
    step = np.array([np.ptp(p[:, 0]) * (1 + gap), 0, 0])
    return join(*[(p + i * step, f) for i in range(copies)])


def rotation(seed: int = 0) -> np.ndarray:
    """A random proper rotation (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def shuffled(points: np.ndarray, faces: np.ndarray, seed: int = 0) -> tuple[np.ndarray, ...]:
    """The same mesh, relabelled: (points, faces, old vertex of each new one, old face of each new one)."""
    rng = np.random.default_rng(seed)
    old = rng.permutation(len(points))
    new = np.empty(len(old), np.int64)
    new[old] = np.arange(len(old))
    order = rng.permutation(len(faces))
    turn = (rng.integers(0, 3, len(faces))[:, None] + np.arange(3)) % 3
    return points[old], new[np.take_along_axis(faces[order], turn, 1)], old, order


def noisy(points: np.ndarray, faces: np.ndarray, amount: float = 0.02, seed: int = 0) -> Shape:
    """The same mesh with every vertex moved at random by about ``amount`` × the mean edge length."""
    e = points[faces[:, 1]] - points[faces[:, 0]]
    step = amount * np.linalg.norm(e, axis=1).mean()
    return points + step * np.random.default_rng(seed).normal(size=points.shape), faces


def areas(corners: np.ndarray) -> np.ndarray:
    """Areas of triangles (..., 3, 3), or signed ones of triangles in the plane (..., 3, 2)."""
    a, b = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    if corners.shape[-1] == 3:
        return np.linalg.norm(np.cross(a, b), axis=-1) / 2
    return (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / 2


def normals(corners: np.ndarray) -> np.ndarray:
    """(..., 3) unit normals of triangles (..., 3, 3)."""
    n = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    return n / np.linalg.norm(n, axis=-1, keepdims=True)
