"""Flat meshes with faces that single precision cannot tell apart, and what formats do to their numbers."""

import numpy as np
from scipy.spatial import Delaunay

from circparam.formats import io
from tests.support.shapes import areas, boundary, sheet_faces

ROUNDINGS = {
    "f4": lambda uv: uv.astype(np.float32).astype(np.float64),
    "glb": io.rounding("glb"),
    "f8": lambda uv: uv.copy(),
    "steps": lambda uv: np.round(uv * 2.0**24) / 2.0**24,
    "decimals": lambda uv: np.round(uv, 7),  # as a text of seven digits would
}


def crowd(rng: np.random.Generator, n: int, width: float):
    """A random square with n vertices within ``width`` of each other: (points (k, 2), faces), 0.1 wide."""
    q = rng.uniform(-0.5, 0.5, 2) + rng.normal(size=(n, 2)) * width / 0.05
    corners = [[-1.1, -1.1], [1.1, -1.1], [1.1, 1.1], [-1.1, 1.1]]
    p = np.concatenate([rng.uniform(-1, 1, (60, 2)), q, corners])
    return _upright(p * 0.05 + rng.uniform(0.1, 0.9, 2), Delaunay(p).simplices)


def band(rng: np.random.Generator, n: int, width: float):
    """A turned grid of n columns in which up to three rows lie only ``width`` apart: (points, faces)."""
    y = np.sort(np.r_[np.linspace(0, 1, 4), 0.5 + np.arange(rng.integers(1, 4)) * width / 0.05])
    px, py = np.meshgrid(np.linspace(0, 1, n), y)
    t = rng.uniform(0, 6)
    turn = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    p = 0.05 * np.stack([px.ravel(), py.ravel()], 1) @ turn + rng.uniform(0.2, 0.8, 2)
    return _upright(p, sheet_faces(len(y) - 1, n - 1))


def boundary_vertices(faces, n: int):
    """(n,) bool: the vertex is on a side that one face has alone."""
    out = np.zeros(n, bool)
    out[boundary(faces)] = True
    return out


def _upright(p, f):
    area = areas(p[f])
    return p, np.where(area[:, None] < 0, f[:, [0, 2, 1]], f)[area != 0]
