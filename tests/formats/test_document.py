"""What every document has in common: layouts that fit, uv sets that may be replaced, notes on what is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.document import (
    Document,
    WriteOptions,
    check_layout,
    check_new_set,
    check_uv_set,
    not_carried,
)
from circparam.formats.materials import Textures
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

MESH = Mesh(np.eye(3), np.array([[0, 1, 2]]), groups=np.array([0]))
UV = np.array([[0.0, 0.0], [1, 0], [0, 1]])


def document(**given: object) -> Document:
    return Document(Source("m.x", Path("m.x")), "obj", MESH, **given)  # type: ignore[arg-type]


def test_a_layout_that_fits_gets_clean_types() -> None:
    out = check_layout(document(), UVMap(UV.astype("f4"), np.array([[0, 1, -7]], "i4")))
    assert out.uv.dtype == np.float64
    assert out.uv_faces.dtype == np.int64
    assert out.uv_faces.tolist() == [[0, 1, -1]]
    assert not np.signbit(check_layout(document(), UVMap(-UV, np.array([[0, 1, 2]]))).uv[0]).any()


def test_layouts_that_do_not_fit() -> None:
    for faces, says in (([[0, 1, 3]], "name uv 3: there are 3"), ([[0, 1, 2]] * 2, "1 faces")):
        with pytest.raises(NoResultError, match=says):
            check_layout(document(), UVMap(UV, np.array(faces)))
    for bad in (np.nan, np.inf):
        uv = UV.copy()
        uv[2, 1] = bad
        with pytest.raises(NoResultError, match="NaN"):
            check_layout(document(), UVMap(uv, np.array([[0, 1, 2]])))
        check_layout(document(), UVMap(uv, np.array([[0, 1, 1]])))  # a row that no corner uses


def test_uv_sets_are_replaced_only_when_asked() -> None:
    two = document(uv_sets=(0, 1))
    assert check_uv_set(document(), WriteOptions(), only_first=True) == (0, "")
    assert check_uv_set(two, WriteOptions(), only_first=True) == (
        0,
        "uv set 0 of the file was replaced",
    )
    assert check_uv_set(two, WriteOptions(uv_set=2), only_first=False) == (2, "")
    number, note = check_uv_set(two, WriteOptions(uv_set=1, overwrite_uv=True), only_first=False)
    assert (number, note) == (1, "uv set 1 of the file was replaced")
    for options, only_first, says in (
        (WriteOptions(uv_set=1), False, "uv set 1 exists"),
        (WriteOptions(uv_set=0), True, "uv set 0 exists"),
        (WriteOptions(uv_set=1), True, "OBJ holds one uv set"),
        (WriteOptions(uv_set=-1), False, "numbered from 0"),
    ):
        with pytest.raises(OptionError, match=says):
            check_uv_set(two, options, only_first=only_first)


def test_a_new_file_gets_one_set() -> None:
    check_new_set(WriteOptions(uv_set=0), "ply")
    check_new_set(WriteOptions(), "ply")
    with pytest.raises(OptionError, match="uv set 1: a new PLY file"):
        check_new_set(WriteOptions(uv_set=1), "ply")


def test_what_is_lost_is_noted() -> None:
    rich = document(features=("polygons", "normals", "groups"))
    assert not_carried(rich, "polygons") == ["not carried into the new format: normals, groups"]
    assert not_carried(rich, "polygons", "normals", "groups") == []


def test_defaults() -> None:
    doc = document()
    assert doc.path == Path("m.x")
    assert doc.instances == 0
    assert doc.uv() is doc.colours() is doc.textures() is None
    assert doc.rewrite(UVMap(UV, MESH.faces), WriteOptions(), "obj", "") is None
    assert doc.labels("primitive").tolist() == doc.labels("scene").tolist() == [0]
    with pytest.raises(OptionError, match="unknown grouping 'x'"):
        doc.labels("x")
    polys = doc.polygons()
    assert (polys.start.tolist(), polys.triangles.tolist()) == ([0, 3], [[0, 1, 2]])


def test_textures_need_the_uv_set_that_they_name() -> None:
    textures = Textures((b"",), ("x",), np.zeros(1, np.int64), np.ones((1, 3)), uv_set=2)
    with pytest.raises(InputError, match=r"m\.x.*uv set 2.*--source"):
        document().texture_layout(textures)


def test_groups_are_the_primitives_and_nothing_else() -> None:
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2], [2, 1, 0]]), groups=np.array([3, 1]))
    grouped = Document(Source("m.x", None), "obj", mesh)
    assert grouped.labels("primitive").tolist() == [3, 1]
    assert grouped.labels("mesh").tolist() == [0, 0]
    assert grouped.labels("scene").tolist() == [0, 0]
    plain = Document(Source("m.x", None), "obj", Mesh(mesh.points, mesh.faces))
    assert plain.labels("primitive").tolist() == [0, 0]
    assert plain.polygons().start.tolist() == [0, 3, 6]
    assert plain.polygons().triangles.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert plain.polygons().owner.tolist() == [0, 1]
