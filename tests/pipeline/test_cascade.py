"""The state of a layout in the cascade: every step makes a new one."""

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


def test_a_part_goes_its_own_way_and_comes_back() -> None:
    """Charts taken out, changed and put back: the others keep all they had, and sizes go by the whole."""
    s = surface_of(*shapes.row_of(shapes.grid(3, 3), 3))
    whole = start(s, flat(s)).repaired("before")
    _, chart = whole.atlas.charts()
    middle = chart == 1
    part = whole.part(middle)
    assert part.repairs == ()
    assert part.extent == whole.extent
    assert len(part.tries) == middle.sum()
    part.atlas.cut[:] = True
    part.atlas.corners += 5.0
    changed = Cascade(
        part.atlas, tries=part.tries + 3, singles=part.singles + 1, extent=part.extent
    ).repaired("within")
    after = whole.put(middle, changed)
    np.testing.assert_array_equal(after.tries, np.where(middle, 3, 0))
    np.testing.assert_array_equal(after.singles, np.where(middle, 1, 0))
    moved = np.abs(after.atlas.corners - whole.atlas.corners).max((1, 2))
    np.testing.assert_array_equal(moved, np.where(middle, 5.0, 0.0))
    np.testing.assert_array_equal(after.atlas.cut, middle[s.edges // 3].all(1))
    assert after.repairs == ("before", "within")
    assert not whole.atlas.cut.any()
