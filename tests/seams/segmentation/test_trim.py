"""Overlaps of a few faces are cut off; everything else stays where it lies."""

import numpy as np
import pytest

from circparam.mesh.atlas import Atlas
from circparam.seams.segmentation.grow import dual_graph
from circparam.seams.segmentation.trim import Boxes, trim_overlaps
from tests.support import shapes
from tests.support.atlases import as_it_lies, judged, uncut


def flat_ring(turn: float, gaps: int = 0) -> Atlas:
    """A flat ring of an angle in its own plane, one end on the other where that is more than a full turn.

    gaps: quads that are missing from the middle of the ring at its far end, which leaves two ends.
    """
    points, faces = shapes.wound(turn)
    i, j = np.divmod(np.arange(len(faces)) // 2, 3)
    return as_it_lies(uncut(points, faces[(j != 1) | (i < 59 - gaps)]))


def trimmed(atlas: Atlas) -> bool:
    """Whether its one chart lost what lay on the rest."""
    laid = judged(atlas)
    assert laid.overlapping.all()
    return bool(trim_overlaps(atlas, dual_graph(atlas.surface), laid, np.ones(1, bool))[0])


@pytest.mark.parametrize("over", [0.01, 0.15, 4.0])
def test_an_end_that_lies_on_the_other_is_cut_off(over: float) -> None:
    """One part goes, nothing moves, and no chart lies on itself."""
    atlas = flat_ring(2 * np.pi + over)
    before = atlas.corners.copy()
    assert trimmed(atlas)
    assert np.array_equal(atlas.corners, before)
    count, chart = atlas.charts()
    assert count == 2
    # by the angle, and two columns of faces at either side of its end
    assert np.bincount(chart).min() <= 6 * (59 * over / (2 * np.pi) + 2)
    assert not judged(atlas).overlapping.any()


def test_two_parts_that_lie_on_others_are_left_to_a_cut_in_two() -> None:
    """Cut off, they would be two charts more."""
    atlas = flat_ring(2 * np.pi + 0.15, gaps=4)
    assert not trimmed(atlas)
    assert not atlas.cut.any()


def test_charts_that_are_not_asked_for_stay() -> None:
    """The layout is not looked at elsewhere."""
    atlas = flat_ring(2 * np.pi + 0.15)
    laid, none = judged(atlas), np.zeros(1, bool)
    assert not trim_overlaps(atlas, dual_graph(atlas.surface), laid, none).any()
    assert not atlas.cut.any()


def test_boxes_that_meet_are_found_whatever_their_widths() -> None:
    """Widths over six orders of magnitude, against the comparison of all pairs."""
    random = np.random.default_rng(5)
    low = random.uniform(0, 1, (2, 300))
    high = low + 10.0 ** random.uniform(-6, 0, (2, 300))
    faces = np.flatnonzero(random.uniform(size=300) < 0.8)
    some = faces[::3]
    f, g = Boxes(low, high, faces).near(some)
    meet = (
        (low[:, some, None] < high[:, None, faces]) & (low[:, None, faces] < high[:, some, None])
    ).all(0)
    expected = {(int(some[i]), int(faces[j])) for i, j in np.argwhere(meet)}
    assert len(f) == len(expected)
    assert set(zip(f.tolist(), g.tolist(), strict=True)) == expected
