"""Closest points of triangles and of surfaces, and points of a layout near a few places."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from circparam.core.arrays import group_boxes
from circparam.core.compiled import kd_tree
from circparam.core.types import BoolArray, FloatArray, IntArray

Nearest: TypeAlias = tuple[IntArray, FloatArray, FloatArray]

SAMPLES_PER_FACE = 4  # mean, more where faces are large


def closest_on_triangles(p: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Closest point of triangles (…, 3, 3) to places (…, 3): ((…, 3) barycentric, (…) squared distance)."""
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    ab, ac, ap = b - a, c - a, p - a
    g11, g12, g22 = (ab * ab).sum(-1), (ab * ac).sum(-1), (ac * ac).sum(-1)
    r1, r2 = (ap * ab).sum(-1), (ap * ac).sum(-1)
    det = g11 * g22 - g12 * g12
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles without area
        v, w = (g22 * r1 - g12 * r2) / det, (g11 * r2 - g12 * r1) / det
        inside = (det > 0) & (v >= 0) & (w >= 0) & (v + w <= 1)
        best = np.where(inside[..., None], np.stack([1 - v - w, v, w], -1), 0.0)
    d2 = np.where(inside, _gap(p, corners, best), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        start, along = corners[..., i, :], corners[..., j, :] - corners[..., i, :]
        length = np.maximum((along * along).sum(-1), 1e-300)
        t = np.clip(((p - start) * along).sum(-1) / length, 0, 1)
        edge = np.zeros_like(best)
        edge[..., i], edge[..., j] = 1 - t, t
        gap = _gap(p, corners, edge)
        nearer = gap < d2
        d2 = np.where(nearer, gap, d2)
        best = np.where(nearer[..., None], edge, best)
    return best, d2


def _gap(p: FloatArray, corners: FloatArray, bary: FloatArray) -> FloatArray:
    """Squared distance of places to points in triangles."""
    d = p - (bary[..., None] * corners).sum(-2)
    return (d * d).sum(-1)


def samples_of(areas: FloatArray, bounds: tuple[int, int]) -> tuple[IntArray, FloatArray]:
    """(face (s,), barycentric (s, 3)): the middle of every face, and more places by area, within bounds."""
    m, whole = len(areas), np.cumsum(areas)
    count = int(np.clip(SAMPLES_PER_FACE * m, *bounds))
    spread = np.searchsorted(whole, (np.arange(count) + 0.5) / count * whole[-1])
    face = np.concatenate([np.arange(m), np.minimum(spread, m - 1)])
    r = np.random.default_rng(3).random((count, 2))
    r[r.sum(1) > 1] = 1 - r[r.sum(1) > 1]
    return face, np.concatenate([np.full((m, 3), 1 / 3), np.c_[1 - r.sum(1), r]])


def walked(
    found: Nearest, beside: IntArray, best: Callable[[IntArray, IntArray], Nearest], steps: int
) -> Nearest:
    """Walk to neighbouring faces for as long as one is nearer.

    found: face (p,), barycentric (p, 3), distance (p,) of points. beside (m, 3): the neighbours of each face.
    best: (rows of the points, candidate faces of each) → the nearest of them, as ``found``.
    """
    face, bary, distance = found[0].copy(), found[1].copy(), found[2].copy()
    moving = np.arange(len(face))
    for _ in range(steps):
        new_face, new_bary, new_distance = best(moving, beside[face[moving]])
        nearer = new_distance < distance[moving]
        moving = moving[nearer]
        if len(moving) == 0:
            break
        face[moving], bary[moving] = new_face[nearer], new_bary[nearer]
        distance[moving] = new_distance[nearer]
    return face, bary, distance


def centres(uv: FloatArray, faces: IntArray) -> FloatArray:
    """(m, 2) centre of each face (m, 3) of a layout (n, 2)."""
    return (uv[faces[:, 0]] + uv[faces[:, 1]] + uv[faces[:, 2]]) / 3


def within(
    points: tuple[FloatArray, IntArray], places: tuple[FloatArray, IntArray], reach: FloatArray
) -> BoolArray:
    """(m,) bool: points that have a place of their own group nearer than the reach of the group.

    points, places: (m, 2) and (k, 2) with their groups (m,) and (k,). reach: (n,) by groups.
    """
    at, group = points
    to, of = places
    low, high = group_boxes(to, of, len(reach))
    whole = np.isinf(reach) & np.isfinite(low[:, 0])
    out: BoolArray = whole[group]
    with np.errstate(invalid="ignore"):  # a group without places has no box
        near = at >= (low - reach[:, None])[group]
        near &= at <= (high + reach[:, None])[group]
    some = np.flatnonzero(near[:, 0] & near[:, 1] & ~out)
    if len(some) == 0:
        return out
    # groups are layers of space that lie far apart
    apart = 4.0 * float(np.ptp(np.concatenate([at, to]), axis=0).max())
    apart += float(reach[np.isfinite(reach)].max(initial=1.0))
    tree = kd_tree(np.c_[to, of * apart])
    at, group = at[some], group[some]
    far, _ = tree.query(np.c_[at, group * apart], distance_upper_bound=float(reach[of].max()))
    out[some] = far < reach[group]
    return out
