"""Scan conversion: every pixel belongs to the face it should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.raster import barycentric, fragments, rasterise


@settings(max_examples=40)
@given(st.integers(0, 10_000))
def test_triangles_of_a_plane_never_leave_gaps_nor_meet(seed: int):
    """A triangulated convex region: every pixel centre inside belongs to exactly one face."""
    rng = np.random.default_rng(seed)
    n = 7
    gx, gy = np.meshgrid(np.arange(n), np.arange(n))
    p = np.stack([gx.ravel(), gy.ravel()], 1).astype(float)
    inner = (p > 0).all(1) & (p < n - 1).all(1)
    p[inner] += rng.uniform(-0.2, 0.2, (int(inner.sum()), 2))
    p = p * 9.5 + rng.uniform(0, 3, 2)
    i = np.arange(n * (n - 1)).reshape(n - 1, n)[:, :-1].ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + n + 1], 1), np.stack([i, i + n + 1, i + n], 1)])
    _, _, layers = rasterise(p[faces], 64, 64)
    c = np.arange(64) + 0.5
    inside = (c >= p[:, 0].min()) & (c < p[:, 0].max())
    inside_y = (c >= p[:, 1].min()) & (c < p[:, 1].max())
    assert np.array_equal(layers, (inside_y[:, None] & inside[None, :]).astype(int))


def test_chunks_change_nothing(monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng(1)
    xy = rng.uniform(-5, 45, (300, 3, 2))
    depth = rng.uniform(0, 1, (300, 3))
    whole = rasterise(xy, 40, 40, depth)
    monkeypatch.setattr("circparam.geometry.raster.CHUNK", 500)
    assert sum(1 for _ in fragments(xy, 40, 40)) > 10
    for a, b in zip(whole, rasterise(xy, 40, 40, depth), strict=True):
        assert np.array_equal(a, b)


def test_broken_triangles_cover_nothing():
    xy = np.array(
        [
            [[np.nan, 0], [5, 0], [0, 5]],
            [[1, 1], [1, 1], [1, 1.0]],
            [[0, 0], [9, 0], [4, 0]],
            [[-9, -9], [-5, -9], [-9, -5]],
        ]
    )
    face, z, layers = rasterise(xy, 8, 8, np.zeros((4, 3)))
    assert (face == -1).all()
    assert np.isinf(z).all()
    assert not layers.any()


def test_barycentric_gives_the_pixel_back():
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, 30, (20, 3, 2))
    for part in fragments(xy, 30, 30):
        b = barycentric(xy, part.face, part.pixel, 30)
        there = np.einsum("pk,pkc->pc", b, xy[part.face])
        centre = np.stack([part.pixel % 30 + 0.5, part.pixel // 30 + 0.5], 1)
        assert np.abs(there - centre).max() < 1e-6
