"""Windings that agree, and surfaces with one side only."""

import numpy as np
import pytest

from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from tests.support import shapes
from tests.support.surfaces import check_surface


def test_components_are_oriented_each_by_its_own_majority():
    p, f = shapes.join(shapes.icosphere(1), shapes.icosphere(1))
    f = f.copy()
    f[:80] = f[:80, ::-1]  # all of the first one: nothing disagrees, nothing is turned
    f[81] = f[81][::-1]
    away = np.where(np.arange(len(p))[:, None] < len(p) // 2, 0, [5, 0, 0])
    surface, repairs = repair(Mesh(p + away, f))
    assert np.flatnonzero(surface.reversed_faces).tolist() == [81]
    assert repairs.n_reversed == 1


@pytest.mark.parametrize("polygons", [False, True])
@pytest.mark.parametrize("shape", [shapes.moebius, shapes.klein])
def test_one_sided_surfaces_are_cut_open_between_polygons(shape, polygons):
    p, f = shape()
    quads = np.arange(len(f)) // 2 if polygons else None
    back = np.random.default_rng(4).random(len(f)) < 0.4  # windings differ even inside a polygon
    f = np.where(back[:, None], f[:, [0, 2, 1]], f)
    mesh = Mesh(p, f, polygons=quads)
    surface, repairs = repair(mesh)
    assert repairs.non_orientable == 1
    assert repairs.mobius_edges > 0
    assert repairs.nonmanifold_vertices == 0
    check_surface(mesh, surface, repairs)
    assert surface.cut_mesh(np.zeros(len(surface.edges), bool)).n_charts == 1
    if polygons:
        inside = quads[surface.source[surface.edges // 3]]
        assert int((inside[:, 0] == inside[:, 1]).sum()) == len(f) // 2, "no polygon is cut"
        assert np.array_equal(surface.locked, inside[:, 0] == inside[:, 1])


def test_two_cubes_that_share_an_edge_stay_wound_alike():
    p, f = shapes.cube(1)
    q = np.unique(np.round(p, 9), axis=0)
    step = q.max(0) - q.min(0)
    mesh = Mesh(np.concatenate([p, p + step * [1, 1, 0]]), np.concatenate([f, f + len(p)]))
    surface, repairs = repair(mesh)
    assert repairs.nonmanifold_edges == 1
    assert repairs.n_reversed == 0
    check_surface(mesh, surface, repairs)


def test_a_one_sided_surface_is_not_cut_across_its_flats():
    """A Möbius strip of five triangles, each cut in many that lie in its plane, wound at random."""
    p = np.random.default_rng(2).normal(size=(5, 3))
    k = np.arange(5)
    big = np.stack([k, (k + 1) % 5, (k + 2) % 5], 1)
    points, faces = p, big
    for _ in range(3):
        points, faces = shapes.subdivide(points, faces)
    centre, normal = p[big].mean(1), shapes.normals(p[big])
    off = np.abs(np.einsum("fkx,gx->fkg", points[faces], normal) - (centre * normal).sum(1)).max(1)
    of = off.argmin(1)
    assert off.min(1).max() < 1e-9
    back = np.random.default_rng(3).random(len(faces)) < 0.5
    mesh = Mesh(points, np.where(back[:, None], faces[:, [0, 2, 1]], faces))
    surface, repairs = repair(mesh)
    assert repairs.non_orientable == 1
    inside = of[surface.source[surface.edges // 3]]
    assert int((inside[:, 0] == inside[:, 1]).sum()) == 5 * (3 * 64 - 3 * 8) // 2, "no flat is cut"
    check_surface(mesh, surface, repairs)
