"""What packing refuses to be asked, and the gaps that follow from the padding."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.options import PackOptions, lattice_gap, strip_gap


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
