"""Maps between surfaces of every topology: one to one, landmarks met exactly, known answers, one result."""

import numpy as np
import pytest

import circparam
from circparam.errors import TopologyError
from circparam.maps.map_input import map_input_of
from circparam.maps.map_surfaces import MapResult
from circparam.mesh.mesh import Mesh
from tests.support import pairs, shapes, tori
from tests.support.map_cases import CLOSED, KINDS, Pair, boundary, mapped, pair


def both_ways(case: Pair, found: MapResult):
    """(from, to, places) of A → B and of B → A."""
    return (case.a, case.b, found.map.to_b), (case.b, case.a, found.map.to_a)


def covers_once(case: Pair, found: MapResult, kind: str) -> None:
    """Images go once round the surface, measured by angles that know nothing of the domain."""
    assert found.inversions == (0, 0)
    for first, second, places in both_ways(case, found):
        image = places.of(second.points, second.faces)
        if kind == "sphere":  # star-shaped about the origin
            assert np.isclose(pairs.solid_angles(image, first.faces).sum(), 4 * np.pi)
        elif kind == "torus":
            turns = tori.turns(image, first.faces)
            assert np.isclose(turns.sum(), 1)
            assert turns.min() > -1e-4  # chords of the flat faces, seen by angle


def meets_landmarks(case: Pair, found: MapResult) -> None:
    for (first, second, places), ends in zip(
        both_ways(case, found), (case.marks, case.marks[:, ::-1]), strict=True
    ):
        image = places.of(second.points, second.faces)
        np.testing.assert_array_equal(image[ends[:, 0]], second.points[ends[:, 1]])
        assert len(image) == len(first.points)
    assert found.landmark_error == 0


@pytest.mark.parametrize(
    ("kind", "relax"), [*((kind, True) for kind in KINDS), ("sphere", False), ("disk", False)]
)
def test_a_map_keeps_its_promises(kind: str, relax: bool) -> None:
    case, found = pair(kind), mapped(kind, relax)
    told = any("relaxation turns faces over" in note for note in found.notes)
    assert told == (kind == "holed torus" and relax)
    covers_once(case, found, kind)
    meets_landmarks(case, found)
    edge = max(pairs.longest_edge(case.a), pairs.longest_edge(case.b))
    if kind in CLOSED:
        assert pairs.there_and_back(case.a, case.b, found.map) < edge
    for first, second, places in both_ways(case, found):
        assert places.face.shape == (len(first.points),)
        assert ((places.face >= 0) & (places.face < len(second.faces))).all()
        assert (places.weights >= 0).all()
        np.testing.assert_allclose(places.weights.sum(1), 1, atol=1e-12)
        rim, ends = boundary(first), boundary(second)
        on_edge = places.weights[rim] == 0
        assert on_edge.any(1).all()
        touched = second.faces[places.face[rim]][~on_edge]
        assert np.isin(touched, ends).all()
    found.map.check(case.a, case.b)
    if relax and kind in CLOSED:
        assert found.a_to_b.mean < found.start.mean
        assert np.isclose(found.start.mean, mapped(kind, False).a_to_b.mean)


@pytest.mark.parametrize("kind", ["sphere", "torus"])
def test_the_same_bytes_again_and_from_the_other_side(kind: str) -> None:
    """A second call gives the same bytes; the map of B to A keeps its promises as well."""
    case, found = pair(kind), mapped(kind).map
    again = circparam.map_surfaces(case.a, case.b, landmarks=case.marks).map
    for one, two in ((found.to_b, again.to_b), (found.to_a, again.to_a)):
        np.testing.assert_array_equal(one.weights, two.weights)
        np.testing.assert_array_equal(one.face, two.face)
    turned = circparam.map_surfaces(case.b, case.a, landmarks=case.marks[:, ::-1])
    covers_once(case.turned, turned, kind)
    meets_landmarks(case.turned, turned)


@pytest.mark.parametrize("kind", ["sphere", "torus"])
@pytest.mark.parametrize("method", ["circle", "floater", "uniform"])
def test_all_positive_weights_give_a_map(kind: str, method: str) -> None:
    case = pair(kind)
    found = circparam.map_surfaces(case.a, case.b, landmarks=case.marks, method=method, relax=False)
    covers_once(case, found, kind)
    meets_landmarks(case, found)


def random_blobs(seed: int) -> Pair:
    """Two blobs, landmarks anywhere."""
    rng, k = np.random.default_rng(seed), 3 + seed
    a, b = pairs.blob(2, seed % 7), pairs.blob(2, (seed + 3) % 7, turned=1 + seed % 5)
    return Pair(a, b, np.stack([rng.permutation(len(m.points))[:k] for m in (a, b)], 1))


@pytest.mark.parametrize("seed", [1, 2, 4, 6])
def test_random_landmarks_are_met(seed: int) -> None:
    """Wherever the landmarks of two spheres are, however far the paths must wind: there is a common layout.

    Flips over a relaxed domain do not end the relaxation: they are mended over the domain as it was before.
    """
    case = random_blobs(seed)
    found = circparam.map_surfaces(case.a, case.b, landmarks=case.marks)
    assert found.inversions == (0, 0)
    meets_landmarks(case, found)
    if seed in (2, 4):
        assert not any("relaxation turns faces over" in note for note in found.notes)
        assert found.a_to_b.mean < found.start.mean


@pytest.mark.parametrize("seed", [1, 8])
def test_landmarks_of_a_torus_in_other_places(seed: int) -> None:
    """Three or four landmarks change places: arcs between them may open a handle on one surface alone."""
    a, b = tori.torus(16, 8), tori.torus(18, 9, 0.2)
    marks = tori.marks(a, b)
    chosen = np.random.default_rng(seed).permutation(len(marks))[: 2 + seed % 3]
    marks[chosen, 1] = np.roll(marks[chosen, 1], 1)
    found = circparam.map_surfaces(a, b, landmarks=marks, relax=False)
    assert found.inversions == (0, 0)
    meets_landmarks(Pair(a, b, marks), found)


# known answers ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turned", [False, True], ids=["as wound", "inside out"])
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["itself", "image"])
def test_guessed_landmarks_respect_the_fronts(sign: float, turned: bool, mirrored: bool) -> None:
    """A blob that is about its own image, and its twins: the map is an isometry whichever way they face."""
    a = pairs.blob(2, 1)
    faces = a.faces[:, ::-1] if turned != (sign < 0) else a.faces
    b = Mesh(a.points * [sign, 1, 1], faces)
    found = circparam.map_surfaces(a, b, mirrored=mirrored)
    assert found.a_to_b.mean < 1.01
    assert any("guessed" in line for line in found.notes)


@pytest.mark.parametrize("kind", ["sphere", "sphere, guessed", "torus, guessed", "genus 2"])
def test_a_surface_on_its_own_remeshing_is_where_it_was(kind: str) -> None:
    if kind.startswith("sphere"):
        a, b = pairs.blob(3, 3), pairs.blob(3, 3, turned=7)
        marks = pairs.marks(a, b)
    elif kind.startswith("torus"):
        a, b = tori.torus(30, 15, 0.3), tori.torus(36, 18, 0.3, turned=0.05)
    else:
        case = pair(kind)
        a, b, marks = case.a, case.b, case.marks
    guessed = kind.endswith("guessed")
    if kind == "genus 2":
        found = mapped(kind)
    else:
        found = circparam.map_surfaces(a, b, landmarks=None if guessed else marks)
    image = found.map.to_b.of(b.points, b.faces)
    size = np.linalg.norm(np.ptp(a.points, axis=0))
    assert np.linalg.norm(image - a.points, axis=1).mean() < 0.005 * size
    assert found.a_to_b.mean < 1.02
    assert found.a_to_b.mean < found.start.mean
    assert any("guessed" in line for line in found.notes) == guessed


@pytest.mark.parametrize("marked", [True, False])
def test_rims_go_to_rims(marked: bool) -> None:
    """With landmarks or without, a circle goes to a circle and a hole to the hole."""
    for kind in ("disk", "ring"):
        if kind == "ring" and not marked:
            continue  # the pairing of two rims is open
        case = pair(kind)
        found = mapped(kind) if marked else circparam.map_surfaces(case.a, case.b, landmarks=None)
        assert found.inversions == (0, 0)
        image = found.map.to_b.of(case.b.points, case.b.faces)
        rim = boundary(case.a)
        own, there = (np.linalg.norm(p[rim][:, :2], axis=1) for p in (case.a.points, image))
        np.testing.assert_allclose(there, own, atol=0.03)  # on the edges of a polygon
        if not marked:
            assert any("boundary has no landmark" in line for line in found.notes)


def test_boundaries_are_matched_by_length_between_landmarks() -> None:
    """Two meshes of one square, its corners given: along the sides everything stays."""
    a, b = Mesh(*shapes.grid(8, 6)), Mesh(*shapes.grid(10, 9))
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    marks = np.stack([pairs.nearest(m, corners) for m in (a, b)], 1)
    found = circparam.map_surfaces(a, b, landmarks=marks)
    image = found.map.to_b.of(b.points, b.faces)
    rim = boundary(a)
    np.testing.assert_allclose(image[rim], a.points[rim], atol=1e-12)
    assert found.inversions == (0, 0)


@pytest.mark.parametrize(("kind", "most"), [("sphere", 0.01), ("torus", 0.02)])
def test_a_mirrored_surface_is_refused_and_mapped_on_request(kind: str, most: float) -> None:
    if kind == "sphere":
        a, b = pairs.blob(2, 1), pairs.blob(2, 1, turned=5)
        marks = pairs.marks(a, b)
    else:
        a, b = tori.torus(24, 12, 0.3), tori.torus(30, 15, 0.3)
        marks = tori.marks(a, b)
    mirror = Mesh(b.points * [1, 1, -1], b.faces[:, ::-1])
    with pytest.raises(TopologyError, match="mirrored"):
        circparam.map_surfaces(a, mirror, landmarks=marks)
    found = circparam.map_surfaces(a, mirror, landmarks=marks, mirrored=True)
    assert found.inversions == (0, 0)
    image = found.map.to_b.of(mirror.points, mirror.faces)
    size = np.linalg.norm(np.ptp(a.points, axis=0))
    assert np.linalg.norm(image * [1, 1, -1] - a.points, axis=1).mean() < most * size


def test_vertices_that_a_file_splits_get_the_same_place() -> None:
    """As glTF does at seams: every corner its own vertex; the map is that of the welded file."""
    case = pair("sphere")
    flat = case.a.faces.ravel()
    soup = Mesh(case.a.points[flat], np.arange(len(flat)).reshape(-1, 3))
    own = np.unique(flat, return_index=True)[1][case.marks[:, 0]]
    found = circparam.map_surfaces(soup, case.b, landmarks=np.stack([own, case.marks[:, 1]], 1))
    image, whole = (f.map.to_b.of(case.b.points, case.b.faces) for f in (found, mapped("sphere")))
    assert found.inversions == (0, 0)
    edge = pairs.longest_edge(case.b)
    assert np.linalg.norm(image - whole[flat], axis=1).max() < edge
    first = image[np.unique(flat, return_index=True)[1]]
    np.testing.assert_array_equal(image, first[flat])


def test_a_poor_map_says_where_to_add_landmarks() -> None:
    a = pairs.blob(3, 1)
    tip = int(np.argmax(a.points[:, 2]))
    long = a.points.copy()
    far = np.linalg.norm(long - long[tip], axis=1)
    long[:, 2] += 6 * np.maximum(0, 1 - far / 0.35)
    marks = pairs.marks(a, a)[[0, 1, 2, 3, 5]]
    found = circparam.map_surfaces(a, Mesh(long, a.faces), landmarks=marks)
    (line,) = [x for x in found.notes if "add a landmark" in x]
    vertex = int(line.split("vertex ")[1].split()[0])
    assert np.linalg.norm(a.points[vertex] - a.points[tip]) < 0.6
    assert not any("add a landmark" in x for x in mapped("sphere").notes)


# paths -----------------------------------------------------------------------------------------------------


def loops(marks: np.ndarray) -> list[list[int]]:
    """Round the tube and along the torus, through landmark 0."""
    k = marks.reshape(tori.ALONG, tori.ROUND, 2)[:, :, 0]
    return [[*k[0].tolist(), int(k[0, 0])], [*k[:, 0].tolist(), int(k[0, 0])]]


def test_paths_decide_the_way_round(tmp_path) -> None:
    """Along the torus B is cut along a way that winds once round the tube: the map winds as well."""
    nu, nv = 18, 9
    a = tori.torus(nu, nv)
    marks = tori.marks(a, a)
    plain = circparam.map_surfaces(a, a, landmarks=marks, paths=loops(marks))
    assert plain.a_to_b.mean < 1.001
    wound = marks.reshape(tori.ALONG, tori.ROUND, 2).copy()
    for k in range(1, tori.ALONG):  # rings a third of a turn further; the last step turns back
        wound[k, :, 1] = np.roll(wound[k, :, 1], -min(k, 2))
    wound = wound.reshape(-1, 2)
    rows = [f"{u} {v}" for u, v in wound]
    rows += ["path " + " ".join(map(str, path)) for path in loops(marks)]
    (tmp_path / "marks.txt").write_text("\n".join(rows) + "\n")
    found = circparam.map_surfaces(a, a, landmarks=tmp_path / "marks.txt", relax=False)
    assert found.inversions == (0, 0)
    meets_landmarks(Pair(a, a, wound), found)
    for result, times in ((plain, 0), (found, 1)):
        along = result.map.to_b.of(a.points, a.faces)[np.r_[0:nu, 0] * nv]
        step = np.diff(tori.angles(along)[:, 1])
        turn = ((step + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi)
        assert abs(turn) == pytest.approx(times, abs=1e-9)


def test_vertices_of_faces_without_area_lie_where_their_copies_lie() -> None:
    """A file that repeats a point for a face that is set aside: the point has the place of the vertex there."""
    ball = pairs.blob(1, 1)
    n = len(ball.points)
    points = np.concatenate([ball.points, ball.points[[5, 5]]])
    side = map_input_of(Mesh(points, np.concatenate([ball.faces, [[5, n, n + 1]]])), "A")
    assert (side.vertex[:n] >= 0).all()
    assert (side.vertex[n:] == side.vertex[5]).all()
