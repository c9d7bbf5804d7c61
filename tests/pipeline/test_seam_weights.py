"""What a seam costs where the user says so: never means never, free draws seams, bad weights are told."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, OptionError
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.pipeline.save import seam_pairs
from circparam.pipeline.seam_weights import edge_weights
from tests.support import shapes
from tests.support.atlases import ends
from tests.support.command_line import obj

QUICK = {"effort": "draft", "jobs": 1}


def rows(vertices: np.ndarray, weight: float) -> np.ndarray:
    """The same weight near some vertices."""
    v = np.asarray(vertices, float)
    return np.stack([v, np.full(len(v), -1.0), np.full(len(v), weight)], 1)


def share(result: circparam.Result, side: np.ndarray) -> float:
    """Share of the length of the seams that runs among some vertices ((n,) bool)."""
    p = result.mesh.points
    pairs = seam_pairs(result)
    length = np.linalg.norm(p[pairs[:, 0]] - p[pairs[:, 1]], axis=1)
    return float(length[side[pairs].all(1)].sum() / length.sum())


def test_no_seam_touches_what_says_never():
    ball = shapes.icosphere(2)
    plain = circparam.unwrap(ball, **QUICK)
    middle = ball[0][seam_pairs(plain)[0, 0]]
    face = np.flatnonzero(ball[0] @ middle > 0.8)
    assert np.isin(seam_pairs(plain), face).any()
    kept = circparam.unwrap(ball, seam_weights=rows(face, np.inf), **QUICK)
    assert not np.isin(seam_pairs(kept), face).any()
    assert kept.verification.flips == 0


def test_seams_go_where_they_are_free_and_leave_what_is_dear():
    ring = shapes.torus(24, 12)
    back = ring[0][:, 0] < 0
    plain = share(circparam.unwrap(ring, **QUICK), back)
    free = circparam.unwrap(ring, seam_weights=rows(np.flatnonzero(back), 0.0), **QUICK)
    dear = circparam.unwrap(ring, seam_weights=rows(np.flatnonzero(back), 20.0), **QUICK)
    assert share(free, back) > plain + 0.1
    assert share(dear, back) < plain
    assert free.verification.valid
    assert dear.verification.valid


@pytest.mark.parametrize(
    ("weight", "splits"),
    [(10.0, "auto"), (50.0, 3), (np.inf, "auto"), (np.inf, 3), (None, "auto"), (None, 3)],
)
def test_a_tube_is_opened_along_the_line_that_is_left_free(weight: float | None, splits) -> None:
    """Whatever its page gains by a cut: no other line may be one (by --no-seams too), or each is dear."""
    side = np.arange(12)
    walls = np.stack([2 * side, 2 * side + 1, (2 * side + 3) % 24, (2 * side + 2) % 24], 1)
    turn = np.repeat(np.pi / 6 * side, 2)
    p = np.stack([np.sin(turn), np.cos(turn), np.tile([-1.0, 1.0], 12)], 1)
    f = np.concatenate([walls[:, [0, 1, 2]], walls[:, [0, 2, 3]]])
    mesh = Mesh(p, f, polygons=np.tile(side, 2))
    for free in (0, 2, 8, 14):  # rounding decides which creases of 30° count as sharp
        others = np.setdiff1d(np.arange(24), [free, free + 1])
        given = {"seam_weights": rows(others, weight)} if weight else {}
        if weight is None:
            given = {"no_seams": [(v, v + 1) for v in range(0, 24, 2) if v != free]}
        result = circparam.unwrap(mesh, **given, pack_splits=splits, **QUICK)
        assert result.status == "ok"
        assert np.sort(seam_pairs(result), 1).tolist() == [[free, free + 1]]


def test_the_weight_of_an_edge_goes_before_those_of_its_vertices():
    document = from_arrays(*shapes.grid(3, 2))
    surface, report = repair(document.mesh)
    a, b = ends(surface).T
    p, q = int(a[0]), int(b[0])
    given = np.array([[p, -1, 4.0], [q, -1, np.inf], [p, q, 9.0], [q, p, 0.5]])
    weights = edge_weights(document, surface, report, given)
    assert weights[0] == 0.5  # of two lines the last counts
    at_vertex = np.ones(6)
    at_vertex[p], at_vertex[q] = 4.0, np.inf
    assert np.array_equal(weights[1:], ((at_vertex[a] + at_vertex[b]) / 2)[1:])


def test_red_vertices_keep_their_faces_whole(tmp_path: Path):
    points, faces = shapes.icosphere(2)
    face = points[:, 0] > 0.6
    colour = np.where(face[:, None], [1.0, 0, 0], [0.5, 0.5, 0.5])
    painted = obj(tmp_path / "b.obj", (np.c_[points, colour], faces))
    result = circparam.unwrap(painted, seam_weights="colour", **QUICK)
    pairs = seam_pairs(result)
    assert len(pairs)
    assert not np.isin(pairs, np.flatnonzero(face)).any()


def test_what_the_mesh_does_not_have(tmp_path: Path):
    ball = shapes.icosphere(1)
    for given, message in (
        (rows(np.array([999]), 0.0), "vertex 999"),
        (np.array([[0.0, 0.0, 2.0]]), "no edge"),
        ("colour", "no colours"),
        ("colours", "give a file"),
    ):
        with pytest.raises(OptionError, match=message):
            circparam.unwrap(ball, seam_weights=given, **QUICK)
    with pytest.raises(InputError, match="a weight is a number"):
        circparam.unwrap(ball, seam_weights=rows(np.array([0]), -1.0), **QUICK)


@pytest.mark.parametrize(
    "given", [np.ones(80), [(0, 2.0), (1, 2.0), (2, 2.0)], [(0, np.nan, 1.0)], "x" * 9999]
)
def test_rows_of_another_length_are_refused_in_a_short_line(given: object) -> None:
    """Three rows of two were read as two rows of three."""
    with pytest.raises(OptionError, match=r"give 'colour', or|give a file, or") as error:
        circparam.unwrap(shapes.icosphere(1), seam_weights=given, **QUICK)
    assert len(str(error.value)) < 200
