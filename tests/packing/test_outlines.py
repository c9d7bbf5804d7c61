"""Charts as packers see them: outlines, boxes, angles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import OptionError
from circparam.packing.outlines import least_box_angles, shapes_of
from tests.support.packing import blobs, boxes, vertices_of


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_faces_wound_otherwise_or_without_area_change_no_outline(seed):
    """Files hold both: edges between faces side by side belong to no outline, however they are wound."""
    rng = np.random.default_rng(seed)
    faces, uv, chart = blobs(5, seed)
    as_drawn = shapes_of(faces, uv, chart)
    turned = rng.random(len(faces)) < 0.4
    other = np.where(turned[:, None], faces[:, ::-1], faces)
    flat = rng.integers(0, len(faces), 9)
    other, own = np.r_[other, faces[flat][:, [0, 1, 1]]], np.r_[chart, chart[flat]]
    shapes = shapes_of(other, uv, own)
    for c in range(5):
        edges = [np.concatenate(s.outline(c), axis=1) for s in (as_drawn, shapes)]
        before, after = (e[np.lexsort(e.T)] for e in edges)
        np.testing.assert_array_equal(before, after)


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_boxes_hold_what_is_placed(seed):
    rng = np.random.default_rng(seed)
    faces, uv, chart = blobs(5, seed)
    shapes = shapes_of(faces, np.r_[uv, [[7.0, 7.0]]], chart)  # a vertex that no face uses
    angle = rng.choice(np.r_[rng.uniform(-7, 7, 5), np.arange(-4, 5) * np.pi / 2], 5)
    offset, scale = rng.normal(size=(5, 2)), rng.uniform(0.1, 3)
    placed = shapes.place(angle, offset, scale)
    assert (placed[-1] == 0).all()
    box = shapes.boxes(angle) * scale + np.tile(offset, 2)
    for c, v in enumerate(vertices_of(faces, chart)):
        np.testing.assert_allclose(box[c, :2], placed[v].min(0), atol=1e-9)
        np.testing.assert_allclose(box[c, 2:], placed[v].max(0), atol=1e-9)
        turned = (shapes.points[v] @ [1, 1j]) * scale * np.exp(1j * angle[c]) + offset[c] @ [1, 1j]
        np.testing.assert_allclose(placed[v] @ [1, 1j], turned, atol=1e-9)


@settings(max_examples=30)
@given(angle=st.floats(-3, 3), width=st.floats(1.1, 9))
def test_the_least_box_of_a_rectangle_is_the_rectangle(angle, width):
    shapes = shapes_of(*boxes([[width, 1]], angle))
    box = shapes.boxes(least_box_angles(shapes, "free"))[0]
    assert box[2:] - box[:2] == pytest.approx([width, 1], rel=1e-3, abs=2e-3 * width)
    np.testing.assert_array_equal(least_box_angles(shapes, "none"), [0.0])
    upright = shapes.boxes(least_box_angles(shapes, "90"))[0]
    plain = shapes.boxes(np.zeros(1))[0]
    assert sorted(upright[2:] - upright[:2]) == pytest.approx(sorted(plain[2:] - plain[:2]))
    assert upright[2] - upright[0] >= upright[3] - upright[1] - 1e-6 * width


@pytest.mark.parametrize(
    ("faces", "uv", "chart", "message"),
    [
        (np.zeros((0, 3), int), np.zeros((3, 2)), np.zeros(0, int), "m > 0"),
        (np.zeros((1, 4), int), np.zeros((3, 2)), np.zeros(1, int), "faces have shape"),
        ([[0, 1, 2]], np.zeros((3, 3)), [0], "uv have shape"),
        ([[0, 1, 2]], np.eye(3)[:, :2], [0, 0], "one label a face"),
        ([[0, 1, 3]], np.eye(3)[:, :2], [0], r"outside 0\.\.2"),
        ([[0, 1, -1]], np.eye(3)[:, :2], [0], r"outside 0\.\.2"),
        ([[0, 1, 2]], np.full((3, 2), np.nan), [0], "NaN"),
        ([[0, 1, 2]], np.eye(3)[:, :2], [1], "leave gaps"),
        ([[0, 1, 2]], np.eye(3)[:, :2], [-1], "leave gaps"),
        ([[0, 1, 2], [1, 3, 2]], np.eye(4)[:, :2], [0, 1], "shares a uv vertex"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(faces, uv, chart, message):
    with pytest.raises(OptionError, match=message):
        shapes_of(faces, uv, chart)
