"""The chain that always ends: whatever a method returns, the atlas that comes out is sound."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circparam.core.arrays import cross2
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OptionError
from circparam.geometry.distortion import chart_distortion
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.pipeline import cascade, fallback
from circparam.pipeline.cascade import Cascade
from tests.support import shapes, strategies


def surface_of(p: np.ndarray, f: np.ndarray, polygons: np.ndarray | None = None) -> Surface:
    return repair(Mesh(p, f, polygons), RepairOptions())[0]


def atlas_of(surface: Surface, corners: np.ndarray, cut: np.ndarray | None = None) -> Cascade:
    cut = np.zeros(len(surface.edges), bool) if cut is None else cut
    return Cascade(surface, cut, corners, np.zeros(len(surface.faces), np.int64))


def sound(atlas: Cascade) -> bool:
    fault, flipped = fallback.faults(*atlas.open())
    return not fault.any() and not flipped.any()


def flat(surface: Surface) -> np.ndarray:
    return surface.points[surface.faces][:, :, :2].copy()


def test_a_sound_layout_stays_as_it_is() -> None:
    s = surface_of(*shapes.grid())
    atlas = atlas_of(s, flat(s))
    assert not fallback.settle(atlas, True, MethodOptions(), Monitor()).any()
    np.testing.assert_array_equal(atlas.corners, flat(s))
    assert atlas.repairs == []


def test_a_flipped_chart_is_mapped_again_and_others_are_left_alone() -> None:
    p, f = shapes.row_of(shapes.grid(5, 5), 3)
    s = surface_of(p, f)
    corners = flat(s)
    middle = np.repeat(np.arange(3), 32) == 1
    corners[middle] *= [-1, 1]
    atlas = atlas_of(s, corners.copy())
    fallback.settle(atlas, True, MethodOptions(), Monitor())
    assert sound(atlas)
    np.testing.assert_array_equal(atlas.corners[~middle], corners[~middle])
    assert len(atlas.repairs) == 1
    assert "flipped" in atlas.repairs[0]


def test_not_a_number_is_a_fault_like_a_flip() -> None:
    s = surface_of(*shapes.grid(4, 4))
    corners = flat(s)
    bad = (s.faces == 5).any(1)
    corners[s.faces == 5] = np.nan
    fault, flipped = fallback.faults(*atlas_of(s, corners).open())
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
    atlas = atlas_of(s, corners)
    assert fallback.faults(*atlas.open())[0].tolist() == [fallback.OVERLAPPING]
    fallback.settle(atlas, True, MethodOptions(), Monitor())
    assert sound(atlas)
    assert s.charts(atlas.cut)[0] == 2
    assert "overlapped" in atlas.repairs[0]


def test_a_chart_beyond_its_bound_is_split_until_its_parts_are_below() -> None:
    s = surface_of(*shapes.bumped_disk(400, height=1.5))
    top = METHODS["mean-value"].function(s.cut_mesh(s.edges[:, 0] < 0), MethodOptions(), Monitor())
    start = top.uv[s.cut_mesh(s.edges[:, 0] < 0).faces]
    for bound in (cascade.FAULTY, 1.1):
        atlas = atlas_of(s, start.copy())
        atlas.bound = bound
        fallback.settle(atlas, True, MethodOptions(), Monitor())
        assert sound(atlas)
        assert (chart_distortion(*atlas.open()) <= bound).all()
        assert (s.charts(atlas.cut)[0] == 1) == (bound == cascade.FAULTY)
    assert "distorted" in atlas.repairs[0]
    atlas = atlas_of(s, start.copy())
    atlas.bound = 1.1
    assert not fallback.settle(atlas, False, MethodOptions(), Monitor()).any(), "no leave to split"
    assert not fallback.settle(atlas, True, MethodOptions(), Monitor(timeout=1e-9)).any(), "no time"
    np.testing.assert_array_equal(atlas.corners, start)


def test_a_face_crushed_to_nothing_gets_its_shape_back() -> None:
    """Packed at its own best scale it would shrink all others to nothing."""
    s = surface_of(*shapes.row_of(shapes.grid(3, 3), 2))
    corners = flat(s)
    alone = s.edges // 3 == 3
    corners[3] = [[0, 0], [1e-17, 0], [0.3, 1e-19]]
    atlas = atlas_of(s, corners, alone.any(1))
    assert not fallback.faults(*atlas.open())[0].any()
    fallback.settle(atlas, True, MethodOptions(), Monitor())
    np.testing.assert_allclose(chart_distortion(*atlas.open()), 1.0)
    assert s.charts(atlas.cut)[0] == s.charts(alone.any(1))[0]


def test_without_leave_to_split_the_faulty_chart_is_named() -> None:
    p, f, uv = spiral_strip(1.5)
    s = surface_of(p, f)
    corners = uv[s.faces]
    if cross2(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0]) < 0:
        corners[..., 0] *= -1
    atlas = atlas_of(s, corners)
    assert fallback.settle(atlas, False, MethodOptions(), Monitor()).tolist() == [True]
    assert not atlas.cut.any()


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
    atlas = atlas_of(s, uv[cut_mesh.faces], cut)
    assert not fallback.settle(atlas, True, MethodOptions(), Monitor()).any()
    assert sound(atlas)


def test_a_method_that_fails_is_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """With every method broken, faces are laid down one by one."""

    def broken(*args: object) -> None:
        raise NoResultError("planted")

    class Rows:
        def __contains__(self, name: str) -> bool:
            return True

        def __getitem__(self, name: str) -> object:
            return type("Row", (), {"function": staticmethod(broken)})

    monkeypatch.setattr(fallback, "METHODS", Rows())
    s = surface_of(*shapes.icosphere(1))
    atlas = atlas_of(s, np.zeros((len(s.faces), 3, 2)))
    fallback.settle(atlas, True, MethodOptions(), Monitor())
    assert sound(atlas)
    cut_mesh, uv = atlas.open()
    assert cut_mesh.n_charts == len(s.faces)
    # laid down as they are: every face isometric
    side = np.linalg.norm(uv[cut_mesh.faces][:, 1] - uv[cut_mesh.faces][:, 0], axis=1)
    np.testing.assert_allclose(side, cut_mesh.edge_lengths[:, 0], rtol=1e-12)


def test_a_polygon_stays_in_one_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """Quads are halved and taken to pieces as quads: no seam runs inside one."""

    def useless(cut_mesh: object, *rest: object) -> None:
        raise NoResultError("planted")

    p, f = shapes.grid(7, 7)
    p = p + [0, 0, 1] * np.sin(9 * p[:, :1]) * 0.2
    s = surface_of(p, f, np.arange(len(f)) // 2)
    assert s.locked.sum() == len(f) // 2
    row = type("Row", (), {"function": staticmethod(useless)})
    table = {"isometric": row, "mean-value": row}
    monkeypatch.setattr(fallback, "METHODS", table)
    atlas = atlas_of(s, np.zeros((len(f), 3, 2)))
    fallback.settle(atlas, True, MethodOptions(), Monitor())
    assert sound(atlas)
    assert not (atlas.cut & s.locked).any()
    assert s.charts(atlas.cut)[0] == len(f) // 2


@settings(max_examples=25)
@given(strategies.surfaces())
def test_splitting_halves_every_chart_named(shape: tuple[np.ndarray, np.ndarray]) -> None:
    s = surface_of(*shape)
    cut = np.zeros(len(s.edges), bool)
    n, chart = s.charts(cut)
    wanted = np.arange(n) % 2 == 0 if n > 1 else np.ones(n, bool)
    new = fallback.split_charts(s, cut, wanted)
    after, pieces = s.charts(cut | new)
    for c in range(n):
        count = len(np.unique(pieces[chart == c]))
        assert (count >= 2) if wanted[c] and (chart == c).sum() > 1 else count == 1
    assert after >= n


PINS = {
    "twice": ([[0, 0, 0], [0, 1, 1]], "twice"),
    "outside": ([[0, 0, 0], [999, 1, 1]], "999"),
    "negative": ([[-1, 0, 0], [2, 1, 1]], "-1"),
}


@pytest.mark.parametrize("name", PINS)
def test_bad_pins_are_named(name: str) -> None:
    pins, word = PINS[name]
    s = surface_of(*shapes.grid(4, 4))
    with pytest.raises(OptionError, match=word):
        fallback.flatten(
            s,
            np.zeros(len(s.edges), bool),
            None,
            "mean-value",
            MethodOptions(),
            np.array(pins, float),
            Monitor(),
        )


def test_a_pin_on_a_seam_is_refused() -> None:
    s = surface_of(*shapes.grid(5, 5))
    flat_ends = s.faces.ravel()[s.edges[:, 0]]
    cut = np.isin(flat_ends, [12])
    cut |= np.isin(s.faces[s.edges[:, 0] // 3, (s.edges[:, 0] % 3 + 1) % 3], [12])
    with pytest.raises(OptionError, match="12, which lies on a seam"):
        fallback.flatten(
            s, cut, None, "mean-value", MethodOptions(), np.array([[12.0, 0, 0]]), Monitor()
        )


def test_polygons_that_no_number_holds_become_regular_ones_and_stop_growing() -> None:
    """A quad as thin as a line: its two triangles have one uv a corner, so they cannot stand in alone."""
    p = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1e-5, 0], [0, 1e-5, 0]])
    surface = repair(Mesh(p, np.array([[0, 1, 2], [0, 2, 3]]), polygons=np.zeros(2, int)))[0]
    m = len(surface.faces)
    nothing = np.full((m, 3, 2), np.nan)
    atlas = Cascade(surface, np.zeros(len(surface.edges), bool), nothing, np.zeros(m, int))
    seen = []
    for _ in range(40):
        if not fallback.advance(
            atlas, np.array([fallback.FLIPPED]), True, MethodOptions(), Monitor()
        ):
            break
        cut_mesh, uv = atlas.open()
        seen.append((np.ptp(uv, axis=0).max(), int(atlas.laid[0])))
    assert len(seen) < 40, "it ends"
    assert atlas.laid.max() == fallback.LARGEST
    cut_mesh, uv = atlas.open()
    assert fallback.faults(cut_mesh, uv)[0].tolist() == [fallback.SOUND]
    side = np.linalg.norm(uv[cut_mesh.faces[:, 1]] - uv[cut_mesh.faces[:, 0]], axis=1)
    assert side.min() > 1e-3 * np.ptp(uv, axis=0).max(), "no side is thin any more"
    sizes = [size for size, laid in seen if laid >= 2]
    assert (np.diff(np.log(sizes)) > np.log(2)).all()
