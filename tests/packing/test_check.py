"""The check of a finished layout, to the texel."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing.check import PlacedCharts, faults
from circparam.packing.options import PackOptions


def two_squares(corners, side=8, page=64):
    """Layout of squares, a chart each, that cover side x side texel centres from the texels ``corners`` on."""
    square = np.array(
        [[0.25, 0.25], [side - 0.25, 0.25], [side - 0.25, side - 0.25], [0.25, side - 0.25]]
    )
    points = (np.array(corners)[:, None] + square) / page
    n = len(corners)
    return PlacedCharts(
        points.reshape(-1, 2), np.roll(points, -1, 1).reshape(-1, 2), np.repeat(np.arange(n), 4),
        np.zeros(n, int),
    )  # fmt: skip


@pytest.mark.parametrize("padding", [0, 1, 2, 4, 7])
@pytest.mark.parametrize("mirror", [False, True])
def test_the_gap_is_checked_to_the_texel(padding, mirror):
    """Centres of two charts are padding + 1 apart or more: as they should is let through, nearer is not."""
    options = PackOptions(resolution=64, padding=padding)
    seen = set()
    for dx in range(padding + 3):
        for dy in range(padding + 3):
            first, second = [20, 20], [27 + dx, 27 + dy]  # the nearest texels are (dx, dy) apart
            if mirror:
                first, second = [20, 27 + dy], [27 + dx, 20]
            if dx == dy == 0:
                continue
            wrong, share = faults(two_squares([first, second]), options)
            assert share[0] == 2 * 64 / 64**2
            assert (wrong is not None) == (dx**2 + dy**2 < (padding + 1) ** 2), (dx, dy, wrong)
            seen.add(wrong is not None)
    assert seen == ({False, True} if padding else {False})


@pytest.mark.parametrize("padding", [0, 1, 2, 4, 7])
def test_the_border_of_the_page_is_checked_to_the_texel(padding):
    options = PackOptions(resolution=64, padding=padding)
    last = 64 - 8 - padding
    for corner in ([padding, 30], [30, padding], [last, 30], [30, last]):
        assert faults(two_squares([corner]), options)[0] is None
        outward = np.sign(np.array(corner) - 30)
        wrong = faults(two_squares([corner + outward]), options)[0]
        assert wrong is not None
        assert ("border" if padding else "leaves the page") in wrong
