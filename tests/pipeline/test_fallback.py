"""The cascade: whatever a method returns, however little time is left, the layout that comes out is sound."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.core.monitor import Monitor
from circparam.errors import InputError
from circparam.geometry.distortion import chart_distortion
from circparam.mesh.atlas import Atlas
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.pipeline import fallback
from circparam.pipeline.fallback import (
    FAULTY_DISTORTION,
    MOST_SINGLES,
    Cascade,
    CascadeRules,
    project_charts,
    take_to_pieces,
)
from tests.support import shapes, strategies
from tests.support.atlases import surface_of as surface_of


def start(
    surface: Surface, corners: np.ndarray, cut: np.ndarray | None = None, **rules: object
) -> Cascade:
    cut = np.zeros(len(surface.edges), bool) if cut is None else cut
    return Cascade(Atlas(surface, cut, corners), CascadeRules(**rules))


def sound(cascade: Cascade) -> bool:
    return not fallback.faults(*cascade.open()).any()


def flat(surface: Surface) -> np.ndarray:
    return surface.points[surface.faces][:, :, :2].copy()


def test_a_flipped_chart_is_mapped_again_and_others_are_left_alone() -> None:
    s = surface_of(*shapes.row_of(shapes.grid(5, 5), 3))
    corners = flat(s)
    middle = np.repeat(np.arange(3), 32) == 1
    corners[middle] *= [-1, 1]
    cascade = start(s, corners.copy())
    cascade = fallback.settle(cascade, Monitor())
    assert sound(cascade)
    np.testing.assert_array_equal(cascade.atlas.corners[~middle], corners[~middle])
    assert len(cascade.repairs) == 1
    assert "flipped" in cascade.repairs[0]


def spiral_strip() -> tuple[Surface, np.ndarray]:
    """A flat strip in space, and a layout of it that winds over itself without a flip."""
    p, f = shapes.grid(60, 2, 10.0, 0.5)
    angle, r = 0.3 * np.pi * p[:, 0], 1 + p[:, 1]
    s = surface_of(p, f)
    corners = np.stack([r * np.sin(angle), -r * np.cos(angle)], 1)[s.faces]
    if shapes.areas(corners[0]) < 0:
        corners[..., 0] *= -1
    return s, corners


def test_a_chart_that_overlaps_itself_is_split() -> None:
    s, corners = spiral_strip()
    cascade = start(s, corners)
    assert fallback.faults(*cascade.open()).tolist() == [fallback.OVERLAPPING]
    cascade = fallback.settle(cascade, Monitor())
    assert sound(cascade)
    assert s.charts(cascade.atlas.cut)[0] == 2
    assert "overlapped" in cascade.repairs[0]


def test_a_chart_beyond_its_bound_is_split_until_its_parts_are_below() -> None:
    s = surface_of(*shapes.bumped_disk(400, height=1.0))
    whole = s.cut_mesh(np.zeros(len(s.edges), bool))
    top = METHODS["mean-value"].function(whole, MethodOptions(), Monitor())
    corners = top.uv[whole.faces]
    for bound in (FAULTY_DISTORTION, 1.1):
        cascade = fallback.settle(start(s, corners, bound=bound), Monitor())
        assert sound(cascade)
        assert (chart_distortion(*cascade.open()) <= bound).all()
        assert (s.charts(cascade.atlas.cut)[0] == 1) == (bound == FAULTY_DISTORTION)
    assert "distorted" in cascade.repairs[0]
    no_leave = start(s, corners, bound=1.1, may_split=False)
    assert fallback.settle(no_leave, Monitor()) is no_leave
    assert 1.1 < chart_distortion(*no_leave.open()) < fallback.LATE_BOUND
    in_no_time = start(s, corners, bound=1.1)
    assert fallback.settle(in_no_time, Monitor(timeout=1e-9)) is in_no_time
    np.testing.assert_array_equal(in_no_time.atlas.corners, corners)


def test_out_of_time_only_charts_far_beyond_any_bound_are_projected() -> None:
    """What was begun too late may be sound and of no use; a little too much is better than many charts."""
    s = surface_of(*shapes.row_of(shapes.grid(6, 6), 2))
    corners = flat(s)
    second = np.arange(len(s.faces)) >= len(s.faces) // 2
    corners[second, :, 0] *= 1.5
    late = Monitor(timeout=1e-9)
    little = start(s, corners.copy(), bound=1.05)
    assert fallback.settle(little, late) is little
    corners[second, :, 0] *= 20
    after = fallback.settle(start(s, corners.copy(), bound=1.05), late)
    assert sound(after)
    np.testing.assert_allclose(chart_distortion(*after.open()), 1.0)
    np.testing.assert_array_equal(after.atlas.corners[~second], corners[~second])
    assert "projected" in after.repairs[0]


def test_a_face_crushed_to_nothing_gets_its_shape_back() -> None:
    """Packed at its own best scale it would shrink all others to nothing."""
    s = surface_of(*shapes.row_of(shapes.grid(3, 3), 2))
    corners = flat(s)
    alone = s.edges // 3 == 3
    corners[3] = [[0, 0], [1e-17, 0], [0.3, 1e-19]]
    cascade = start(s, corners, alone.any(1))
    assert not fallback.faults(*cascade.open()).any()
    cascade = fallback.settle(cascade, Monitor())
    np.testing.assert_allclose(chart_distortion(*cascade.open()), 1.0)
    assert s.charts(cascade.atlas.cut)[0] == s.charts(alone.any(1))[0]


def test_without_leave_to_split_the_faulty_chart_is_named() -> None:
    cascade = start(*spiral_strip(), may_split=False)
    settled = fallback.settle(cascade, Monitor())
    assert (fallback.faults(*settled.open()) > 0).tolist() == [True]
    assert not cascade.atlas.cut.any()


@settings(max_examples=30)
@given(strategies.hostile(), st.integers(0, 10**6), st.sampled_from([None, 1e-9]))
def test_any_mesh_with_any_layout_ends_sound(shape, seed, time):
    """Random corners are as bad as a layout gets; closed charts, handles, soups and no time included."""
    try:
        s = surface_of(*shape)
    except InputError:
        assume(False)  # nothing but degenerate faces
    rng = np.random.default_rng(seed)
    cut = rng.random(len(s.edges)) < rng.choice([0.0, 0.3])
    cut_mesh = s.cut_mesh(cut)
    uv = rng.normal(size=(cut_mesh.n_vertices, 2))
    cascade = start(s, uv[cut_mesh.faces], cut)
    cascade = fallback.settle(cascade, Monitor(timeout=time))
    assert sound(cascade)


def test_faces_are_laid_down_as_they_are_and_polygons_stay_whole() -> None:
    """The last resort: no seam runs inside a quad, and the faces that were not named stay."""
    p, f = shapes.grid(7, 7)
    s = surface_of(p + [0, 0, 0.01] * np.sin(9 * p[:, :1]), f, np.arange(len(f)) // 2)
    some = s.source // 2 < 5
    after = take_to_pieces(start(s, np.zeros((len(f), 3, 2))), some)
    assert not (after.atlas.cut & s.locked).any()
    np.testing.assert_array_equal(after.atlas.cut, some[s.edges // 3].any(1) & ~s.locked)
    assert not after.atlas.corners[~some].any()
    side = np.linalg.norm(after.atlas.corners[some, 1] - after.atlas.corners[some, 0], axis=1)
    np.testing.assert_allclose(side, s.rest_triangles[some, 1, 0], rtol=0.01)


def test_polygons_that_no_number_holds_become_regular_ones_and_stop_growing() -> None:
    """A quad as thin as a line: its two triangles have one uv a corner, so they cannot stand in alone."""
    p = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1e-5, 0], [0, 1e-5, 0]])
    surface = repair(Mesh(p, np.array([[0, 1, 2], [0, 2, 3]]), polygons=np.zeros(2, int)))[0]
    cascade = start(surface, np.full((len(surface.faces), 3, 2), np.nan))
    seen = []
    for _ in range(40):
        after = fallback.advance(cascade, np.array([fallback.FLIPPED]), Monitor())
        if after is None:
            break
        cascade = after
        seen.append((np.ptp(cascade.open()[1], axis=0).max(), int(cascade.singles[0])))
    assert len(seen) < 40, "it ends"
    assert cascade.singles.max() == MOST_SINGLES
    assert "got a regular polygon instead" in cascade.repairs[-1]
    cut_mesh, uv = cascade.open()
    assert cascade.kept_sizes(cut_mesh).all()
    assert fallback.faults(cut_mesh, uv).tolist() == [fallback.SOUND]
    side = np.linalg.norm(uv[cut_mesh.faces[:, 1]] - uv[cut_mesh.faces[:, 0]], axis=1)
    assert side.min() > 1e-3 * np.ptp(uv, axis=0).max(), "no side is thin any more"
    sizes = [size for size, singles in seen if singles >= 2]
    assert (np.diff(np.log(sizes)) > np.log(2)).all()


def test_only_the_faces_that_were_named_change() -> None:
    surface = surface_of(*shapes.icosphere(2))
    some = np.arange(len(surface.faces)) < 40
    after = project_charts(start(surface, np.full((len(surface.faces), 3, 2), np.nan)), some)
    assert np.isfinite(after.atlas.corners[some]).all()
    assert np.isnan(after.atlas.corners[~some]).all()
    touched = some[surface.edges // 3].any(1)
    assert not after.atlas.cut[~touched].any()
