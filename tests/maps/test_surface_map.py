"""The map as data: interpolation at places, the file, and meshes that do not fit."""

import contextlib

import numpy as np
import pytest

from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.formats.memory import from_arrays
from circparam.maps import Places, SurfaceMap, load_map, save_map
from circparam.maps.surface_map import fingerprint, oriented, turned_over
from circparam.mesh.mesh import Mesh

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
A = Mesh(POINTS, np.array([[0, 1, 2]]))
B = Mesh(POINTS, np.array([[0, 1, 2], [1, 3, 2]]))


def some_map() -> SurfaceMap:
    to_b = Places(np.array([0, 0, 1, 1]), np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0]]))
    to_a = Places(
        np.zeros(4, np.int64), np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0.5, 0.5]])
    )
    return SurfaceMap(to_b, to_a, fingerprint(A), fingerprint(B))


def test_the_file_keeps_the_map(tmp_path) -> None:
    path = tmp_path / "a ü.npz"
    made = some_map()
    save_map(path, made)
    read = load_map(path)
    assert np.array_equal(read.to_b.face, made.to_b.face)
    assert np.array_equal(read.to_b.weights, made.to_b.weights)
    assert np.array_equal(read.to_a.weights, made.to_a.weights)
    read.check(A, B)
    with pytest.raises(OptionError, match="--overwrite"):
        save_map(path, made)


def test_other_meshes_are_refused_and_other_positions_are_not() -> None:
    made = some_map()
    moved = Mesh(POINTS * 2, B.faces)
    made.check(A, moved)
    with pytest.raises(InputError, match="first"):
        made.check(B, B)
    with pytest.raises(InputError, match="second"):
        made.check(A, Mesh(POINTS, B.faces[::-1]))
    made.turned().check(B, A)
    assert np.array_equal(made.turned().to_b.weights, made.to_a.weights)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"text"])
def test_another_file_is_named(tmp_path, content: bytes) -> None:
    path = tmp_path / "map.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"map\.npz") as caught:
        load_map(path)
    assert "pickle" not in str(caught.value)  # which NumPy would have people trust


def document(mesh: Mesh) -> Document:
    return from_arrays(mesh.points, mesh.faces)


DAMAGE = {
    "fewer faces": lambda d: d.update(a_face=d["a_face"][:-1]),
    "fewer of both": lambda d: d.update(a_face=d["a_face"][:-1], a_weights=d["a_weights"][:-1]),
    "two weights": lambda d: d.update(b_weights=d["b_weights"][:, :2]),
    "flat weights": lambda d: d.update(b_weights=d["b_weights"].ravel()),
    "no number": lambda d: d.update(a_weights=d["a_weights"] * np.nan),
    "faces that are not there": lambda d: d.update(b_face=d["b_face"] + 7),
    "negative faces": lambda d: d.update(b_face=d["b_face"] - 7),
    "text": lambda d: d.update(a_face=d["a_face"].astype(str)),
    "one number": lambda d: d.update(a_face=np.array(3)),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_map_is_told_before_it_is_used(tmp_path, kind: str) -> None:
    """Whoever edited it, or whatever half of a file is left."""
    path = tmp_path / "map.npz"
    save_map(path, some_map())
    with np.load(path) as file:
        data = dict(file)
    DAMAGE[kind](data)
    np.savez(path, **data)
    for first, second in ((A, B), (B, A)):
        with pytest.raises(InputError, match="circparam map"):
            oriented(load_map(path), document(first), document(second))


def test_a_map_with_wrong_bytes_is_told_or_read(tmp_path) -> None:
    """Nothing but an InputError leaves, wherever the file is spoilt."""
    path = tmp_path / "map.npz"
    save_map(path, some_map())
    whole = path.read_bytes()
    told = 0
    for at in range(1, len(whole), 97):
        path.write_bytes(whole[:at] + bytes(20) + whole[at + 20 :])
        with contextlib.suppress(InputError):
            oriented(load_map(path), document(A), document(B))
            continue
        told += 1
    assert told > 5


def test_faces_look_against_the_source_by_all_their_corners() -> None:
    """Of a face that reaches over a thin edge, one corner lies on the far side."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -0.01]])
    sheet = Mesh(points, np.array([[0, 1, 2], [0, 2, 1], [3, 1, 2]]))  # front, back, front
    for corner in range(3):
        for face, over in (([0, 1, 2], False), ([0, 2, 1], True)):
            on = np.zeros(3, np.int64)
            on[face[corner]] = 1
            weights = np.eye(3)
            if on.any():  # the back lists its corners the other way round
                weights[face[corner]] = weights[face[corner]][[0, 2, 1]]
            target = Mesh(points[:3], np.array([face]))
            mapped = SurfaceMap(
                Places(on, weights), Places(np.zeros(4, np.int64), np.tile([1.0, 0, 0], (4, 1))),
                fingerprint(target), fingerprint(sheet),
            )  # fmt: skip
            assert turned_over(mapped, target, sheet).tolist() == [over]
