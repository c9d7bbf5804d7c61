"""The surface: its copies, and the charts it remembers."""

from dataclasses import replace

import numpy as np
import pytest

from circparam.mesh.surface import Surface
from tests.support import shapes
from tests.support.atlases import surface_of


def surface() -> Surface:
    whole = surface_of(*shapes.icosphere(1))
    return replace(whole, price=np.arange(1.0, len(whole.edges) + 1))


def test_charts_follow_the_seams_also_when_the_same_array_changes() -> None:
    whole = surface()
    cut = np.zeros(len(whole.edges), bool)
    assert whole.charts(cut)[0] == 1
    cut[:] = True
    count, chart = whole.charts(cut)
    assert count == len(whole.faces)
    assert whole.charts(cut)[1] is chart
    with pytest.raises(ValueError, match="read-only"):
        chart[0] = 1
    cut[:] = False
    assert whole.charts(cut)[0] == 1
