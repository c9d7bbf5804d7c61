"""Charts as packers see them: outlines, boxes, angles."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.packing import pack


def test_charts_that_share_a_vertex_are_refused():
    uv = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    with pytest.raises(OptionError, match="shares a uv vertex"):
        pack(np.array([[0, 1, 2], [1, 3, 2]]), uv, np.array([0, 1]))
