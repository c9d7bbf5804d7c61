"""A layout of the surface back on all faces of the file."""

import numpy as np
import pytest

from circparam.geometry.overlap import signs
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.restore import complete
from tests.support import shapes
from tests.support.surfaces import check_complete, check_surface, layout


def test_degenerate_and_duplicate_faces_are_set_aside_and_get_uv():
    p, f = shapes.grid(4, 4)
    p = np.concatenate([p, [[0.5, 0.0, 0.0]], [[9.0, 9, 9]]])
    extra = [[0, 0, 1], [0, 4, 8], f[2][[1, 2, 0]], f[3][[2, 1, 0]], [17, 17, 17]]
    mesh = Mesh(p, np.concatenate([f, np.array(extra)]))
    surface, repairs = repair(mesh)
    n = len(f)
    assert repairs.degenerate.tolist() == [n, n + 1, n + 4]
    assert repairs.duplicates.tolist() == [n + 2, n + 3]
    assert repairs.duplicate_of.tolist() == [2, 3]
    assert repairs.unreferenced == 1
    check_surface(mesh, surface, repairs)
    got = check_complete(mesh, surface, repairs)
    # the uv of a repeated or collinear face are those of its own points or of one chart
    assert got.uv_faces[n].tolist() == [got.uv_faces[0][0]] * 2 + [got.uv_faces[n][2]]
    assert set(got.uv_faces[n + 2]) == set(got.uv_faces[2])


def test_a_degenerate_face_that_fills_a_gap_of_its_chart_keeps_the_uv_of_its_points():
    """A T-junction: vertex 3 lies on edge 0–1 of the lower triangle; face (0, 3, 1) closes the slit."""
    p = np.array([[0.0, 0, 0], [2, 0, 0], [1, -1, 0], [1, 0, 0], [1, 1, 0]])
    mesh = Mesh(p, np.array([[0, 2, 1], [0, 3, 4], [3, 1, 4], [0, 1, 3]]))
    surface, repairs = repair(mesh)
    assert repairs.degenerate.tolist() == [3]
    # a layout in one chart, the slit open: uv vertices as in space
    uv = np.array([[0.0, 0], [2, 0], [1, -1], [1, 0.2], [1, 1]])
    got = complete(mesh, surface, repairs, uv, surface.faces)
    assert got.uv_faces[3].tolist() == [0, 1, 3]


def test_a_degenerate_face_takes_the_chart_of_its_own_polygon():
    p, f = shapes.grid(3, 2)
    f = np.concatenate([f, [[2, 3, 3]]])
    for polygon in range(4):
        mesh = Mesh(p, f, polygons=np.array([0, 1, 2, 3, polygon]))
        surface, repairs = repair(mesh)
        assert repairs.degenerate.tolist() == [4]
        cut = np.ones(len(surface.edges), bool)  # so no two faces have a uv vertex in common
        uv, uv_faces = layout(surface, cut)
        got = complete(mesh, surface, repairs, uv, uv_faces).uv_faces[4]
        own = dict(zip(surface.faces[polygon].tolist(), uv_faces[polygon].tolist(), strict=True))
        assert set(got.tolist()) <= set(own.values())
        for corner, vertex in enumerate(f[4].tolist()):
            assert vertex not in own or got[corner] == own[vertex]


@pytest.mark.parametrize(
    ("x", "beside", "polygon"),
    [
        ([0.0, 3, 1, 2], [[0, 2, 4], [2, 1, 4], [0, 5, 3], [3, 5, 1]], [[0, 2, 3], [0, 3, 1]]),
        ([0.0, 3, 1, 2], [[0, 2, 4], [2, 1, 4], [0, 5, 3], [3, 5, 1]], [[2, 3, 0], [0, 3, 1]]),
        ([0.0, 3, 5, 7], [[1, 2, 4]], [[0, 1, 4], [0, 2, 1]]),  # a spike beyond a corner
        ([0.0, 3, 5, 7], [[1, 2, 4]], [[0, 1, 4], [0, 3, 2], [0, 2, 1]]),
    ],
)
def test_degenerate_faces_of_a_polygon_agree_at_its_corners(x, beside, polygon):
    """Each corner of a polygon has one uv, wherever the seams are; faces without area cover no uv area."""
    p = np.array([[t, 0.0, 0] for t in x] + [[1.0, 2, 0], [1, 0, 2]])
    labels = np.r_[np.arange(len(beside)), np.full(len(polygon), len(beside))]
    mesh = Mesh(p, np.array(beside + polygon), polygons=labels)
    surface, repairs = repair(mesh)
    for seams in (np.zeros(len(surface.edges), bool), ~surface.locked):
        uv, uv_faces = layout(surface, seams)
        got = complete(mesh, surface, repairs, uv, uv_faces)
        assert (signs(got.uv, got.uv_faces[repairs.degenerate]) == 0).all()
        own = got.uv_faces[len(beside) :]
        for vertex in np.unique(polygon):
            assert len(np.unique(own[np.array(polygon) == vertex])) == 1


def test_a_doubled_triangle_lies_with_its_polygon():
    """Two quads on three common points: a corner has one uv, so the double may not lie in the other quad."""
    p = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.2], [0.9, 0.1, 1]])
    f = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [2, 0, 4]])
    surface, repairs = repair(Mesh(p, f, polygons=np.array([0, 0, 1, 1])))
    assert len(surface.faces) == 4, "each quad keeps both of its triangles"
    cut = np.ones(len(surface.edges), bool) & ~surface.locked
    uv, uv_faces = layout(surface, cut)
    got = complete(Mesh(p, f), surface, repairs, uv, uv_faces)
    quads = [set(got.uv_faces[k].ravel().tolist()) for k in ([0, 1], [2, 3])]
    assert [len(q) for q in quads] == [4, 4]
    assert not quads[0] & quads[1]
    for polygons in (None, np.array([0, 0, 1, 2]), np.array([0, 1, 0, 2])):
        _, repairs = repair(Mesh(p, f, polygons=polygons))
        assert repairs.duplicates.tolist() == [2], "no face of its own ties it to another place"
