"""The search for cheaper seams: what is glued, what never is, what it has to bring, and where it ends."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams.cost import COST
from circparam.seams.moves.glue import Glue, MergeOptions, merge
from circparam.seams.search import Effort, search
from circparam.seams.segmentation.layout import lay_out_fresh
from circparam.solvers.newton import RelaxOptions
from tests.support import shapes
from tests.support.atlases import as_it_lies, cut_between, judged, middles, surface_of


def merge_with(
    atlas: Atlas, fixed: np.ndarray | None = None, time: Monitor | None = None, **options
) -> None:
    merge(atlas, MergeOptions(**{"bound": 1.05, **options}), time or Monitor(), fixed)


def halves_of_a_ring() -> Atlas:
    """A flat ring in two charts, laid out apart from each other."""
    surface = surface_of(*shapes.annulus(24, 3))
    atlas = as_it_lies(cut_between(surface, (middles(surface)[:, 1] > 0).astype(np.int64)))
    _, chart = atlas.charts()
    atlas.corners = atlas.corners + 3.0 * chart[:, None, None]
    return atlas


def test_two_charts_that_close_a_flat_ring_are_glued_at_both_arcs_at_once() -> None:
    """One arc alone leaves both sides of the other touching: that is tried first, and fails."""
    atlas = halves_of_a_ring()
    options = MergeOptions(1.0001, margin=0.05)
    family, counts = Glue(atlas, options), []
    for _ in range(3):
        search(atlas, family, options.demands, Effort(rounds=1), Monitor())
        counts.append(atlas.charts()[0])
    assert counts == [2, 2, 1], "one arc, the other, both"
    assert not atlas.cut.any()
    assert judged(atlas).energy == pytest.approx([1.0])


def test_seams_that_are_fixed_are_never_glued_nor_in_a_pair() -> None:
    atlas = halves_of_a_ring()
    x = atlas.surface.vertex_points[:, 0]
    right = atlas.cut & (x[atlas.ends[0]] > 0)
    merge_with(atlas, right, bound=1.0001, margin=0.0)
    assert atlas.cut[right].all()
    held = halves_of_a_ring()
    all_of_them = held.cut.copy()
    merge_with(held, all_of_them)
    assert np.array_equal(held.cut, all_of_them)


def test_limits_of_faces_time_rounds_and_work_are_kept() -> None:
    surface = surface_of(*shapes.grid(5, 3, 4.0, 1.0))

    def strips() -> Atlas:
        label = np.floor(middles(surface)[:, 0]).astype(np.int64)
        return as_it_lies(cut_between(surface, label))

    atlas = strips()
    merge_with(atlas, faces=8)
    assert np.bincount(atlas.charts()[1]).tolist() == [8, 8]
    atlas = strips()
    merge_with(atlas, faces=7)
    assert atlas.charts()[0] == 4
    atlas = strips()
    merge_with(atlas, rounds=0)
    assert atlas.charts()[0] == 4
    merge_with(atlas, rounds=1)
    assert 1 < atlas.charts()[0] < 4
    atlas = strips()
    merge_with(atlas, time=Monitor(timeout=0.0))
    assert atlas.charts()[0] == 4
    merge_with(atlas, work=-1.0)
    assert atlas.charts()[0] == 4
    merge_with(atlas, work=0.0)
    assert 1 < atlas.charts()[0] < 4, "a round is tried to its end"


@pytest.mark.parametrize(("height", "charts"), [(1.5, 1), (2.0, 2)])
def test_a_tip_is_glued_only_where_hardly_a_face_is_stretched_too_much(height, charts):
    """The higher tip, glued, leaves 1.5 % of the surface stretched over twice: dearer than its seam."""
    surface = surface_of(*shapes.spiked_disk(400, height))
    away = np.linalg.norm(middles(surface)[:, :2], axis=1)
    atlas = cut_between(surface, (away < 0.15).astype(np.int64))
    lay_out_fresh(atlas, None, RelaxOptions(tolerance=1e-5))
    merge_with(atlas, bound=1.5, margin=0.0)
    assert atlas.charts()[0] == charts


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
