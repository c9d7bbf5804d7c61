"""Charts to pack, and everything that is promised of a packed layout, by means of this file only."""

import numpy as np
import pytest

from circparam.geometry.coverage import painted
from circparam.packing.options import Packed, PackOptions
from circparam.packing.outlines import shapes_of
from tests.support.shapes import areas

QUICK = 0.02  # effort: the guarantees hold after any amount of search


def blobs(n, seed, spread=0.8):
    """n star-shaped charts of mixed sizes: (faces, uv, chart)."""
    rng = np.random.default_rng(seed)
    faces, uv, chart, at = [], [], [], 0
    for c in range(n):
        k = int(rng.integers(5, 25))
        t = np.arange(k) * 2 * np.pi / k
        r = 1 + 0.5 * np.sin(rng.integers(1, 6) * t + rng.uniform(0, 6)) * rng.uniform(0.2, 1)
        p = np.stack([r * np.cos(t), rng.uniform(0.2, 1) * r * np.sin(t)], 1)
        a = rng.uniform(0, 6)
        p = p @ np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        p = np.r_[[[0, 0]], p] * np.exp(rng.normal(0, spread)) + rng.normal(0, 9, 2)
        i = np.arange(k)
        faces.append(np.stack([0 * i, 1 + i, 1 + (i + 1) % k], 1) + at)
        uv.append(p)
        chart.append(np.full(k, c))
        at += k + 1
    return np.concatenate(faces), np.concatenate(uv), np.concatenate(chart)


def owner_raster(corners, owner, side):
    """Owner of each texel of a page, −1 if empty, by each of its faces (m, 3, 2) alone."""
    own = np.repeat(np.arange(len(corners)), 3)
    face = painted(corners.reshape(-1, 2), np.roll(corners, -1, 1).reshape(-1, 2), own, side)
    return np.where(face < 0, -1, owner[face])


def edges_of(faces, uv):
    """Starts and ends (e, 2) of the edges of one face alone, of a chart whose faces are wound alike."""
    a, b = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    alone = ~np.isin(a * len(uv) + b, b * len(uv) + a)
    return uv[a[alone]], uv[b[alone]]


def triangles(n, seed):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(n, 3, 2)) * np.exp(rng.normal(0, 0.5, (n, 1, 1)))
    p[areas(p) < 0] = p[areas(p) < 0][:, ::-1]
    return np.arange(3 * n).reshape(n, 3), p.reshape(-1, 2), np.arange(n)


def covered(faces, uv, chart, res):
    """Texel centres inside each chart, one triangle after the other with half-planes: (res, res) sets."""
    owner = np.full((res, res), -1)
    twice = 0
    for f, c in zip(faces, chart, strict=True):
        q = uv[f] * res
        low = np.maximum(np.floor(q.min(0)).astype(int) - 1, 0)
        high = np.minimum(np.ceil(q.max(0)).astype(int) + 1, res)
        y, x = np.mgrid[low[1] : high[1], low[0] : high[0]] + 0.5
        sign = np.sign(areas(q))
        inside = np.ones(x.shape, bool)
        for k in range(3):
            a, b = q[k], q[(k + 1) % 3]
            inside &= sign * ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) >= -1e-9
        part = owner[low[1] : high[1], low[0] : high[0]]
        twice += int(((part >= 0) & (part != c) & inside).sum())
        part[inside] = c
    return owner, twice


def gap_and_border(owner):
    """Least distance of covered centres of two charts by all pairs of rim texels, and border distance."""
    from scipy.spatial import cKDTree

    y, x = np.nonzero(owner >= 0)
    res = len(owner)
    border = min(y.min(), x.min(), res - 1 - y.max(), res - 1 - x.max())
    who = owner[y, x]
    trees = [cKDTree(np.stack([x, y], 1)[who == c]) for c in np.unique(who)]
    gap = np.inf
    for i, a in enumerate(trees):
        for b in trees[:i]:
            gap = min(gap, float(b.query(a.data, distance_upper_bound=20)[0].min()))
    return gap, int(border)


def similarity_residual(before, after, chart_vertices):
    """Largest deviation from one scale, a turn and a move per chart, no mirror; and the scales found."""
    scales, worst = [], 0.0
    for v in chart_vertices:
        a = before[v] @ [1, 1j]
        b = after[v] @ [1, 1j]
        a, b = a - a.mean(), b - b.mean()
        z = np.vdot(a, b) / np.vdot(a, a)
        scales.append(abs(z))
        worst = max(worst, float(np.abs(z * a - b).max()))
    return worst, np.array(scales)


def vertices_of(faces, chart):
    return [np.unique(faces[chart == c]) for c in range(chart.max() + 1)]


def promise(faces, uv, chart, packed: Packed, options: PackOptions):
    """Everything that is promised of a packed layout, by means of this file only."""
    tile = np.zeros(len(uv), int)
    for c, v in enumerate(vertices_of(faces, chart)):
        tile[v] = packed.page[c]
    local = packed.uv - np.stack([tile, 0 * tile], 1)
    local = local.astype(np.float32).astype(float)
    assert local.min() >= 0
    assert local.max() <= 1
    for p in range(options.pages):
        on = packed.page[chart] == p
        owner, twice = covered(faces[on], local, chart[on], options.resolution)
        assert twice == 0
        assert packed.share[p] == pytest.approx((owner >= 0).mean(), abs=0.002)
        if (owner >= 0).any():
            gap, border = gap_and_border(owner)
            assert gap >= options.padding + 1
            assert border >= options.padding
    worst, scales = similarity_residual(uv, packed.uv, vertices_of(faces, chart))
    assert worst < 1e-9
    assert scales == pytest.approx(packed.scale)


def boxes(sizes, turn=0.0):
    """(faces, uv, chart) of rectangles side by side, one chart for each (width, height), turned by an angle."""
    sizes = np.asarray(sizes, float)
    n = len(sizes)
    corner = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]) * sizes[:, None]
    c, s = np.broadcast_to(np.cos(turn), n), np.broadcast_to(np.sin(turn), n)
    place = np.stack([10.0 * np.arange(n), np.full(n, 3.0)], 1)
    uv = corner @ np.stack([c, s, -s, c], 1).reshape(n, 2, 2) + place[:, None]
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(n)])
    return faces, uv.reshape(-1, 2), np.repeat(np.arange(n), 2)


def rectangles(sizes):
    """Shapes of rectangles, one chart for each (width, height)."""
    return shapes_of(*boxes(sizes))
