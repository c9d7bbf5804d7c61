"""Charts rounded to what a format stores: upright, and free of overlap at their boundaries."""

import numpy as np
import pytest

from circparam.formats.memory import from_arrays
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.repair import repair
from circparam.pipeline.fallback import FLIPPED, OVERLAPPING
from circparam.pipeline.stored_repair import store
from tests.support import needles, shapes
from tests.support.needles import ROUNDINGS


def slit(n: int = 24):
    """A flat square with a slit from its middle to one side: (cut mesh, (nv, 2) places)."""
    p, f = shapes.grid(n, n)
    surface, _ = repair(from_arrays(p, f).mesh)
    h = surface.edges[:, 0]
    a, b = surface.faces.ravel()[h], surface.faces[h // 3, (h + 1) % 3]
    y = p[:, 1]
    row = np.unique(y)[n // 2]
    cut = (y[a] == row) & (y[b] == row) & (np.minimum(p[a, 0], p[b, 0]) >= 0.5)
    cut_mesh = surface.cut_mesh(cut)
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = p[surface.faces.ravel(), :2]
    above = np.zeros(cut_mesh.n_vertices, bool)
    centre = uv[cut_mesh.faces].mean(1)[:, 1] > row
    above[cut_mesh.faces[centre]] = True
    side = above & (uv[:, 1] == row) & (uv[:, 0] > 0.55)
    opened = uv + side[:, None] * [
        0.4 / n,
        1e-10,
    ]  # its vertices lie between those of the other side
    t = 0.7
    turn = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    return cut_mesh, 0.5 * opened @ turn + [0.3, 0.1]


@pytest.mark.parametrize("name", ["f4", "glb", "steps"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_sides_of_a_slit_that_rounding_crosses_draw_back(name: str, mirrored: bool) -> None:
    cut_mesh, uv = slit()
    if mirrored:
        uv = uv * [-1, 1] + [1, 0]
    rounding = ROUNDINGS[name]
    assert overlaps(cut_mesh.faces, rounding(uv), cut_mesh.chart, cut_mesh.edges).crossings.size
    got = store(cut_mesh, uv, np.array([mirrored]), rounding)
    assert got.sound
    found = overlaps(cut_mesh.faces, got.uv, cut_mesh.chart, cut_mesh.edges)
    assert not found.self_overlapping.any()
    assert (signs(got.uv, cut_mesh.faces) == (-1 if mirrored else 1)).all()
    np.testing.assert_array_equal(rounding(got.uv), got.uv)
    assert 0 < got.moved < 40
    assert np.abs(got.uv - uv).max() < 7 * 2.0**-23


def test_what_overlaps_widely_is_told_not_mended() -> None:
    cut_mesh, uv = slit()
    polar = uv - uv.mean(0)
    radius, angle = np.linalg.norm(polar, axis=1), np.arctan2(polar[:, 1], polar[:, 0])
    angle += 25.0 * (1 - radius / radius.max())  # wound up: the slit's sides cut through each other
    wound = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    got = store(cut_mesh, wound, np.array([False]), ROUNDINGS["f4"])
    assert got.fault.tolist() in ([FLIPPED], [OVERLAPPING])
    assert not got.sound


def test_sound_layouts_are_only_rounded() -> None:
    p, f = shapes.delaunay_disk(200, 1)
    surface, _ = repair(from_arrays(p, f).mesh)
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = p[surface.faces.ravel(), :2]
    got = store(cut_mesh, uv, np.array([False]), ROUNDINGS["glb"])
    assert got.sound
    assert (got.moved, got.spoilt) == (0, 0)
    np.testing.assert_array_equal(got.uv, ROUNDINGS["glb"](uv))


def test_needles_are_counted_by_the_vertices_that_moved() -> None:
    p, f = needles.crowd(np.random.default_rng(2), 8, 1e-9)
    surface, _ = repair(from_arrays(np.c_[p * 1e9, np.zeros(len(p))], f).mesh)
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = surface.points[surface.faces.ravel(), :2] / 1e9
    got = store(cut_mesh, uv, np.array([False]), ROUNDINGS["f4"])
    assert got.sound
    assert got.moved == (got.uv != ROUNDINGS["f4"](uv)).any(1).sum() > 0


def two_charts() -> tuple[CutMesh, np.ndarray]:
    """A square with a slit that rounding closes, and one without, side by side."""
    cut_mesh, uv = slit()
    p, f = shapes.grid(12, 12)
    n, m = cut_mesh.n_vertices, len(cut_mesh.faces)
    surface, _ = repair(from_arrays(p, f).mesh)
    other = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    place = np.zeros((other.n_vertices, 2))
    place[other.faces.ravel()] = 0.25 * p[surface.faces.ravel(), :2] + [0.7, 0.7]
    both = CutMesh(
        np.r_[cut_mesh.faces, other.faces + n],
        np.r_[cut_mesh.rest_triangles, other.rest_triangles],
        np.r_[cut_mesh.chart, other.chart + 1],
        np.r_[cut_mesh.edges, other.edges + 3 * m],
    )
    return both, np.r_[uv, place]


def test_a_chart_that_meets_itself_is_repaired_beside_others_as_alone() -> None:
    rounding = ROUNDINGS["f4"]
    both, uv = two_charts()
    got = store(both, uv, np.zeros(2, bool), rounding)
    assert got.sound
    alone, where = slit()
    one = store(alone, where, np.zeros(1, bool), rounding)
    np.testing.assert_array_equal(got.uv[: len(where)], one.uv)
    np.testing.assert_array_equal(got.uv[len(where) :], rounding(uv[len(where) :]))
