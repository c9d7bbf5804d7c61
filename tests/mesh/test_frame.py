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
    turned: np.ndarray = rng.uniform(0.1, 10) * points @ shapes.rotation(seed).T
    return turned + rng.normal(size=3)


@settings(max_examples=30, deadline=None)
@given(name=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 10**6))
def test_the_shape_in_its_frame_does_not_depend_on_its_pose(name: str, seed: int) -> None:
    """Of a symmetric shape each point may take the place of its image."""
    points, faces = SHAPES[name]
    other = _moved(points, seed)
    one, two = frame_of(points, faces).inside(points), frame_of(other, faces).inside(other)
    assert cKDTree(two).query(one)[0].max() < 1e-7
    assert cKDTree(one).query(two)[0].max() < 1e-7


@pytest.mark.parametrize(("name", "effort"), [("torus", 0), ("bumpy", 1)])
def test_a_turned_mesh_gets_the_same_seams(name: str, effort: float) -> None:
    points, faces = shapes.noisy(*SHAPES[name], amount=0.03)
    both = points, _moved(points, 5)
    found = [unwrap((p, faces), normalize=False, effort=effort) for p in both]
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
