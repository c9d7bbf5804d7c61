"""Spoilt faces mended among the representable uv."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.geometry.overlap import signs
from circparam.pipeline import representable_uv
from circparam.pipeline.representable_uv import (
    FAR,
    FAR_ON_BOUNDARY,
    RADII,
    following,
    mend_faces,
    window,
)
from tests.support import needles
from tests.support.exact import exact_sign
from tests.support.needles import ROUNDINGS

names = st.sampled_from(sorted(ROUNDINGS))
numbers = st.floats(-2.0, 2.0) | st.sampled_from([0.0, 0.5, 1.0, 1 - 2.0**-24, 2.0**-30])


@given(names, st.lists(st.tuples(numbers, numbers), min_size=1, max_size=20), st.floats(0, 1))
def test_the_next_storable_number_is_the_next(name: str, values: list, t: float) -> None:
    rounding = ROUNDINGS[name]
    x = rounding(np.array(values))
    for side in (1, -1):
        y = following(x, rounding, side)
        assert (side * (y - x) > 0).all()
        np.testing.assert_array_equal(rounding(y), y)
        between = rounding(x + t * (y - x))
        fine = np.abs(y - x) <= 2.0**-59  # next to zero finer numbers are left out
        assert ((between == x) | (between == y) | fine).all()


def test_a_window_is_the_number_itself_and_its_neighbours_in_order() -> None:
    x = np.array([[0.5, 0.25], [1.0, 0.3]], np.float32).astype(np.float64)
    w = window(x, ROUNDINGS["f4"], 2)
    assert w.shape == (2, 2, 5)
    np.testing.assert_array_equal(w[:, :, 2], x)
    expected = np.nextafter(np.float32(0.5), np.float32(1))
    assert w[0, 0, 3] == expected
    assert w[0, 0, 1] == np.nextafter(np.float32(0.5), np.float32(0))
    assert (np.diff(w, axis=2) > 0).all()
    # below a power of two numbers are twice as fine
    assert w[1, 0, 3] - 1 == 2 * (1 - w[1, 0, 1])


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(["f4", "glb", "steps", "decimals"]),
    st.sampled_from([needles.crowd, needles.band]),
    st.integers(2, 10),
    st.floats(-10, -7.5),
    st.integers(0, 2**20),
)
def test_random_needles_are_upright_after_a_few_units(
    name: str, make, n: int, exponent: float, seed: int
) -> None:
    rounding = ROUNDINGS[name]
    p, f = make(np.random.default_rng(seed), n, 10.0**exponent)
    boundary = needles.boundary_vertices(f, len(p))
    before = signs(rounding(p), f) <= 0
    got = mend_faces(f, p, boundary, rounding)
    np.testing.assert_array_equal(rounding(got.uv), got.uv)
    assert not got.spoilt.any()
    assert all(exact_sign(*got.uv[t]) > 0 for t in f[before])
    assert (signs(got.uv, f) > 0).all()
    away = np.abs(got.uv - rounding(p)).max(1)
    unit = 1e-7 if name == "decimals" else 2.0**-23
    assert (away <= np.where(boundary, FAR_ON_BOUNDARY, RADII[-1]) * unit).all()
    np.testing.assert_array_equal(got.moved, away > 0)
    if not before.any():
        assert not got.moved.any()


def test_doubles_are_representable_too() -> None:
    """Rows of vertices that fall together in doubles come apart by a few units of doubles."""
    p, f = needles.band(np.random.default_rng(3), 12, 1e-10)
    p = ROUNDINGS["f4"](p)
    assert (signs(p, f) <= 0).any()
    got = mend_faces(f, p, needles.boundary_vertices(f, len(p)), ROUNDINGS["f8"])
    assert (signs(got.uv, f) > 0).all()
    assert 0 < np.abs(got.uv - p).max() < FAR * 2.0**-52


def test_only_what_is_near_a_spoilt_face_moves() -> None:
    p, f = needles.crowd(np.random.default_rng(5), 6, 1e-9)
    both = np.concatenate([p, p * 0.5]), np.concatenate([f, f + len(p)])
    wide = np.unique(both[1][signs(ROUNDINGS["f4"](both[0]), both[1]) <= 0])
    got = mend_faces(both[1], both[0], np.zeros(len(both[0]), bool), ROUNDINGS["f4"])
    ring = np.zeros(len(both[0]), bool)
    ring[wide] = True
    for _ in range(5):
        ring[both[1][ring[both[1]].any(1)]] = True
    assert got.moved.any()
    assert not got.moved[~ring].any()


@pytest.mark.parametrize("inside", [False, True])
def test_vertices_on_a_boundary_move_little_and_others_as_far_as_they_must(inside: bool) -> None:
    """Gaps between charts have no room for more: of 120 vertices within 1e-9 some faces stay spoilt there."""
    p, f = needles.crowd(np.random.default_rng(3), 120, 1e-9)
    got = mend_faces(f, p, np.full(len(p), not inside), ROUNDINGS["f4"])
    start = ROUNDINGS["f4"](p)
    away = np.abs(got.uv - start) / np.spacing(start.astype(np.float32))
    assert got.moved.any()
    assert bool(away.max() > representable_uv.FAR_ON_BOUNDARY) is inside
    assert bool(got.spoilt.any()) is not inside
