"""A new OBJ file from any mesh: points, polygons, uv and groups as lines of text."""

import numpy as np

from circparam.formats import Polygons
from circparam.formats.io import encode
from circparam.formats.memory import PlainDocument
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.1, 1e-7]], float)


def document(groups=None, names: tuple[str, ...] = (), features: tuple[str, ...] = ()):
    """A quad, an edge that no triangle has, and a triangle."""
    corners = np.array([0, 1, 2, 3, 0, 1, 1, 4, 2])
    start = np.array([0, 4, 6, 9])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [6, 7, 8]])
    polys = Polygons(corners, start, triangles, np.array([0, 0, 2]))
    mesh = Mesh(POINTS, corners[triangles], polygons=polys.labels, groups=groups)
    return PlainDocument(
        Source("x"), "off", mesh, features=features, group_names=names, polys=polys
    )


UV = np.array([[0.1, 0], [1, 0], [1, 1], [0, 1], [9, 9], [0.5, 1e-20]])
FACES = np.array([[0, 1, 2], [0, 2, 3], [1, 5, 2]])


def test_every_line() -> None:
    """Uv that no corner uses go, a polygon of two corners is no face, digits are the shortest."""
    out = encode(document(), UVMap(UV, FACES), "obj")
    assert out.data.decode().split("\n") == [
        "v 0.0 0.0 0.0", "v 1.0 0.0 0.0", "v 1.0 1.0 0.0", "v 0.0 1.0 0.0", "v 2.0 0.1 1e-07",
        "vt 0.1 0.0", "vt 1.0 0.0", "vt 1.0 1.0", "vt 0.0 1.0", "vt 0.5 1e-20",
        "f 1/1 2/2 3/3 4/4", "f 2/2 5/5 3/3", "",
    ]  # fmt: skip
    assert out.vertex_map.tolist() == [0, 1, 2, 3, 4]
    assert out.face_map.tolist() == [0, 1, 2]
    assert out.notes == []


def test_corners_without_uv() -> None:
    faces = FACES.copy()
    faces[:2] = -1
    data = encode(document(), UVMap(UV, faces), "obj").data
    assert data.endswith(b"vt 1.0 0.0\nvt 1.0 1.0\nvt 0.5 1e-20\nf 1 2 3 4\nf 2/1 5/3 3/2\n")


def test_groups_are_materials() -> None:
    doc = document(np.array([1, 1, 0]), ("", "two  words"), ("groups", "normals"))
    out = encode(doc, UVMap(UV, FACES), "obj")
    assert b"usemtl two_words\nf 1/1 2/2 3/3 4/4\n" in out.data
    assert b"usemtl group_0\nf 2/2 5/5 3/3\n" in out.data
    assert out.notes == ["not carried into OBJ: normals"]
    one = document(np.array([2, 2, 2]), ("a",))
    assert encode(one, UVMap(UV, FACES), "obj").data.count(b"usemtl group_2\n") == 1
