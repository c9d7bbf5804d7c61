"""A creature as an implicit surface, and the marching tetrahedra that turn it into triangles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Field = Callable[[np.ndarray], np.ndarray]
# tail, body, neck, head, snout, legs, ears: segments (start, end, radius at start, radius at end)
BONES = [
    ((-1.9, 0.0, 0.55), (-0.9, 0.0, 0.75), 0.1, 0.22),
    ((-0.9, 0.0, 0.8), (0.6, 0.0, 0.85), 0.42, 0.38),
    ((0.6, 0.0, 0.95), (1.15, 0.0, 1.45), 0.27, 0.2),
    ((1.15, 0.0, 1.5), (1.3, 0.0, 1.5), 0.3, 0.28),
    ((1.3, 0.0, 1.45), (1.75, 0.0, 1.35), 0.2, 0.12),
    ((-0.75, 0.3, 0.7), (-0.8, 0.42, 0.0), 0.24, 0.13),
    ((-0.75, -0.3, 0.7), (-0.8, -0.42, 0.0), 0.24, 0.13),
    ((0.5, 0.28, 0.7), (0.55, 0.4, 0.0), 0.2, 0.12),
    ((0.5, -0.28, 0.7), (0.55, -0.4, 0.0), 0.2, 0.12),
    ((1.1, 0.2, 1.7), (1.0, 0.36, 2.0), 0.13, 0.1),
    ((1.1, -0.2, 1.7), (1.0, -0.36, 2.0), 0.13, 0.1),
]


def creature_field(p: np.ndarray) -> np.ndarray:
    """The creature as it stands; negative inside."""
    return bones_field(p, BONES)


def bones_field(p: np.ndarray, bones: list) -> np.ndarray:
    """A smooth union of cone-shaped bones; negative inside."""
    total = np.zeros(p.shape[:-1])
    for start, end, r0, r1 in bones:
        a, b = np.array(start), np.array(end)
        t = np.clip(((p - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
        d = np.sqrt(((p - a - t[..., None] * (b - a)) ** 2).sum(-1)) - (r0 + t * (r1 - r0))
        total += np.exp(-12.0 * d)
    return -np.log(total) / 12.0


def marching_tetrahedra(
    values: np.ndarray, origin: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """The zero surface of values on a grid: six tetrahedra a cell, one or two triangles in each.

    values: (a, b, c). Returns (points, faces), oriented outwards (towards positive values).
    """
    shape = np.array(values.shape)
    flat = values.ravel()
    inside = flat < 0
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    cell = (
        np.stack(np.meshgrid(*[np.arange(k - 1) for k in shape], indexing="ij"), -1).reshape(-1, 3)
        @ stride
    )
    paths = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    tets = []
    for path in paths:
        corner = [cell]
        for axis in path:
            corner.append(corner[-1] + stride[axis])
        even = path in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        tets.append(np.stack(corner if even else [corner[0], corner[2], corner[1], corner[3]], 1))
    tet = np.concatenate(tets)
    tet = tet[inside[tet].any(1) & ~inside[tet].all(1)]
    count = inside[tet].sum(1)
    crossings: list[np.ndarray] = []  # (k, 3, 2): a triangle's corners as grid edges
    for lonely in (1, 3):  # one corner alone on its side: one triangle
        t = tet[count == lonely]
        alone = np.argmax(inside[t] == (lonely == 1), 1)
        others = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])[alone]
        apex = np.repeat(np.take_along_axis(t, alone[:, None], 1), 3, 1)
        tri = np.stack([apex, np.take_along_axis(t, others, 1)], 2)
        crossings.append(tri if lonely == 1 else tri[:, ::-1])
    t = tet[count == 2]  # two and two: a quad
    order = np.argsort(~inside[t], 1, kind="stable")
    parity = np.array([np.linalg.det(np.eye(4)[list(o)]) for o in order.tolist()])
    t = np.take_along_axis(t, order, 1)
    t = np.where((parity < 0)[:, None], t[:, [1, 0, 2, 3]], t)
    a, b, c, d = t.T
    quad = np.stack([np.stack(e, 1) for e in ((a, c), (a, d), (b, d), (b, c))], 1)
    crossings += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    edges = np.sort(np.concatenate(crossings).reshape(-1, 2), 1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    where = np.stack(np.unravel_index(unique, shape), -1) * step + origin
    f0, f1 = flat[unique[:, 0]], flat[unique[:, 1]]
    w = np.clip(f0 / (f0 - f1), 0.1, 0.9)[:, None]
    return where[:, 0] * (1 - w) + where[:, 1] * w, inverse.reshape(-1, 3)


def relaxed(
    points: np.ndarray, faces: np.ndarray, rounds: int = 30, field: Field = creature_field
) -> np.ndarray:
    """Even out the triangles: move vertices towards the mean of their neighbours, back onto the surface."""
    half = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = np.bincount(half[:, 0], minlength=len(points))[:, None]
    eye = np.eye(3) * 1e-4
    for _ in range(rounds):
        mean = (
            np.stack(
                [np.bincount(half[:, 0], points[half[:, 1], k], len(points)) for k in range(3)], 1
            )
            / count
        )
        points = points + 0.6 * (mean - points)
        gradient = np.stack([(field(points + e) - field(points - e)) / 2e-4 for e in eye], 1)
        value = field(points)[:, None]
        points = points - value * gradient / np.maximum((gradient**2).sum(1, keepdims=True), 1e-6)
    return points
