"""Straight borders: the directions of a chart, and what of them lies along the axes."""

import numpy as np

from circparam.geometry.straight import axis_parallel


def test_what_lies_along_an_axis() -> None:
    t = np.radians([0, 90, 180, 270, 0.4, 89.7, 0.6, 45])
    assert axis_parallel(np.stack([np.cos(t), np.sin(t)], 1)).tolist() == [True] * 6 + [False] * 2
