"""Merging where every union has to lower the cost of the atlas."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.moves.glue import MergeOptions, merge
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import cut_between, middles, surface_of

STEPS = RelaxOptions(tolerance=1e-6, max_iterations=60)


def sheet_and_ball() -> Atlas:
    """A flat sheet in four pieces, which cost nothing to be merged, and a ball in eight, which do."""
    sheet, ball = shapes.grid(12, 12), shapes.icosphere(3)
    surface = surface_of(*shapes.join(sheet, (ball[0] + [5, 0, 0], ball[1])))
    middle = middles(surface)
    flat = np.abs(middle[:, 2]) < 1e-12
    flat[len(sheet[1]) :] = False
    octant = (middle > [5, 0, 0]) @ [1, 2, 4]
    quarter = (middle[:, :2] > 0.45) @ [1, 2]
    atlas = cut_between(surface, np.where(flat, quarter, 10 + octant))
    lay_out_fresh(atlas, None, STEPS)
    assert atlas.charts()[0] == 12
    return atlas


def test_unions_that_have_to_lower_the_cost_do_so_one_by_one() -> None:
    """The pieces of the sheet merge at no cost; those of the ball as far as a seam is worth its distortion."""
    atlas = sheet_and_ball()
    free = sheet_and_ball()
    before = COST.of_components(atlas, relaxed=True)
    merge(free, MergeOptions(2.0, chart=np.inf), Monitor())
    merge(atlas, MergeOptions(2.0), Monitor())
    after = COST.of_components(atlas, relaxed=True)
    assert (after < before).all()
    assert after.sum() < COST.of_components(free, relaxed=True).sum()
    assert atlas.charts()[0] < 9


def test_an_isometric_layout_costs_its_seams_and_charts_alone() -> None:
    points, faces = shapes.grid(6, 6)
    surface = surface_of(points, faces)
    atlas = cut_between(surface, (middles(surface)[:, 0] > 0.5).astype(int))
    lay_out_fresh(atlas, None, STEPS)
    expected = COST.seams(atlas)
    assert COST.of_components(atlas, relaxed=True).sum() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("stretch", "tail"), [(1.0, 0.0), (1.5, 0.0), (2.5, COST.tail), (0.4, COST.tail)]
)
def test_a_stretched_face_costs_its_distortion_and_its_tail(stretch: float, tail: float) -> None:
    energy = (stretch**2 + 1 + 1 / stretch**2 + 1) / 4
    jacobian = np.array([[stretch, 0.0], [0.0, 1.0]])[:, :, None]
    assert COST.loss(jacobian) == pytest.approx(COST.distortion * (energy - 1) + tail, abs=1e-12)
