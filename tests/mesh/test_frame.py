"""The frame of a surface: it turns, moves and grows with the shape, so coordinates in it stay as they are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from circparam import unwrap
from circparam.mesh.frame import frame_of
from tests.support import shapes

# those with equal moments, with mirror images, flat ones, and one with neither
SHAPES = {
    "bumpy": shapes.noisy(*shapes.icosphere(2), amount=0.1),
    "cube": shapes.cube(2),
    "torus": shapes.torus(),
    "tube": shapes.tube(),
    "tetrahedron": shapes.icosphere(0),
    "disk": shapes.bumped_disk(80),
    "square": shapes.grid(5, 5),
    "strip": shapes.grid(9, 3, width=100.0, height=1e-3),
    "triangle": shapes.triangle(),
}


def _moved(points: np.ndarray, seed: int) -> np.ndarray:
    """Turned, moved and grown at random."""
    rng = np.random.default_rng(seed)
    result: np.ndarray = rng.uniform(0.1, 10) * points @ shapes.rotation(seed).T + rng.normal(
        size=3
    )
    return result


@settings(max_examples=30, deadline=None)
@given(name=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 10**6))
def test_the_shape_in_its_frame_does_not_depend_on_its_pose(name: str, seed: int) -> None:
    """Of a symmetric shape each point may take the place of its image."""
    points, faces = SHAPES[name]
    other = _moved(points, seed)
    one, two = frame_of(points, faces).inside(points), frame_of(other, faces).inside(other)
    assert cKDTree(two).query(one)[0].max() < 1e-7
    assert cKDTree(one).query(two)[0].max() < 1e-7


@pytest.mark.parametrize("name", SHAPES)
def test_a_frame_is_a_rigid_motion_to_unit_area(name: str) -> None:
    """Right-handed axes, the centroid in the origin, principal axes by falling moments."""
    points, faces = SHAPES[name]
    frame = frame_of(points, faces)
    np.testing.assert_allclose(frame.axes.T @ frame.axes, np.eye(3), atol=1e-9)
    assert np.linalg.det(frame.axes) == pytest.approx(1)
    corner = frame.inside(points)[faces]
    area = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    ) / 2  # fmt: skip
    assert area.sum() == pytest.approx(1)
    np.testing.assert_allclose(area @ corner.mean(1), 0, atol=1e-9)
    # the second moment of a triangle is the mean of its midpoints' moments
    middle = (corner + corner[:, [1, 2, 0]]) / 2
    second = np.einsum("m,mki,mkj->ij", area, middle, middle) / 3
    np.testing.assert_allclose(second, np.diag(np.diag(second)), atol=1e-5 * np.trace(second))
    assert (np.diff(np.diag(second)) <= 1e-5 * np.trace(second)).all()


@pytest.mark.parametrize(("name", "effort"), [("torus", 0), ("bumpy", 1)])
def test_a_turned_mesh_gets_the_same_seams(name: str, effort: float) -> None:
    points, faces = shapes.noisy(*SHAPES[name], amount=0.03)
    found = [unwrap((p, faces), resolution=128, effort=effort) for p in (points, _moved(points, 5))]
    one, other = (r.measures for r in found)
    assert one["charts"] == other["charts"]
    assert one["seam_length"] == pytest.approx(other["seam_length"], rel=1e-6)
    np.testing.assert_array_equal(found[0].charts, found[1].charts)


def test_a_part_that_only_the_origin_of_the_file_holds_ends_no_run() -> None:
    """In another frame its points would be one."""
    ball = shapes.icosphere(1)
    points, faces = shapes.join((ball[0] * 1e-20, ball[1]), (ball[0] + 3.0, ball[1]))
    result = unwrap((points, faces), effort="draft", normalize=False)
    assert result.measures["flips"] == 0
    assert result.measures["distortion"] < 1.06
