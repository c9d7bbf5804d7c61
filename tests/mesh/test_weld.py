"""Coincident vertices, degenerate and duplicate faces, as maps."""

from itertools import permutations

import numpy as np
import pytest

from circparam.errors import InputError, OptionError
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.weld import degenerate_faces, first_duplicates, mesh_scale, weld_map
from tests.support import shapes
from tests.support.surfaces import check_complete, check_surface


def test_coincident_vertices_are_one_by_a_map():
    p, f = shapes.icosphere(2)
    soup = Mesh(p[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3))
    surface, repairs = repair(soup)
    assert repairs.clean
    assert len(surface.boundary) == 0
    assert surface.cut_mesh(np.zeros(len(surface.edges), bool)).euler().tolist() == [2]
    assert surface.points is soup.points


def test_tolerance_closes_a_crack_and_refuses_to_swallow_the_mesh():
    p, f = shapes.icosphere(2)
    p = p[f].reshape(-1, 3) + 1e-6 * np.random.default_rng(0).random((f.size, 3))
    mesh = Mesh(p, np.arange(f.size).reshape(-1, 3))
    surface, _ = repair(mesh)
    assert len(surface.edges) == 0
    surface, repairs = repair(mesh, RepairOptions(weld_eps=1e-5))
    assert len(surface.boundary) == 0
    assert repairs.near_vertices > 0
    assert "tolerance" in repairs.messages[0]
    check_complete(mesh, surface, repairs)
    with pytest.raises(OptionError, match="whole neighbourhoods"):
        repair(Mesh(*shapes.icosphere(4)), RepairOptions(weld_eps=5.0))


@pytest.mark.parametrize("scale", [1e-300, 1e-30, 1e-12, 1.0, 1e12, 1e30, 1e150, 1e300])
def test_what_counts_as_degenerate_does_not_depend_on_the_scale(scale):
    p, f = shapes.bumped_disk(200)
    needle = np.array(
        [[0, 0, 3], [1, 0, 3], [0.5, 1e-13, 3], [0, 0, 4], [1, 0, 4], [0.5, 1e-11, 4]]
    )
    n = len(p)
    f = np.concatenate([f, [[n, n + 1, n + 2], [n + 3, n + 4, n + 5]]])
    mesh = Mesh(np.concatenate([p, needle]) * scale, f)
    surface, repairs = repair(mesh)
    assert repairs.degenerate.tolist() == [len(f) - 2]
    assert np.array_equal(surface.points, mesh.points * repairs.scale)
    assert np.log2(repairs.scale) % 1 == 0
    if 1e-12 <= scale <= 1e12:
        assert repairs.scale == 1
    check_surface(mesh, surface, repairs)


@pytest.mark.parametrize("corners", list(permutations(range(3))))
def test_a_needle_is_degenerate_from_whichever_corner(corners):
    """An area up to 1e-12 of the square of its longest edge, which is one long."""
    for height, none in ((1.9e-12, True), (2.1e-12, False)):
        needle = np.array([[0, 0, 3], [1, 0, 3], [0.5, height, 3]])
        assert degenerate_faces(needle, np.array([corners])).tolist() == [none]


def test_a_face_far_smaller_than_others_is_degenerate():
    for size, none in ((1e-49, False), (1e-51, True)):
        points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [size, 0, 0], [0, size, 0]])
        faces = np.array([[0, 1, 2], [0, 3, 4]])
        assert degenerate_faces(points, faces).tolist() == [False, none]


def test_all_faces_degenerate_is_an_input_error():
    with pytest.raises(InputError, match="degenerate"):
        repair(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])))
    line = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]])
    with pytest.raises(InputError, match="degenerate"):
        repair(Mesh(line, np.array([[0, 1, 2], [0, 0, 1]])))


def test_vertices_in_steps_below_the_tolerance_are_one() -> None:
    """A row of points 1 apart: joined through each other from 1 on, to the lowest; unused ones stay out."""
    p = np.array([[0.0, 0, 0], [2, 0, 0], [1, 0, 0], [0, 9, 0], [0.0, 0, 0], [0, 9.5, 0]])
    mesh = Mesh(p, np.array([[0, 1, 3], [2, 4, 3]]))
    assert weld_map(mesh).tolist() == [0, 1, 2, 3, 0, 5]
    assert weld_map(mesh, 0.99).tolist() == [0, 1, 2, 3, 0, 5]
    assert weld_map(mesh, 1.0).tolist() == [0, 0, 0, 3, 0, 5]
    for eps in (-1e-9, np.nan, np.inf):
        with pytest.raises(OptionError, match="at least 0"):
            weld_map(mesh, eps)


def test_faces_with_the_same_points_are_one_however_they_are_wound() -> None:
    faces = np.array([[0, 1, 2], [3, 1, 2], [2, 1, 0], [1, 2, 3], [1, 2, 0], [0, 1, 3]])
    for n in (4, 2**21):
        assert first_duplicates(faces, n).tolist() == [0, 1, 0, 1, 0, 5]


@pytest.mark.parametrize(
    ("size", "scale"), [(1.0, 1), (2.0**49, 1), (2.0**60, 2.0**-60), (2.0**-60, 2.0**60)]
)
def test_meshes_of_extreme_size_are_scaled_to_about_one(size: float, scale: float) -> None:
    p, f = shapes.triangle()
    p = p / np.ptp(p, axis=0).max()
    stray = np.array([[1e300, 0, 0]])
    assert mesh_scale(Mesh(np.r_[p * size, stray], f)) == scale
    assert mesh_scale(Mesh(np.ones((3, 3)), f)) == 1.0
