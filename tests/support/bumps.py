"""Balls with bumps, dense and coarse, with uv; and a ray tracer that knows nothing of trees."""

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.shapes import sheet_faces


def belt(rows: int, columns: int, bump: float = 0.0, twist: float = 0.0) -> tuple[Mesh, UVMap]:
    """The unit ball between latitudes ±63°, one chart cut along a meridian, with bumps along its normal.

    twist: how far the grid's columns lean, so that two belts share no edges.
    """
    v, u = (a.ravel() for a in np.meshgrid(
        np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1), indexing="ij"
    ))  # fmt: skip
    inner = np.sin(np.pi * u) * np.sin(np.pi * v)
    x, y = u + twist * inner * 0.1, v - twist * inner * 0.05
    faces, uv = sheet_faces(rows, columns), np.stack([0.05 + 0.9 * x, 0.2 + 0.5 * y], 1)
    return Mesh(surface(x, y, bump), faces), UVMap(uv, faces)


def surface(u: FloatArray, v: FloatArray, bump: float) -> FloatArray:
    """(n, 3) points of the bumpy ball at parameters in 0..1."""
    a, b = 2 * np.pi * u, 2.2 * (v - 0.5)
    r = 1 + bump * np.sin(9 * a) * np.sin(8 * b)
    return r[:, None] * np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], 1)


def traced(
    mesh: Mesh, origin: FloatArray, direction: FloatArray, reach: float
) -> tuple[IntArray, FloatArray]:
    """The outermost front face on each line within reach, −1 for none, and where: every face is tried.

    Möller and Trumbore (1997), a line at a time over all faces.
    """
    c = mesh.points[mesh.faces]
    e1, e2 = c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]
    face, place = np.full(len(origin), -1), np.zeros(len(origin))
    for k, (o, d) in enumerate(zip(origin, direction, strict=True)):
        h = np.cross(d, e2)
        det = (e1 * h).sum(1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = o - c[:, 0]
            u = (s * h).sum(1) / det
            q = np.cross(s, e1)
            v = (q * d).sum(1) / det
            t = (q * e2).sum(1) / det
            met = (u >= 0) & (v >= 0) & (u + v <= 1) & (np.abs(t) <= reach) & (det < 0)
        if met.any():
            face[k] = np.argmax(np.where(met, t, -np.inf))
            place[k] = t[face[k]]
    return face, place
