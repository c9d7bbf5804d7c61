"""The chain that always ends: whatever a method returns, the cascade that comes out is sound."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.core.arrays import cross2
from circparam.core.monitor import Monitor
from circparam.geometry.distortion import chart_distortion
from circparam.mesh.atlas import Atlas
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.pipeline import fallback
from circparam.pipeline.cascade import FAULTY, Cascade
from tests.support import shapes, strategies
from tests.support.cascades import flat, sound, start, surface_of


def faulty(cascade: Cascade) -> list[bool]:
    return (fallback.faults(*cascade.open())[0] > 0).tolist()


def test_a_sound_layout_stays_as_it_is() -> None:
    s = surface_of(*shapes.grid())
    cascade = start(s, flat(s))
    cascade = fallback.settle(cascade, Monitor())
    np.testing.assert_array_equal(cascade.atlas.corners, flat(s))
    assert cascade.repairs == ()


def test_a_flipped_chart_is_mapped_again_and_others_are_left_alone() -> None:
    p, f = shapes.row_of(shapes.grid(5, 5), 3)
    s = surface_of(p, f)
    corners = flat(s)
    middle = np.repeat(np.arange(3), 32) == 1
    corners[middle] *= [-1, 1]
    cascade = start(s, corners.copy())
    cascade = fallback.settle(cascade, Monitor())
    assert sound(cascade)
    np.testing.assert_array_equal(cascade.atlas.corners[~middle], corners[~middle])
    assert len(cascade.repairs) == 1
    assert "flipped" in cascade.repairs[0]


def test_not_a_number_is_a_fault_like_a_flip() -> None:
    s = surface_of(*shapes.grid(4, 4))
    corners = flat(s)
    bad = (s.faces == 5).any(1)
    corners[s.faces == 5] = np.nan
    fault, flipped = fallback.faults(*start(s, corners).open())
    assert fault.tolist() == [fallback.FLIPPED]
    np.testing.assert_array_equal(flipped, bad)


def spiral_strip(turns: float, n: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A flat strip in space, and a layout of it that winds over itself without a flip."""
    p, f = shapes.grid(n, 2, 10.0, 0.5)
    angle = 2 * np.pi * turns * p[:, 0] / 10
    r = 1 + p[:, 1]
    return p, f, np.stack([r * np.sin(angle), -r * np.cos(angle)], 1) * [1, 1]


def test_a_chart_that_overlaps_itself_is_split() -> None:
    p, f, uv = spiral_strip(1.5)
    s = surface_of(p, f)
    corners = uv[s.faces]
    if cross2(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0]) < 0:
        corners[..., 0] *= -1
    cascade = start(s, corners)
    assert fallback.faults(*cascade.open())[0].tolist() == [fallback.OVERLAPPING]
    cascade = fallback.settle(cascade, Monitor())
    assert sound(cascade)
    assert s.charts(cascade.atlas.cut)[0] == 2
    assert "overlapped" in cascade.repairs[0]


def test_a_chart_beyond_its_bound_is_split_until_its_parts_are_below() -> None:
    s = surface_of(*shapes.bumped_disk(400, height=1.0))
    whole = s.cut_mesh(np.zeros(len(s.edges), bool))
    top = METHODS["mean-value"].function(whole, MethodOptions(), Monitor())
    corners = top.uv[whole.faces]
    for bound in (FAULTY, 1.1):
        cascade = fallback.settle(start(s, corners, bound=bound), Monitor())
        assert sound(cascade)
        assert (chart_distortion(*cascade.open()) <= bound).all()
        assert (s.charts(cascade.atlas.cut)[0] == 1) == (bound == FAULTY)
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
    assert not fallback.faults(*cascade.open())[0].any()
    cascade = fallback.settle(cascade, Monitor())
    np.testing.assert_allclose(chart_distortion(*cascade.open()), 1.0)
    assert s.charts(cascade.atlas.cut)[0] == s.charts(alone.any(1))[0]


def test_without_leave_to_split_the_faulty_chart_is_named() -> None:
    p, f, uv = spiral_strip(1.5)
    s = surface_of(p, f)
    corners = uv[s.faces]
    if cross2(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0]) < 0:
        corners[..., 0] *= -1
    cascade = start(s, corners, may_split=False)
    assert faulty(fallback.settle(cascade, Monitor())) == [True]
    assert not cascade.atlas.cut.any()


@settings(max_examples=30)
@given(strategies.hostile(), st.integers(0, 10**6))
def test_any_mesh_with_any_layout_ends_sound(
    shape: tuple[np.ndarray, np.ndarray], seed: int
) -> None:
    """Random corners are as bad as a layout gets; closed charts, handles and soups included."""
    from circparam.errors import InputError

    try:
        s = surface_of(*shape)
    except InputError:
        assume(False)  # nothing but degenerate faces
    rng = np.random.default_rng(seed)
    cut = rng.random(len(s.edges)) < rng.choice([0.0, 0.3])
    cut_mesh = s.cut_mesh(cut)
    uv = rng.normal(size=(cut_mesh.n_vertices, 2))
    cascade = start(s, uv[cut_mesh.faces], cut)
    cascade = fallback.settle(cascade, Monitor())
    assert sound(cascade)


@settings(max_examples=25)
@given(strategies.surfaces())
def test_splitting_halves_every_chart_named(shape: tuple[np.ndarray, np.ndarray]) -> None:
    s = surface_of(*shape)
    cut = np.zeros(len(s.edges), bool)
    n, chart = s.charts(cut)
    wanted = np.arange(n) % 2 == 0 if n > 1 else np.ones(n, bool)
    new = fallback.halve_charts(Atlas(s, cut), wanted)
    after, pieces = s.charts(cut | new)
    for c in range(n):
        count = len(np.unique(pieces[chart == c]))
        assert (count >= 2) if wanted[c] and (chart == c).sum() > 1 else count == 1
    assert after >= n
