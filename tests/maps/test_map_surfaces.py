"""Maps between surfaces: one to one, landmarks met exactly, known answers, and pairs that have no map."""

from __future__ import annotations

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, OptionError, TopologyError
from circparam.mesh.mesh import Mesh
from tests.support import pairs, shapes
from tests.support.maps import check_mirrored


def is_one_to_one(a: Mesh, b: Mesh, found) -> None:
    """Both surfaces are star-shaped about the origin: every image is counter-clockwise, and covers 4π once."""
    for image, faces in (
        (found.map.to_b.of(b.points, b.faces), a.faces),
        (found.map.to_a.of(a.points, a.faces), b.faces),
    ):
        angle = pairs.solid_angles(image, faces)
        assert np.isclose(angle.sum(), 4 * np.pi)
    assert found.inversions == (0, 0)


@pytest.mark.parametrize("method", ["circle", "mean-value", "floater", "uniform"])
@pytest.mark.parametrize("relax", [True, False])
def test_blobs_map_one_to_one_with_landmarks_exact(method: str, relax: bool) -> None:
    a, b = pairs.blob(3, 1), pairs.blob(3, 1, turned=5)
    marks = pairs.marks(a, b)
    found = circparam.map_surfaces(a, b, landmarks=marks, method=method, relax=relax)
    is_one_to_one(a, b, found)
    image = found.map.to_b.of(b.points, b.faces)
    np.testing.assert_array_equal(image[marks[:, 0]], b.points[marks[:, 1]])
    back = found.map.to_a.of(a.points, a.faces)
    np.testing.assert_array_equal(back[marks[:, 1]], a.points[marks[:, 0]])
    assert found.landmark_error == 0
    edge = max(pairs.longest_edge(a), pairs.longest_edge(b))
    assert pairs.there_and_back(a, b, found.map) < edge


def test_the_weights_are_those_of_places() -> None:
    a, b = pairs.blob(2, 1), pairs.blob(3, 1, turned=5)
    found = circparam.map_surfaces(a, b, landmarks=pairs.marks(a, b)).map
    for places, n, m in (
        (found.to_b, len(a.points), len(b.faces)),
        (found.to_a, len(b.points), len(a.faces)),
    ):
        assert places.face.shape == (n,)
        assert (places.face >= 0).all()
        assert (places.face < m).all()
        assert (places.weights >= 0).all()
        np.testing.assert_allclose(places.weights.sum(1), 1, atol=1e-12)
    found.check(a, b)


@pytest.mark.parametrize("landmarks", [True, False])
def test_a_surface_on_its_own_remeshing_is_where_it_was(landmarks: bool) -> None:
    a, b = pairs.blob(3, 3), pairs.blob(3, 3, turned=7)
    found = circparam.map_surfaces(a, b, landmarks=pairs.marks(a, b) if landmarks else None)
    image = found.map.to_b.of(b.points, b.faces)
    size = np.linalg.norm(np.ptp(a.points, axis=0))
    assert np.linalg.norm(image - a.points, axis=1).mean() < 0.005 * size
    assert found.a_to_b.mean < 1.02
    assert found.a_to_b.mean < found.start.mean


def test_a_mesh_on_itself_stays() -> None:
    a = pairs.blob(3, 3)
    p, f, vertex = renumbered(a)
    b = Mesh(p, f)
    k = pairs.nearest(a, 1.2 * pairs.DIRECTIONS)
    found = circparam.map_surfaces(a, b, landmarks=np.stack([k, vertex[k]], 1))
    image = found.map.to_b.of(b.points, b.faces)
    assert np.abs(image - a.points).max() < 1e-3
    assert found.a_to_b.mean < 1 + 1e-6


def renumbered(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points, faces, new number of each vertex) in another order."""
    rng = np.random.default_rng(0)
    order = rng.permutation(len(mesh.points))
    vertex = np.argsort(order)
    return mesh.points[order], vertex[mesh.faces][rng.permutation(len(mesh.faces))], vertex


def test_relaxing_lowers_the_distortion_of_unlike_surfaces() -> None:
    a, b = pairs.blob(3, 4), pairs.blob(3, 5, turned=2)
    marks = pairs.marks(a, b)
    plain = circparam.map_surfaces(a, b, landmarks=marks, relax=False)
    found = circparam.map_surfaces(a, b, landmarks=marks)
    is_one_to_one(a, b, found)
    assert np.isclose(found.start.mean, plain.a_to_b.mean)
    assert found.a_to_b.mean < plain.a_to_b.mean


@pytest.mark.parametrize("k", [3, 4, 5])
def test_few_landmarks(k: int) -> None:
    a, b = pairs.blob(2, 1), pairs.blob(2, 1, turned=5)
    marks = pairs.marks(a, b, 8)[[4, 6, 7, 5, 3][:k]]
    found = circparam.map_surfaces(a, b, landmarks=marks)
    is_one_to_one(a, b, found)
    image = found.map.to_b.of(b.points, b.faces)
    np.testing.assert_array_equal(image[marks[:, 0]], b.points[marks[:, 1]])


@pytest.mark.parametrize("seed", range(1, 12))
def test_random_landmarks_are_met(seed: int) -> None:
    """Wherever the landmarks of two spheres are, however far the paths must wind: there is a common layout."""
    rng, k = np.random.default_rng(seed), 3 + seed
    a, b = pairs.blob(2, seed % 7), pairs.blob(2, (seed + 3) % 7, turned=1 + seed % 5)
    marks = np.stack([rng.permutation(len(m.points))[:k] for m in (a, b)], 1)
    found = circparam.map_surfaces(a, b, landmarks=marks)
    assert found.inversions == (0, 0)
    assert found.landmark_error == 0
    image = found.map.to_b.of(b.points, b.faces)
    np.testing.assert_array_equal(image[marks[:, 0]], b.points[marks[:, 1]])


def sheet(n: int, seed: int) -> Mesh:
    return Mesh(*shapes.bumped_disk(n, seed=seed))


PLACES = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0.3, 0.2, 0.3], [-0.4, -0.3, 0.3]])


@pytest.mark.parametrize("k", [0, 1, 3, 5])
def test_disks_map_boundary_on_boundary(k: int) -> None:
    a, b = sheet(500, 0), sheet(700, 3)
    marks = np.stack([pairs.nearest(m, PLACES[:k]) for m in (a, b)], 1) if k else None
    found = circparam.map_surfaces(a, b, landmarks=marks)
    assert found.inversions == (0, 0)
    for first, second, places in ((a, b, found.map.to_b), (b, a, found.map.to_a)):
        rim = on_rim(first)
        image = places.of(second.points, second.faces)[rim]
        ends = second.points[on_rim(second)]
        gap = np.abs(np.linalg.norm(image[:, :2], axis=1) - 1)
        assert gap.max() < 0.02  # on the edges between the vertices of a circle
        assert len(ends) > 20
        zero = (places.weights[rim] == 0).any(1)
        assert zero.all()
    if k:
        image = found.map.to_b.of(b.points, b.faces)
        np.testing.assert_array_equal(image[marks[:, 0]], b.points[marks[:, 1]])


def test_boundaries_are_matched_by_length_between_landmarks() -> None:
    """Two meshes of one square, its corners given: along the sides everything stays."""
    a, b = Mesh(*shapes.grid(8, 6)), Mesh(*shapes.grid(10, 9))
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    marks = np.stack([pairs.nearest(m, corners) for m in (a, b)], 1)
    found = circparam.map_surfaces(a, b, landmarks=marks)
    image = found.map.to_b.of(b.points, b.faces)
    rim = (a.points[:, :2] % 1 == 0).any(1)
    np.testing.assert_allclose(image[rim], a.points[rim], atol=1e-12)
    assert found.inversions == (0, 0)


def on_rim(mesh: Mesh) -> np.ndarray:
    return np.flatnonzero(np.linalg.norm(mesh.points[:, :2], axis=1) > 1 - 1e-9)


def test_holes_go_to_holes() -> None:
    a, b = Mesh(*shapes.annulus(40, 8)), Mesh(*shapes.annulus(32, 6))
    first = [int(m.points[:, 0].argmax()) for m in (a, b)]
    found = circparam.map_surfaces(a, b, landmarks=np.array([first]))
    assert found.inversions == (0, 0)
    image = found.map.to_b.of(b.points, b.faces)
    inner = np.linalg.norm(a.points, axis=1)
    for radius in (inner.min(), inner.max()):
        ring = np.isclose(inner, radius)
        assert np.allclose(np.linalg.norm(image[ring], axis=1), radius, atol=0.01)


def test_a_mirrored_surface_is_told_and_mapped_where_that_is_meant() -> None:
    a, b = pairs.blob(3, 1), pairs.blob(3, 1, turned=5)
    check_mirrored(a, b, pairs.marks(a, b), 0.005)


def test_vertices_that_a_file_splits_get_the_same_place() -> None:
    """As glTF does at seams: every corner its own vertex."""
    a, b = pairs.blob(2, 1), pairs.blob(2, 1, turned=5)
    marks = pairs.marks(a, b)
    soup = Mesh(a.points[a.faces.ravel()], np.arange(a.faces.size).reshape(-1, 3))
    own = [int(np.flatnonzero(a.faces.ravel() == v)[0]) for v in marks[:, 0]]
    found = circparam.map_surfaces(soup, b, landmarks=np.stack([own, marks[:, 1]], 1))
    image = found.map.to_b.of(b.points, b.faces)
    for v in range(len(a.points)):
        assert (image[a.faces.ravel() == v] == image[a.faces.ravel() == v][0]).all()
    assert found.inversions == (0, 0)


def test_the_same_bytes_again() -> None:
    a, b = pairs.blob(2, 1), pairs.blob(2, 4, turned=5)
    first, second = (
        circparam.map_surfaces(a, b, landmarks=pairs.marks(a, b)).map for _ in range(2)
    )
    np.testing.assert_array_equal(first.to_b.weights, second.to_b.weights)
    np.testing.assert_array_equal(first.to_a.face, second.to_a.face)


# what has no map ------------------------------------------------------------------------------------------


def test_other_topology_is_told() -> None:
    ball, disk, ring = pairs.blob(2), sheet(200, 0), Mesh(*shapes.torus())
    with pytest.raises(TopologyError, match="A has 0 boundaries and B 1"):
        circparam.map_surfaces(ball, disk)
    with pytest.raises(TopologyError, match="A has genus 0 and B 1"):
        circparam.map_surfaces(ball, ring)
    two = Mesh(*shapes.row_of((ball.points, ball.faces), 2, 3.0))
    with pytest.raises(TopologyError, match="A: it has 2 connected parts"):
        circparam.map_surfaces(two, ball)


@pytest.mark.parametrize(
    ("marks", "words"),
    [
        ([[0, 0], [1, 10**6], [2, 2]], "landmark 2: B has no vertex 1000000"),
        ([[0, 0], [0, 1], [2, 2]], "landmark 2: vertex 0 of A is that of landmark 1"),
        ([[0, 0], [5, 5]], "3 or more"),
    ],
)
def test_landmarks_that_say_nothing(marks: list[list[int]], words: str) -> None:
    ball = pairs.blob(2)
    with pytest.raises((InputError, TopologyError), match=words):
        circparam.map_surfaces(ball, ball, landmarks=marks)


def test_a_landmark_on_no_face_is_told() -> None:
    ball = pairs.blob(2)
    loose = Mesh(np.concatenate([ball.points, [[9.0, 9, 9]]]), ball.faces)
    k = len(ball.points)
    with pytest.raises(InputError, match=f"no face of A uses vertex {k}"):
        circparam.map_surfaces(loose, ball, landmarks=[[k, 0], [1, 1], [2, 2]])


def test_landmarks_in_another_order_round_a_boundary_are_told() -> None:
    a, b = sheet(300, 0), sheet(300, 1)
    rim = [on_rim(m) for m in (a, b)]
    angle = [np.arctan2(m.points[r, 1], m.points[r, 0]) for m, r in zip((a, b), rim, strict=True)]
    at = [r[np.argsort(t)] for r, t in zip(rim, angle, strict=True)]
    goal = [0, 8, 16, 24]
    for order, words in (([0, 24, 16, 8], "opposite order"), ([0, 16, 8, 24], "another order")):
        marks = np.stack([at[0][goal], at[1][order]], 1)
        with pytest.raises(InputError, match=words):
            circparam.map_surfaces(a, b, landmarks=marks, mirrored=False)


def test_a_landmark_inside_does_not_go_to_a_boundary() -> None:
    a, b = sheet(300, 0), sheet(300, 1)
    inside = int(np.linalg.norm(a.points[:, :2], axis=1).argmin())
    with pytest.raises(InputError, match="on a boundary of B and inside A"):
        circparam.map_surfaces(a, b, landmarks=[[inside, int(on_rim(b)[0])]])


def test_unlike_surfaces_without_landmarks_are_refused() -> None:
    ball = pairs.blob(2)
    stick = Mesh(ball.points * [6, 1, 1], ball.faces)
    with pytest.raises(InputError, match="landmarks"):
        circparam.map_surfaces(ball, stick)


@pytest.mark.parametrize("method", ["harmonic", "authalic", "lscm"])
def test_weights_that_can_be_negative_are_refused(method: str) -> None:
    ball = pairs.blob(2)
    with pytest.raises(OptionError, match="circle"):
        circparam.map_surfaces(ball, ball, method=method)
