"""Colours that can be told apart, and the ends of scales."""

from __future__ import annotations

import numpy as np

from circparam.render import colours as col


def test_stretch_map_falls_in_lightness_evenly():
    lightness = col.oklab(col.stretch_map(64))[:, 0]
    assert (np.diff(lightness) < 0).all()
    steps = np.linalg.norm(np.diff(col.oklab(col.stretch_map(64)), axis=0), axis=1)
    assert steps.max() < 1.5 * steps.min()


def test_oklab_there_and_back():
    c = np.random.default_rng(0).random((50, 3))
    assert np.allclose(col.from_oklab(col.oklab(c)), c, atol=1e-5)


def test_chart_colours_differ_for_the_colour_blind():
    """Deuteranopes and protanopes (Viénot 1999): the first eight charts stay apart."""
    rgb = col.chart_colours(np.arange(8))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    for rows in (
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
    ):
        seen = np.clip(linear @ np.array(rows).T, 0, 1)
        lab = col.oklab(
            np.where(seen <= 0.0031308, seen * 12.92, 1.055 * seen ** (1 / 2.4) - 0.055)
        )
        gap = np.linalg.norm(lab[:, None] - lab[None], axis=2) + np.eye(8)
        assert gap.min() > 0.07


def test_scale_end_covers_the_surface():
    assert col.stretch_top(np.array([1.0, 1.01, 1.02]), np.ones(3)) == 1.05
    assert col.stretch_top(np.array([1.0, np.inf, 4.0]), np.ones(3)) == 5.0
    assert col.stretch_top(np.full(2, np.nan), np.ones(2)) == 2.0
