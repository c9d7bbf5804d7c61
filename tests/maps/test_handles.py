"""Maps between surfaces with handles: one to one, landmarks met exactly, known answers, paths, and what has
no map."""

from __future__ import annotations

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, TopologyError
from circparam.mesh.mesh import Mesh
from tests.support import pairs, tori
from tests.support.maps import check_mirrored


def covers_once(a: Mesh, b: Mesh, found) -> None:
    """The images of both tori go once round it, both ways, by angles that know nothing of the domain."""
    for image, faces in (
        (found.map.to_b.of(b.points, b.faces), a.faces),
        (found.map.to_a.of(a.points, a.faces), b.faces),
    ):
        turns = tori.turns(image, faces)
        assert np.isclose(turns.sum(), 1)
        assert turns.min() > -1e-4  # chords of the flat faces, seen by angle
    assert found.inversions == (0, 0)


def met(found, a: Mesh, b: Mesh, marks: np.ndarray) -> None:
    image = found.map.to_b.of(b.points, b.faces)
    np.testing.assert_array_equal(image[marks[:, 0]], b.points[marks[:, 1]])
    back = found.map.to_a.of(a.points, a.faces)
    np.testing.assert_array_equal(back[marks[:, 1]], a.points[marks[:, 0]])
    assert found.landmark_error == 0


@pytest.mark.parametrize("relax", [True, False])
@pytest.mark.parametrize("method", ["mean-value", "circle"])
def test_tori_map_one_to_one_with_landmarks_exact(method: str, relax: bool) -> None:
    a, b = tori.torus(24, 12), tori.torus(30, 14, 0.2)
    marks = tori.marks(a, b)
    found = circparam.map_surfaces(a, b, landmarks=marks, method=method, relax=relax)
    covers_once(a, b, found)
    met(found, a, b, marks)
    edge = max(pairs.longest_edge(a), pairs.longest_edge(b))
    assert pairs.there_and_back(a, b, found.map) < edge
    if relax:
        assert found.a_to_b.mean < found.start.mean


def test_a_torus_on_its_remeshing_is_where_it_was() -> None:
    a, b = tori.torus(36, 18, 0.3), tori.torus(44, 22, 0.3, turned=0.05)
    found = circparam.map_surfaces(a, b)  # landmarks guessed: both lie alike
    image = found.map.to_b.of(b.points, b.faces)
    size = np.linalg.norm(np.ptp(a.points, axis=0))
    assert np.linalg.norm(image - a.points, axis=1).mean() < 0.005 * size
    covers_once(a, b, found)
    assert any("guessed" in line for line in found.notes)


@pytest.mark.parametrize("k", [16, 24])
def test_genus_two_on_the_same_surface_in_finer_triangles(k: int) -> None:
    a, b = tori.plate(), tori.plate(fine=True)
    own = tori.spread(a, k)
    marks = np.stack([own, pairs.nearest(b, a.points[own])], 1)
    found = circparam.map_surfaces(a, b, landmarks=marks)
    image = found.map.to_b.of(b.points, b.faces)
    size = np.linalg.norm(np.ptp(a.points, axis=0))
    assert np.linalg.norm(image - a.points, axis=1).mean() < 0.001 * size
    assert found.a_to_b.mean < 1.001
    assert found.start.mean > 1.002
    assert found.inversions == (0, 0)
    met(found, a, b, marks)


def bent(mesh: Mesh) -> Mesh:
    p = mesh.points - mesh.points.mean(0)
    q = p.copy()
    turn = 0.25 * p[:, 0]
    q[:, 2] = p[:, 2] + 0.15 * p[:, 0] ** 2
    q[:, 1] = np.cos(turn) * p[:, 1] + 0.3 * p[:, 0]
    return Mesh(q, mesh.faces)


def test_genus_two_in_another_pose() -> None:
    a, b = tori.plate(), bent(tori.plate(fine=True))
    own = tori.spread(a, 18)
    marks = np.stack([own, pairs.nearest(tori.plate(fine=True), a.points[own])], 1)
    found = circparam.map_surfaces(a, b, landmarks=marks)
    assert found.inversions == (0, 0)
    met(found, a, b, marks)
    truth = bent(Mesh(a.points, a.faces)).points
    image = found.map.to_b.of(b.points, b.faces)
    size = np.linalg.norm(np.ptp(b.points, axis=0))
    assert np.linalg.norm(image - truth, axis=1).mean() < 0.02 * size
    assert found.a_to_b.mean < found.start.mean


def test_a_torus_with_a_hole_maps_hole_on_hole() -> None:
    meshes = []
    for mesh in (tori.torus(24, 12), tori.torus(30, 15)):
        at = tori.angles(mesh.points[mesh.faces].mean(1))
        keep = np.linalg.norm(at - [0.8, 0.8], axis=1) > 0.65
        used, faces = np.unique(mesh.faces[keep], return_inverse=True)
        meshes.append(Mesh(mesh.points[used], faces.reshape(-1, 3)))
    a, b = meshes
    found = circparam.map_surfaces(a, b, landmarks=tori.marks(a, b))
    assert found.inversions == (0, 0)
    for first, second, places in ((a, b, found.map.to_b), (b, a, found.map.to_a)):
        image = tori.angles(places.of(second.points, second.faces))
        rim = on_rim(first)
        assert np.linalg.norm(image[rim] - [0.8, 0.8], axis=1).max() < 1.1
        assert (places.weights[rim] == 0).any(1).all()


def on_rim(mesh: Mesh) -> np.ndarray:
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1)
    edge, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(edge[count == 1])


def test_the_same_bytes_again() -> None:
    a, b = tori.torus(18, 9), tori.torus(20, 10, 0.1)
    first, second = (circparam.map_surfaces(a, b, landmarks=tori.marks(a, b)).map for _ in range(2))
    np.testing.assert_array_equal(first.to_b.weights, second.to_b.weights)
    np.testing.assert_array_equal(first.to_a.weights, second.to_a.weights)
    np.testing.assert_array_equal(first.to_a.face, second.to_a.face)


# paths -----------------------------------------------------------------------------------------------------


def loops(marks: np.ndarray) -> list[list[int]]:
    """Round the tube and along the torus, through landmark 0."""
    k = marks.reshape(tori.ALONG, tori.ROUND, 2)[:, :, 0]
    return [[*k[0].tolist(), int(k[0, 0])], [*k[:, 0].tolist(), int(k[0, 0])]]


def test_paths_decide_the_way_round(tmp_path) -> None:
    """Along the torus B is cut along a way that winds once round the tube: the map winds as well."""
    a, b = tori.torus(36, 18), tori.torus(36, 18)
    marks = tori.marks(a, b)
    at = marks.reshape(tori.ALONG, tori.ROUND, 2).copy()
    plain = circparam.map_surfaces(a, b, landmarks=marks, paths=loops(marks))
    assert plain.a_to_b.mean < 1.001
    wound = at.copy()
    for k in range(
        1, tori.ALONG
    ):  # every next ring a third of a turn further; the last step turns back
        wound[k, :, 1] = np.roll(at[k, :, 1], -min(k, 2))
    file = tmp_path / "marks.txt"
    rows = [f"{u} {v}" for u, v in wound.reshape(-1, 2)]
    rows += ["path " + " ".join(map(str, path)) for path in loops(marks)]
    file.write_text("\n".join(rows) + "\n")
    found = circparam.map_surfaces(a, b, landmarks=file)
    assert found.inversions == (0, 0)
    met(found, a, b, wound.reshape(-1, 2))
    for result, times in ((plain, 0), (found, 1)):
        along = result.map.to_b.of(b.points, b.faces)[np.r_[0:36, 0] * 18]
        step = np.diff(tori.angles(along)[:, 1])
        turn = ((step + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi)
        assert abs(turn) == pytest.approx(times, abs=1e-9)


def test_the_arcs_of_paths_are_laid_before_all_others() -> None:
    from circparam.maps.landmarks import add_paths, given_landmarks
    from circparam.maps.layout import begun
    from circparam.maps.map_input import map_input_of

    a, b = (map_input_of(m, n) for m, n in ((tori.torus(24, 12), "A"), (tori.torus(30, 14), "B")))
    marks = given_landmarks(tori.marks(a.mesh, b.mesh), a, b)
    given = loops(tori.marks(a.mesh, b.mesh))
    add_paths(marks, given, a)
    layout = begun(a, b, marks)
    assert len(layout.ends) == 2 * (tori.ALONG + tori.ROUND)
    for tracer in layout.tracers:
        for arc, (i, j) in enumerate(layout.ends):
            path = tracer.arcs[arc]
            assert (path[0], path[-1]) == (tracer.marks[i], tracer.marks[j])
            assert (tracer.mesh.half_edges(path[:-1], path[1:]) >= 0).all()


@pytest.mark.parametrize(
    ("paths", "words"),
    [
        ([[0]], "path 1: it names 1 landmark"),
        ([[0, 10**6]], "path 1: vertex 1000000 of A is no landmark"),
        ([[1, 2]], "no landmark"),
    ],
)
def test_paths_that_say_nothing(paths: list[list[int]], words: str) -> None:
    a = tori.torus(24, 12)
    marks = tori.marks(a, a)
    with pytest.raises(InputError, match=words):
        circparam.map_surfaces(a, a, landmarks=marks, paths=paths)


def test_a_path_twice_is_told() -> None:
    a = tori.torus(24, 12)
    marks = tori.marks(a, a)
    twice = [[int(marks[0, 0]), int(marks[1, 0]), int(marks[0, 0])]]
    with pytest.raises(InputError, match="joined already"):
        circparam.map_surfaces(a, a, landmarks=marks, paths=twice)
    with pytest.raises(InputError, match="no landmarks are given"):
        circparam.map_surfaces(a, a, paths=twice)


def test_paths_that_cross_are_told() -> None:
    """From pole to pole no path leads past the equator."""
    a = pairs.blob(3, 1)
    marks = pairs.marks(a, a)
    v = marks[:, 0].tolist()
    equator = [v[0], v[2], v[1], v[3], v[0]]
    assert circparam.map_surfaces(a, a, landmarks=marks, paths=[equator]).inversions == (0, 0)
    with pytest.raises(TopologyError, match="path from landmark 5 to 6 crosses"):
        circparam.map_surfaces(a, a, landmarks=marks, paths=[equator, [v[4], v[5]]])


# what has no map -------------------------------------------------------------------------------------------


def test_other_genus_is_told() -> None:
    with pytest.raises(TopologyError, match="A has genus 1 and B 2"):
        circparam.map_surfaces(tori.torus(12, 8), tori.plate())


def test_landmarks_that_leave_a_handle_uncut_are_told() -> None:
    a = tori.torus(24, 12)
    marks = tori.marks(a, a)[[0, 1, 3]]
    with pytest.raises(TopologyError, match="1 handle of 1 uncut"):
        circparam.map_surfaces(a, a, landmarks=marks)


def test_a_mirrored_torus_is_told_and_mapped_where_that_is_meant() -> None:
    a, b = tori.torus(24, 12, 0.3), tori.torus(36, 18, 0.3)
    check_mirrored(a, b, tori.marks(a, b), 0.01)


def test_a_poor_map_says_where_to_add_landmarks() -> None:
    a, b = pairs.blob(3, 1), pairs.blob(3, 1)
    tip = int(np.argmax(b.points[:, 2]))
    ring = np.linalg.norm(b.points - b.points[tip], axis=1)
    long = b.points.copy()
    long[:, 2] += 6 * np.maximum(0, 1 - ring / 0.35)
    marks = pairs.marks(a, b)[[0, 1, 2, 3, 5]]
    found = circparam.map_surfaces(a, Mesh(long, b.faces), landmarks=marks)
    (line,) = [x for x in found.notes if "add a landmark" in x]
    vertex = int(line.split("vertex ")[1].split()[0])
    assert np.linalg.norm(a.points[vertex] - a.points[tip]) < 0.6
    plain = circparam.map_surfaces(a, b, landmarks=pairs.marks(a, b))
    assert not any("add a landmark" in x for x in plain.notes)
