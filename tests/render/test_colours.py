"""Colours that can be told apart, and the ends of scales."""

import numpy as np
import pytest

from circparam.render import colours as col
from tests.support.looks import linear, srgb


def test_distortion_map_falls_in_lightness_evenly():
    lightness = col.oklab(col.distortion_map(64))[:, 0]
    assert (np.diff(lightness) < 0).all()
    steps = np.linalg.norm(np.diff(col.oklab(col.distortion_map(64)), axis=0), axis=1)
    assert steps.max() < 1.5 * steps.min()


def test_chart_colours_differ_for_the_colour_blind():
    """Deuteranopes and protanopes (Viénot 1999): the first eight charts stay apart."""
    rgb = col.chart_colours(np.arange(8))
    for rows in (
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
    ):
        seen = linear(rgb) @ np.array(rows).T
        lab = col.oklab(srgb(seen))
        gap = np.linalg.norm(lab[:, None] - lab[None], axis=2) + np.eye(8)
        assert gap.min() > 0.07


def test_lines_get_thinner_with_their_number():
    assert col.line_weight(0) == col.line_weight(5) == 1
    weights = [col.line_weight(x) for x in (30, 60, 120, 240, 1e4)]
    assert weights == sorted(weights, reverse=True)
    assert weights[0] < 1
    assert min(weights) > 0.1  # never gone


def contrast(a: str, b: str) -> float:
    """The contrast of two #rrggbb codes, 1 to 21 (WCAG 2.1)."""
    low, high = sorted(linear(col.rgb(code)) @ [0.2126, 0.7152, 0.0722] for code in (a, b))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", [col.LIGHT, col.DARK], ids=["light", "dark"])
def test_text_has_the_contrast_of_aa(scheme: dict[str, str]):
    """WCAG 2.1, 1.4.3: 4.5 for text; what is focused or chosen stands out by 3."""
    for text in ("INK", "MUTED", "ACCENT", "WARN"):
        for ground in ("PAPER", "PANEL"):
            assert contrast(scheme[text], scheme[ground]) >= 4.5, (text, ground)
    assert set(scheme) == set(col.LIGHT)
