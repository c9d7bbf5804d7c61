"""Pairs that have no map, and landmarks and paths that name nothing: one line with cause and place."""

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, OptionError, TopologyError
from circparam.mesh.mesh import Mesh
from tests.support import pairs, shapes, tori
from tests.support.map_cases import boundary

BALL = pairs.blob(2, 1)
DISK, OTHER_DISK = (Mesh(*shapes.bumped_disk(200, seed=k)) for k in (0, 1))
TORUS = tori.torus(12, 8)
ON_TORUS = tori.marks(TORUS, TORUS)
FIRST, SECOND = (int(v) for v in ON_TORUS[:2, 0])
LOOSE = Mesh(np.concatenate([BALL.points, [[9.0, 9, 9]]]), BALL.faces)
TWO = Mesh(*shapes.row_of((BALL.points, BALL.faces), 2, 3.0))
STICK = Mesh(BALL.points * [6, 1, 1], BALL.faces)
TWIST = np.exp(0.7j * 3 * BALL.points[:, 0]) * (BALL.points[:, 1] + 0.4j * BALL.points[:, 2])
CHIRAL = Mesh(np.stack([3 * BALL.points[:, 0], TWIST.real, TWIST.imag], 1), BALL.faces)
INSIDE_OUT = Mesh(CHIRAL.points, CHIRAL.faces[:, ::-1])
MIDDLE = int(np.linalg.norm(DISK.points[:, :2], axis=1).argmin())
RIM = int(boundary(OTHER_DISK)[0])
PAIRS = {
    "boundaries": (BALL, DISK, {}, TopologyError, "A has 0 boundaries and B 1"),
    "handles": (BALL, TORUS, {}, TopologyError, "A has genus 0 and B 1"),
    "fewer handles": (TORUS, BALL, {}, TopologyError, "A has genus 1 and B 0"),
    "parts": (TWO, BALL, {}, TopologyError, "A: it has 2 connected parts"),
    "unlike": (BALL, STICK, {}, InputError, "too unlike to guess landmarks"),
    "inside out": (CHIRAL, INSIDE_OUT, {}, TopologyError, "B is inside out beside A.*--mirrored"),
    "harmonic": (BALL, BALL, {"method": "harmonic"}, OptionError, "circle"),
    "lscm": (BALL, BALL, {"method": "lscm"}, OptionError, "circle"),
    "overlay": (DISK, DISK, {"overlay": True}, OptionError, "boundaries"),
    "no uv": (BALL, BALL, {"charts": True}, InputError, "A: it has no uv"),
    "paths alone": (TORUS, TORUS, {"paths": [[0, 1]]}, InputError, "no landmarks are given"),
}
MARKS = {
    "no vertex": (BALL, BALL, [[0, 0], [1, 10**6]], "landmark 2: B has no vertex 1000000"),
    "twice": (BALL, BALL, [[0, 0], [0, 1]], "landmark 2: vertex 0 of A is that of landmark 1"),
    "few": (BALL, BALL, [[0, 0], [5, 5]], "3 or more"),
    "unused": (LOOSE, BALL, [[len(BALL.points), 0]], "no face of A uses vertex"),
    "to a rim": (DISK, OTHER_DISK, [[MIDDLE, RIM]], "on a boundary of B and inside A"),
    "uncut": (TORUS, TORUS, ON_TORUS[[0, 1, 3]], "1 handle of 1 uncut"),
}
PATHS = {
    "one landmark": ([FIRST], "path 1: it names 1 landmark"),
    "far": ([FIRST, 10**6], "path 1: vertex 1000000 of A is not a landmark"),
    "no landmark": ([FIRST, FIRST + 1], "not a landmark"),
    "there and back": ([FIRST, SECOND, FIRST], "joined already"),
}
BAD = (InputError, TopologyError)
PAIRS |= {name: (a, b, {"landmarks": x}, BAD, said) for name, (a, b, x, said) in MARKS.items()}
PAIRS |= {
    name: (TORUS, TORUS, {"landmarks": ON_TORUS, "paths": [path]}, InputError, said)
    for name, (path, said) in PATHS.items()
}


@pytest.mark.parametrize("kind", PAIRS)
def test_pairs_landmarks_and_paths_without_a_map(kind: str) -> None:
    a, b, words, error, message = PAIRS[kind]
    with pytest.raises(error, match=message):
        circparam.map_surfaces(a, b, **words)


@pytest.mark.parametrize(
    ("order", "message"),
    [([0, 18, 12, 6], "opposite orders"), ([0, 12, 6, 18], "different orders")],
)
def test_landmarks_in_another_order_round_a_boundary(order: list[int], message: str) -> None:
    at = []
    for mesh in (DISK, OTHER_DISK):
        rim = boundary(mesh)
        at.append(rim[np.argsort(np.arctan2(mesh.points[rim, 1], mesh.points[rim, 0]))])
    marks = np.stack([at[0][[0, 6, 12, 18]], at[1][order]], 1)
    with pytest.raises(InputError, match=message):
        circparam.map_surfaces(DISK, OTHER_DISK, landmarks=marks, mirrored=False)


def test_paths_that_cross() -> None:
    """From pole to pole no path leads past the equator."""
    marks = pairs.marks(BALL, BALL)
    v = marks[:, 0].tolist()
    equator = [v[0], v[2], v[1], v[3], v[0]]
    found = circparam.map_surfaces(BALL, BALL, landmarks=marks, paths=[equator], relax=False)
    assert found.inversions == (0, 0)
    with pytest.raises(TopologyError, match="path from landmark 5 to 6 crosses"):
        circparam.map_surfaces(BALL, BALL, landmarks=marks, paths=[equator, [v[4], v[5]]])
