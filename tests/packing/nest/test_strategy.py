"""Nesting from end to end."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.packing import pack
from circparam.packing.options import PackOptions
from tests.support.packing import blobs, shelf


def test_nesting_beats_rows_of_boxes():
    faces, uv, chart = blobs(9, 5)
    options = PackOptions(512, effort=0.2)
    tight, rows = pack(faces, uv, chart, options), shelf(faces, uv, chart, options)
    assert tight.share[0] > 1.15 * rows.share[0]


def test_one_chart_is_turned_to_fill_the_page():
    """A square on its tip fills the page up to the border when turned by 45 degrees."""
    uv = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    packed = pack(faces, uv, np.zeros(2, int), PackOptions(256, 4))
    assert packed.share[0] == pytest.approx((248 / 256) ** 2, abs=1e-3)
