"""What a mesh refuses, which vertices stand in one place, and the charts of a layout."""

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.mesh.mesh import Mesh, UVMap

POINTS = np.eye(3)
FACES = np.array([[0, 1, 2]])


@pytest.mark.parametrize(
    ("points", "faces", "says"),
    [
        (np.zeros((3, 2)), FACES, r"\(n, 3\) is needed"),
        (np.zeros(9), FACES, r"\(n, 3\) is needed"),
        (POINTS, np.array([[0, 1]]), r"\(m, 3\) is needed"),
        (POINTS, np.zeros((0, 3), int), "no faces"),
        (POINTS, np.array([[0, 1, 2], [0, 1, 3]]), "face 1 names a vertex outside 0..2"),
        (POINTS, np.array([[0, 1, -1]]), "face 0 names"),
        (np.array([[0, 0, 0], [1, np.nan, 0], [np.inf, 1, 0]]), FACES, "^2 used.*vertex 1"),
    ],
)
def test_what_does_not_fit_is_refused(points: np.ndarray, faces: np.ndarray, says: str) -> None:
    with pytest.raises(InputError, match=says):
        Mesh(points, faces)


def test_labels_are_one_a_face_and_unused_points_may_be_anything() -> None:
    mesh = Mesh([*POINTS.tolist(), [np.nan] * 3], [[0, 1, 2]], polygons=[4], groups=[7])
    assert mesh.points.dtype == np.float64
    assert mesh.faces.dtype == np.int64
    assert mesh.polygons.tolist() == [4]
    assert mesh.groups.tolist() == [7]
    for name in ("polygons", "groups"):
        with pytest.raises(InputError, match=f"{name} have shape"):
            Mesh(POINTS, FACES, **{name: [1, 2]})


def test_vertices_in_one_place_are_the_lowest_of_them() -> None:
    points = [[1, 0, 0], [0, 0.0, 1], [1, 0, 0], [0, -0.0, 1], [1, 0, 1e-300]]
    assert Mesh(points, [[0, 1, 4]]).weld.tolist() == [0, 1, 0, 1, 4]


def test_charts_hang_together_by_vertices_of_the_layout() -> None:
    uv = np.zeros((9, 2))
    faces = np.array([[0, 1, 2], [3, 4, 5], [2, 6, 7], [-1, -1, -1], [-1, 5, -1], [-1, -1, -1]])
    charts = UVMap(uv, faces).charts
    assert charts.tolist() == [0, 1, 0, 2, 1, 3], "no uv in common: charts of their own"
