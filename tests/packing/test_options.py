"""What packing refuses to be asked, and the gaps that follow from the padding."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.packing.options import MARGIN_TEXELS, PackOptions, lattice_gap, strip_gap


@pytest.mark.parametrize(
    "values",
    [
        {"padding": -1},
        {"padding": 130, "resolution": 256},
        {"resolution": 0},
        {"rotate": "45"},
        {"pages": 0},
        {"texel_density": -2.0},
        {"texel_density": 3.0, "scale": False},
    ],
)
def test_options_out_of_range_are_refused(values):
    with pytest.raises(OptionError):
        PackOptions(**values)


@pytest.mark.parametrize(
    ("fits", "fails"),
    [
        ({"resolution": 1, "padding": 0}, {"resolution": 0, "padding": 0}),
        ({"resolution": 16384}, {"resolution": 16385}),
        ({"resolution": 9, "padding": 4}, {"resolution": 8, "padding": 4}),
        ({"padding": 0}, {"padding": -1}),
        ({"pages": 100}, {"pages": 101}),
        ({"pages": 1}, {"pages": 0}),
        ({"texel_density": 1e-9}, {"texel_density": 0.0}),
        ({"texel_density": 1.0}, {"texel_density": float("inf")}),
        ({"texel_density": 1.0}, {"texel_density": float("nan")}),
    ],
)
def test_ranges_end_where_they_should(fits, fails):
    PackOptions(**fits)
    with pytest.raises(OptionError):
        PackOptions(**fails)


def differences(padding):
    """Differences of texel centres that are nearer than padding + 1, as (k, 2) whole numbers."""
    side = np.arange(-padding - 1, padding + 2)
    d = np.stack(np.meshgrid(side, side), 2).reshape(-1, 2)
    return d[(d**2).sum(1) < (padding + 1) ** 2]


@pytest.mark.parametrize("padding", range(12))
def test_the_gap_is_the_largest_distance_that_is_too_near(padding):
    longest = np.sqrt((differences(padding) ** 2).sum(1).max())
    assert lattice_gap(padding) == pytest.approx(longest, abs=1e-12)
    options = PackOptions(padding=padding)
    assert options.gap > max(longest, np.sqrt(2))
    assert options.gap == pytest.approx(max(longest, np.sqrt(2)), abs=0.011)
    assert options.box_gap == pytest.approx(max(padding, 1), abs=0.011)
    assert options.border == pytest.approx(max(padding - 0.5, 0), abs=0.011)


@pytest.mark.parametrize("padding", range(1, 10))
def test_a_strip_is_as_wide_as_any_pair_of_near_centres_reaches(padding):
    angle = np.linspace(0, 2 * np.pi, 37)
    normal = np.stack([np.cos(angle), np.sin(angle)], 1)
    reach = (differences(padding) @ normal.T).max(0)
    width = strip_gap(padding, normal)
    assert (width > np.maximum(reach, np.sqrt(2))).all()
    assert width == pytest.approx(np.maximum(reach, np.sqrt(2)), abs=0.011)
    assert width[0] == pytest.approx(max(padding, np.sqrt(2)), abs=0.011)
    assert (width <= PackOptions(padding=padding).gap + 1e-12).all()


def test_the_scale_that_the_user_fixes():
    assert PackOptions(resolution=64).fixed_scale is None
    assert PackOptions(resolution=64, texel_density=3.0).fixed_scale == 3.0
    assert PackOptions(resolution=64, scale=False).fixed_scale == 64.0


def test_borders_and_boxes_keep_the_padding():
    for padding, border, box in ((0, 0.0, 1), (1, 0.5, 1), (2, 1.5, 2), (4, 3.5, 4)):
        options = PackOptions(padding=padding)
        assert options.border == pytest.approx(border + MARGIN_TEXELS)
        assert options.box_gap == pytest.approx(box + MARGIN_TEXELS)
        # the centre of the last texel that must stay empty lies outside what charts may reach
        assert options.border > padding - 0.5
