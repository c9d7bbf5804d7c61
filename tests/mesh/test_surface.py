"""The surface: its copies, and the charts it remembers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circparam.mesh.surface import Surface
from tests.support import shapes
from tests.support.atlases import surface_of


def surface() -> Surface:
    whole = surface_of(*shapes.icosphere(1))
    return replace(whole, price=np.arange(1.0, len(whole.edges) + 1))


def test_copies_lie_one_behind_the_other_and_share_nothing() -> None:
    one = surface()
    three = one.copies(3)
    assert three.components[0] == 3 * one.components[0]
    m = len(one.faces)
    for k in range(3):
        part = three.part(np.arange(3 * m) // m == k)
        np.testing.assert_array_equal(part.edges, one.edges)
        np.testing.assert_array_equal(part.points[part.faces], one.points[one.faces])
        np.testing.assert_array_equal(part.price, one.price)
        np.testing.assert_array_equal(part.locked, one.locked)
    assert len(np.intersect1d(three.faces[:m], three.faces[m:])) == 0


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
