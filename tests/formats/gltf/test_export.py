"""A new GLB or glTF from any mesh: one primitive a group, index types, what float32 cannot hold."""

from __future__ import annotations

import numpy as np
import pytest

from circparam.errors import OptionError, OutputError
from circparam.formats.document import WriteOptions
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.io import encode, read_data, write
from circparam.formats.memory import PlainDocument, from_arrays
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.formats_tools import assert_round_trip, grid, layout_with_seams, smooth_layout
from tests.support.gltf_files import tree_of


def grouped(groups: list[int], names: tuple[str, ...], features: tuple[str, ...] = ()):
    points, faces = grid(3)
    mesh = Mesh(points.astype(float), faces.astype(np.int64), groups=np.array(groups))
    return PlainDocument(Source("x"), "off", mesh, features=features, group_names=names)


def test_one_primitive_for_each_group() -> None:
    doc = grouped([2, 0, 2, 0, 0, 0, 0, 0], ("first", "none", ""), ("groups",))
    out = encode(doc, smooth_layout(doc), "glb")
    tree = tree_of(out.data)
    (mesh,) = tree["meshes"]
    assert [tree["accessors"][p["indices"]]["count"] for p in mesh["primitives"]] == [18, 6]
    offsets = [tree["accessors"][p["indices"]]["byteOffset"] for p in mesh["primitives"]]
    assert offsets == [0, 36]
    assert [p["material"] for p in mesh["primitives"]] == [0, 1]
    assert [m["name"] for m in tree["materials"]] == ["first", "group_2"]
    assert out.face_map.tolist() == [1, 3, 4, 5, 6, 7, 0, 2]
    assert out.notes == ["not carried into GLB: groups"]
    assert_round_trip(doc, layout_with_seams(doc), "glb")
    one = encode(grouped([3] * 8, ()), smooth_layout(doc), "glb")
    assert "materials" not in tree_of(one.data)


def test_what_the_tree_says() -> None:
    points, faces = grid(3)
    doc = from_arrays(points, faces)
    out = encode(doc, smooth_layout(doc), "glb")
    tree = tree_of(out.data)
    position = tree["accessors"][0]
    assert (position["type"], position["count"]) == ("VEC3", 9)
    assert position["min"] == points.min(0).tolist()
    assert position["max"] == points.max(0).tolist()
    assert [v.get("target") for v in tree["bufferViews"]] == [34962, 34962, 34963]
    ends = [v["byteOffset"] + v["byteLength"] for v in tree["bufferViews"]]
    assert [v["byteOffset"] for v in tree["bufferViews"]] == [0, *ends[:2]]
    assert tree["buffers"] == [{"byteLength": ends[2]}]
    assert ends[2] == 9 * 12 + 9 * 8 + 24 * 2
    assert tree["nodes"] == [{"mesh": 0, "name": "mesh"}]
    seams = encode(doc, layout_with_seams(doc), "glb")
    added = len(seams.vertex_map) - 9
    assert seams.notes == [f"{added} vertices duplicated along seams, behind the input's"]


@pytest.mark.parametrize(("vertices", "code"), [(65535, 5123), (65536, 5125)])
def test_index_types(vertices: int, code: int) -> None:
    """65535 restarts primitives (glTF 2.0, 3.7.2.1), so 65536 vertices need four bytes."""
    points = np.zeros((vertices, 3))
    points[-3:] = np.eye(3)
    doc = from_arrays(points, np.array([[vertices - 3, vertices - 2, vertices - 1]]))
    data = encode(doc, UVMap(np.eye(3)[:, :2], np.array([[0, 1, 2]])), "glb").data
    assert tree_of(data)["accessors"][2]["componentType"] == code
    assert read_data(data).mesh.faces.max() == vertices - 1


def test_what_float32_cannot_hold() -> None:
    faces = np.array([[0, 1, 2]])
    uvmap = UVMap(np.eye(3)[:, :2], faces)
    points = np.concatenate([np.eye(3), [[1e40, 0, 0], [0.1, 0, 0]]])
    with pytest.raises(OutputError, match="1e\\+40 do not fit in float32"):
        encode(from_arrays(points[[3, 1, 2]], faces), uvmap, "glb")
    assert encode(from_arrays(points[:3], faces), uvmap, "glb").notes == []
    rounded = encode(from_arrays(points[[4, 1, 2]], faces), uvmap, "glb").notes
    assert rounded == ["positions were rounded to float32, all that glTF stores"]
    unused = from_arrays(points[[0, 1, 2, 4]], faces)  # a vertex that no face has may round
    assert encode(unused, uvmap, "glb").notes == []
    with pytest.raises(OptionError, match="uv set 1: a new GLB file"):
        encode(unused, uvmap, "gltf", options=WriteOptions(uv_set=1))


def test_gltf_has_its_buffer_beside_it_or_inside(tmp_path) -> None:
    doc = from_arrays(*grid(3))
    uvmap = layout_with_seams(doc)
    out = encode(doc, uvmap, "gltf")
    assert (out.format, out.extra) == ("gltf", {})
    assert tree_of(out.data)["buffers"][0]["uri"].startswith(
        "data:application/octet-stream;base64,"
    )
    glb = encode(doc, uvmap, "glb")
    assert out.notes == glb.notes
    np.testing.assert_array_equal(out.vertex_map, glb.vertex_map)
    np.testing.assert_array_equal(out.face_map, glb.face_map)
    a, b = read_data(out.data), read_data(glb.data)
    assert isinstance(a, GltfDocument)
    assert isinstance(b, GltfDocument)
    for k in range(3):
        np.testing.assert_array_equal(a.tree.rows(k), b.tree.rows(k))
    written = write(tmp_path / "m.gltf", doc, uvmap)
    assert {p.name for p in written.files} == {"m.gltf", "m.bin"}


@pytest.mark.parametrize("far", [0.0, 10.0, 500.0, 5e6, 1e12, -3e20])
def test_shapes_far_from_the_origin_are_kept(far: float) -> None:
    """A scan in the coordinates of a map came back in steps of half a metre, one further away as a point."""
    points, faces = grid(5)
    points = points / 3 + np.array([far, -far, 2 * far])
    doc = from_arrays(points, faces)
    out = encode(doc, layout_with_seams(doc), "glb")
    again = read_data(out.data).mesh.points[: len(points)]
    step = np.spacing(3 * abs(far))  # of the numbers that were given
    assert np.abs((again - again[0]) - (points - points[0])).max() <= 2e-6 + step
    assert np.abs(again - points).max() <= 2e-6 + step
    node = tree_of(out.data)["nodes"][0]
    assert ("translation" in node) == (abs(far) > 16)
    assert any("far from the origin" in note for note in out.notes) == (abs(far) > 16)
    stored = np.float32(node.get("translation", [0, 0, 0])).astype(float)
    assert stored.tolist() == node.get("translation", [0, 0, 0])  # no viewer rounds it
