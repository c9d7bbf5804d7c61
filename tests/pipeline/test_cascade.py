"""The state of a layout in the cascade: every step makes a new one."""

from __future__ import annotations

import numpy as np

from circparam.core.monitor import Monitor
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from tests.support import shapes
from tests.support.cascades import flat, sound, start, surface_of


def test_every_step_makes_a_new_cascade() -> None:
    """What went in stays as it was: corners, seams, counts and notes."""
    s = surface_of(*shapes.icosphere(1))
    before = start(s, np.zeros((len(s.faces), 3, 2)))
    after = fallback.settle(before, Monitor())
    assert sound(after)
    assert not before.atlas.corners.any()
    assert not before.atlas.cut.any()
    assert not before.tries.any()
    assert before.repairs == ()
    assert after.repairs


def test_counts_begin_at_nothing_and_notes_come_once() -> None:
    s = surface_of(*shapes.row_of(shapes.grid(3, 3), 2))
    cascade = start(s, flat(s))
    assert cascade.tries.tolist() == cascade.singles.tolist() == [0] * len(s.faces)
    more = cascade.noted("a", "b").noted("b", "c").repaired("x").repaired("x", "y")
    assert more.notes == ("a", "b", "c")
    assert more.repairs == ("x", "x", "y")
    assert cascade.notes == cascade.repairs == ()
    assert more.atlas is cascade.atlas


def test_charts_that_stand_in_keep_their_size() -> None:
    s = surface_of(*shapes.row_of(shapes.grid(3, 3), 3))
    cut_mesh = s.cut_mesh(np.zeros(len(s.edges), bool))
    for single, keep in ((0, False), (1, False), (2, True), (3, True)):
        singles = np.where(cut_mesh.chart == 1, single, 0)
        cascade = Cascade(start(s, flat(s)).atlas, singles=singles)
        assert cascade.kept_sizes(cut_mesh).tolist() == [False, keep, False]
