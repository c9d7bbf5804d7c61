"""From how many directions edges are seen: known answers, and what no motion of the mesh may change."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.visibility import edge_shares, visible_share
from circparam.mesh.surface import Surface
from tests.support import shapes
from tests.support.atlases import ends, surface_of

Shape = tuple[np.ndarray, np.ndarray]


def channel(depth: float = 2.0, refine: int = 2) -> Shape:
    """A part with the profile of a U: a channel one wide and so deep between two walls one thick."""
    mask = np.ones((3, 6, int(depth) + 1), bool)
    mask[1, :, 1:] = False
    return shapes.voxels(mask, refine)


def shares(shape: Shape, count: int = 64, pixels: int = 256) -> tuple[Surface, np.ndarray]:
    surface = surface_of(*shape)
    return surface, edge_shares(surface, count, pixels)


def test_every_edge_of_a_sphere_is_seen_from_half_of_the_directions() -> None:
    _, found = shares(shapes.icosphere(4))
    assert found == pytest.approx(0.5, abs=0.08)
    assert found.mean() == pytest.approx(0.5, abs=0.015)


def test_a_shell_inside_a_closed_one_is_never_seen_and_counts_by_its_length() -> None:
    p, f = shapes.icosphere(3)
    surface, found = shares(shapes.join((p, f), (0.6 * p, f)))
    inner = np.linalg.norm(surface.points[ends(surface)], axis=2).max(1) < 0.7
    assert inner.sum() == (~inner).sum()
    assert (found[inner] == 0).all()
    assert found[~inner] == pytest.approx(0.5, abs=0.1)
    every, none, outer = (visible_share(surface, cut) for cut in (inner | True, inner, ~inner))
    assert none == 0
    assert every == pytest.approx(outer / 1.6, rel=1e-6)
    assert visible_share(surface, inner & False) is None


@pytest.mark.parametrize("depth", [1.0, 2.0, 4.0])
def test_a_channel_is_seen_less_than_the_walls_outside_and_less_the_deeper(depth: float) -> None:
    surface, found = shares(channel(depth))
    at = surface.points[ends(surface)]
    x, y, z = np.moveaxis(at - at.min((0, 1)), 2, 0)
    step = np.ptp(x) / 3
    floor = (np.abs(z - step) < 1e-9).all(1) & (np.abs(x - 1.5 * step) < 0.51 * step).all(1)
    y = y.mean(1)
    floor &= np.abs(y - y.mean()) < np.ptp(y) / 4  # its ends are open
    outside = (x < 1e-9).all(1) | (x > 3 * step - 1e-9).all(1)
    assert floor.any()
    # the sky over the middle line of a trench of width w and depth d: sin(atan(w / 2d)) of all directions above
    sky = np.sin(np.arctan(0.5 / depth)) / 2
    assert found[floor].max() < found[outside].min()
    assert found[floor].mean() == pytest.approx(sky, abs=0.08)


def test_a_sheet_is_seen_from_both_sides_and_a_closed_surface_from_outside_however_it_is_wound():
    _, sheet = shares(shapes.grid(9, 7))
    assert sheet == pytest.approx(1, abs=0.07)
    points, faces = shapes.icosphere(3)
    assert np.allclose(shares((points, faces[:, ::-1]))[1].mean(), 0.5, atol=0.03)


@settings(max_examples=6, deadline=None)
@given(
    seed=st.integers(0, 10_000), scale=st.sampled_from([1e-3, 1.0, 250.0]), level=st.integers(1, 3)
)
def test_scaling_and_moving_change_nothing_and_turning_hardly_anything(seed, scale, level):
    p, f = shapes.noisy(*shapes.icosphere(level), amount=0.1, seed=seed)
    p = p * [1.0, 0.7, 0.4]
    _, found = shares((p, f))
    away = scale * np.array([3.0, -1.0, 0.5])
    _, moved = shares((p * scale + away, f))
    assert np.abs(found - moved).mean() < 0.01
    _, turned = shares((p @ shapes.rotation(seed).T, f))
    assert np.abs(found - turned).mean() < 0.04
    assert found.mean() == pytest.approx(turned.mean(), abs=0.02)
    assert ((found >= 0) & (found <= 1)).all()


@pytest.mark.parametrize(("refine", "pixels"), [(2, 64), (8, 128), (8, 24)])
def test_faces_that_hide_nothing_asked_for_may_be_left_out(refine: int, pixels: int) -> None:
    """Of a few edges the shares are what they are among those of all, to the last digit."""
    surface = surface_of(*channel(2, refine))
    _, whole = shares(channel(2, refine), 24, pixels)
    for step in (1, 7, 101):
        few = np.arange(len(whole)) % step == 0
        found = edge_shares(surface, 24, pixels, few)
        np.testing.assert_array_equal(found, whole[few])


@pytest.mark.parametrize("axis", range(3))
def test_long_thin_faces_hide_what_lies_under_their_ends(axis: int) -> None:
    """Faces three pixels long and a fifth wide, along each axis: few edges under them are hidden as all are."""
    (roof, strips), floor = shapes.grid(13, 201), shapes.grid(21, 21)
    points, faces = shapes.join((roof + np.array([0, 0, 0.05]), strips), floor)
    surface, whole = shares((np.roll(points, axis, 1), faces), 64, 64)
    few = (np.arange(len(whole)) % 2 == 0) & (surface.edges[:, 0] // 3 >= len(strips))
    np.testing.assert_array_equal(edge_shares(surface, 64, 64, few), whole[few])


@given(place=st.tuples(*[st.floats(-1e12, 1e12)] * 3))
@settings(max_examples=5, deadline=None)
def test_a_point_far_away_that_no_face_uses_changes_nothing(place) -> None:
    points, faces = shapes.icosphere(2)
    _, found = shares((points, faces))
    _, beside = shares((np.concatenate([points, [place]]), faces))
    np.testing.assert_array_equal(beside, found)
