"""Pairs of surfaces for maps: closed blobs and sheets in several meshes, and places that correspond."""

import numpy as np
from scipy.spatial import cKDTree

from circparam.geometry.closest import closest_on_triangles
from circparam.mesh.mesh import Mesh
from tests.support import shapes

# directions of eight landmarks on a blob, away from each other
DIRECTIONS = np.array(
    [[1, 0, 0.1], [-1, 0.2, 0], [0, 1, 0], [0.1, -1, 0.2], [0.2, 0, 1], [0, 0.1, -1], [1, 1, 1], [-1, -1, 0.8]]
)  # fmt: skip
UNIT = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None]


def blob(level: int = 3, seed: int = 0, turned: int = 0) -> Mesh:
    """A smooth bumpy sphere, the same surface for every level and ``turned`` (which turns its triangles).

    It has a vertex in each of DIRECTIONS.
    """
    p, f = shapes.icosphere(level)
    p = p @ shapes.rotation(turned).T if turned else p
    p[cKDTree(p).query(UNIT)[1]] = UNIT
    return Mesh(p * radius(p, seed)[:, None], f)


def radius(directions: np.ndarray, seed: int = 0) -> np.ndarray:
    """How far the surface of a blob lies from the origin in unit directions (n, 3)."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(4, 3))
    return 1 + 0.4 * np.sin(2 * directions @ axes.T + rng.uniform(0, 6, 4)).mean(1)


def nearest(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """(k,) the vertices nearest to some points."""
    return cKDTree(mesh.points).query(points)[1].astype(np.int64)


def marks(a: Mesh, b: Mesh, k: int = 8) -> np.ndarray:
    """(k, 2) vertices of two blobs in the same directions."""
    unit = [m.points / np.linalg.norm(m.points, axis=1)[:, None] for m in (a, b)]
    return np.stack([cKDTree(u).query(UNIT[:k])[1] for u in unit], 1).astype(np.int64)


def longest_edge(mesh: Mesh) -> float:
    """Length of the longest edge."""
    p = mesh.points[mesh.faces]
    return float(np.linalg.norm(p - np.roll(p, 1, 1), axis=2).max())


def there_and_back(a: Mesh, b: Mesh, found) -> float:
    """How far the map A → B → A moves a vertex of A at most."""
    back = found.to_a.of(a.points, a.faces)
    again = np.einsum("kc,kcd->kd", found.to_b.weights, back[b.faces[found.to_b.face]])
    return float(np.linalg.norm(again - a.points, axis=1).max())


def back_through_overlay(a: Mesh, b: Mesh, mapped) -> float:
    """How far A → B → A moves a vertex of A, back through the part of the overlay that it lies in on B."""
    made = mapped.overlay
    there = mapped.to_b.of(b.points, b.faces)
    order = np.argsort(made.parents[:, 1], kind="stable")
    keys = made.parents[order, 1]
    first = np.searchsorted(keys, mapped.to_b.face)
    count = np.searchsorted(keys, mapped.to_b.face, side="right") - first
    who = np.repeat(np.arange(len(there)), count)
    part = order[np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())]
    on_a, on_b = (p.of(m.points, m.faces) for p, m in ((made.on_a, a), (made.on_b, b)))
    weights, square = closest_on_triangles(there[who], on_b[made.faces[part]])
    home = np.einsum("kc,kcd->kd", weights, on_a[made.faces[part]])
    off = np.linalg.norm(home - a.points[who], axis=1)
    best = np.lexsort((off, np.round(np.sqrt(square), 9), who))
    best = best[np.unique(who[best], return_index=True)[1]]
    assert len(best) == len(there)
    return float(off[best].max())


def solid_angles(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m,) signed solid angle of each face, seen from the origin (van Oosterom and Strackee 1983)."""
    a, b, c = (
        points[faces[:, k]] / np.linalg.norm(points[faces[:, k]], axis=1)[:, None] for k in range(3)
    )
    dot = lambda x, y: (x * y).sum(1)  # noqa: E731
    return 2 * np.arctan2(dot(a, np.cross(b, c)), 1 + dot(a, b) + dot(b, c) + dot(c, a))
