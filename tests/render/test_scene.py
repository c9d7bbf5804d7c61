"""Stretch, flips, charts and seams of known scenes."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.render.scene import make_scene, row_labels
from tests.support.scenes import QUAD, SQUARE, cube


def test_stretch_of_known_maps():
    """An isometry at any scale has stretch 1; squeezing one axis by s gives (s² + s⁻² + 2) / 4, scaled best."""
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    for scale in (1.0, 0.01, 30.0):
        scene = make_scene(points, QUAD, SQUARE * scale, QUAD)
        assert np.allclose(scene.stretch, 1.0)
        assert scene.scale == pytest.approx(scale)
    compacted = make_scene(points, QUAD, SQUARE * [1.0, 0.25], QUAD)
    assert np.allclose(compacted.stretch, (2.0**2 + 2.0**-2) * 2 / 4)


def test_flips_are_against_the_chart():
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    folded = SQUARE.copy()
    folded[3] = [0.9, 0.2]  # the second face turns over, and is the smaller one
    scene = make_scene(points, QUAD, folded, QUAD)
    assert scene.flipped.tolist() == [False, True]
    mirrored = make_scene(points, QUAD, SQUARE * [-1.0, 1.0], QUAD)
    assert not mirrored.flipped.any()


def test_degenerate_and_duplicate_faces_are_no_flips():
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    faces = np.concatenate([QUAD, [[0, 2, 2]], [[2, 1, 0]]])  # a face without area, a turned twin
    assert not make_scene(points, faces, SQUARE, faces).flipped.any()
    turned = np.array(
        [[0, 1, 2], [0, 3, 2]]
    )  # the file winds one against the other: the uv do not fold
    assert not make_scene(points, turned, SQUARE, turned).flipped.any()


def test_charts_and_seams_of_the_cube():
    points, faces, uv, uv_faces = cube()
    scene = make_scene(points, faces, uv, uv_faces)
    assert scene.n_charts == 6
    assert len(scene.seams) == 24  # four sides of each chart
    assert len(scene.inner_seams) == 12  # the edges of the cube, though no index is shared
    assert not scene.outside
    assert not scene.inside_out
    assert make_scene(points, faces[:, ::-1], uv, uv_faces[:, ::-1]).inside_out


def test_repeated_vertices_are_no_seams():
    """What glTF does at sharp edges: the same position and uv under two numbers."""
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    index = np.array([0, 1, 2, 0, 2, 3])
    scene = make_scene(points[index], faces, SQUARE[index], faces)
    assert scene.n_charts == 1
    assert len(scene.inner_seams) == 0


def test_charts_are_numbered_by_area():
    points, faces, uv, uv_faces = cube()
    uv[8:12] *= 1.3
    scene = make_scene(points, faces, uv, uv_faces)
    assert (scene.chart[4:6] == 0).all()


def test_row_labels_join_equal_rows_only():
    rows = np.array([[0.0, 1], [1, 0], [-0.0, 1], [1, 1e-300]])
    a = row_labels(rows)
    assert a[0] == a[2]
    assert len(set(a.tolist())) == 3


@pytest.mark.parametrize(
    ("uv", "uv_faces", "message"),
    [
        (np.zeros((0, 2)), np.full((2, 3), -1), "no face has uv"),
        (np.full((4, 2), np.nan), QUAD, "NaN"),
        (np.array([[0.0, 0], [1, 0], [1, np.inf], [0, 1]]), QUAD, "infinite"),
        (SQUARE, QUAD[:1], "shape"),
        (SQUARE[:3], QUAD, "there are only 3"),
    ],
)
def test_scenes_that_cannot_be(uv, uv_faces, message: str):
    points = np.concatenate([SQUARE, np.zeros((4, 1))], 1)
    with pytest.raises(InputError, match=message):
        make_scene(points, QUAD, uv, uv_faces)
