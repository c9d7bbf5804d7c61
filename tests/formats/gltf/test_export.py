"""A new GLB or glTF from any mesh: one primitive a group, index types, what float32 cannot hold."""

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from circparam.errors import OptionError, OutputError
from circparam.formats.document import Document, WriteOptions
from circparam.formats.gltf.export import OLD_SET
from circparam.formats.io import check_target, encode, read, read_data
from circparam.formats.materials import decode
from circparam.formats.memory import PlainDocument, from_arrays
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    corners,
    grid,
    layout_with_seams,
    smooth_layout,
)
from tests.support.gltf_files import tree_of
from tests.support.ply_files import INDEX, XYZ, build


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
    assert [p["material"] for p in mesh["primitives"]] == [0, 1]
    assert [m["name"] for m in tree["materials"]] == ["first", "group_2"]
    assert out.face_map.tolist() == [1, 3, 4, 5, 6, 7, 0, 2]
    assert out.notes == ["not carried into GLB: groups"]
    assert_round_trip(doc, layout_with_seams(doc), "glb")
    one = encode(grouped([3] * 8, ()), smooth_layout(doc), "glb")
    assert [m["name"] for m in tree_of(one.data)["materials"]] == ["group_3"]


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
    with pytest.raises(OptionError, match="uv set 1: a new GLTF file"):
        encode(unused, uvmap, "gltf", options=WriteOptions(uv_set=1))


@pytest.mark.parametrize("far", [0.0, 10.0, 500.0, 5e6, 1e12, -3e20])
def test_shapes_far_from_the_origin_are_kept(far: float) -> None:
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


@pytest.fixture
def painted(tmp_path: Path) -> Document:
    """Two quads of an OBJ: one with an image, one of glass; normals sharp between them; uv of their own."""
    image = Image.new("RGB", (2, 2), (200, 30, 0))
    image.save(tmp_path / "t.bmp")  # no format that glTF knows
    (tmp_path / "m.mtl").write_text("newmtl skin\nmap_Kd t.bmp\nnewmtl glass\nKd 0 1 0\nd 0.3\n")
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 1\nv 1 1 1\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nvn -2 0 0\nvn 0 0 0\n"
        "usemtl skin\nf 1/1/1 2/2/1 3/3/1 4/4/3\nusemtl glass\nf 2/1/2 5/2/2 6/3/2 3/4/2\n"
    )
    return read(tmp_path / "m.obj")


def test_materials_images_and_normals_of_an_obj_go_along(painted: Document) -> None:
    out = encode(painted, layout_with_seams(painted), "glb")
    tree = tree_of(out.data)
    skin, glass = tree["materials"]
    assert [skin["name"], glass["name"]] == ["skin", "glass"]
    assert {m["pbrMetallicRoughness"]["metallicFactor"] for m in (skin, glass)} == {0}
    assert glass["pbrMetallicRoughness"]["baseColorFactor"] == [0, 1, 0, 0.3]
    assert glass["alphaMode"] == "BLEND"
    assert skin["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0, "texCoord": 1}
    assert out.warnings == [OLD_SET]
    assert out.notes == ["not carried into GLB: polygons", *out.notes[1:]]
    again = read_data(out.data)
    old, kept = painted.uv(), again.uv(1)
    np.testing.assert_array_equal(corners(kept), corners(old)[out.face_map])
    normals, own = again.normals(), painted.normals()
    np.testing.assert_allclose(normals, own[out.face_map], atol=1e-7)
    assert own[0].tolist() == [[0, 0, 1]] * 3  # that without a direction has the one of its face
    found = again.textures()
    assert decode(found.images[0], "t").getpixel((0, 0)) == (200, 30, 0)
    assert_round_trip(painted, layout_with_seams(painted), "glb")


def test_colours_of_vertices_go_along() -> None:
    """sRGB in a PLY, linear light in glTF; colours of faces split vertices where they meet."""
    colour = [f"uchar {c}" for c in ("red", "green", "blue")]
    points: list = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    cells: list = [[[0, 1, 2]], [[0, 2, 3]]]
    paint = [[255, 0, 0], [0, 188, 0], [0, 0, 255], [9, 9, 9]]

    def painted(rows: list) -> list:
        return [[*row, *rgb] for row, rgb in zip(rows, paint, strict=False)]

    for of_vertex in (True, False):
        elements = {"vertex": (XYZ, points), "face": ([INDEX, *colour], painted(cells))}
        if of_vertex:
            elements = {"vertex": (XYZ + colour, painted(points)), "face": ([INDEX], cells)}
        document = read_data(build("ascii", elements))
        out = encode(document, smooth_layout(document), "glb")
        again = read_data(out.data)
        found, own = again.colours(), document.colours()
        np.testing.assert_allclose(found, own[out.face_map], atol=1e-6)
        linear = again.tree.values(again.pools[0].attributes["COLOR_0"])
        assert abs(linear[:, 1].max() - 0.503) < 0.001  # of 188, by IEC 61966-2-1
        assert len(out.vertex_map) == (4 if of_vertex else 6)
        assert (out.warnings, out.notes[1:]) == ([], out.notes[1:])


def test_trimesh_shows_the_uv_of_a_new_file() -> None:
    """It reads uv only where a primitive has a material."""
    doc = from_arrays(*grid(3))
    out = encode(doc, smooth_layout(doc), "glb")
    (loaded,) = trimesh.load(io.BytesIO(out.data), file_type="glb", process=False).geometry.values()
    again = read_data(out.data).uv()
    np.testing.assert_allclose(loaded.visual.uv, again.uv, atol=1e-7)


@pytest.mark.parametrize(("format", "up"), [("stl", "z"), ("ply", "z"), ("obj", "y"), ("off", "y")])
def test_up_is_what_the_format_means(tmp_path: Path, format: str, up: str) -> None:
    path = tmp_path / f"m.{format}"
    trimesh.Trimesh(*grid(3), process=False).export(path)
    document = read(path)
    uvmap = smooth_layout(document)
    as_it_is = document.mesh.points
    turned = as_it_is[:, [0, 2, 1]] * [1, 1, -1]
    for asked in (None, "y", "z"):
        out = encode(document, uvmap, "glb", options=WriteOptions(up=asked))
        got = read_data(out.data).mesh.points
        z = (asked or up) == "z"
        np.testing.assert_array_equal(got, (turned if z else as_it_is).astype("f4"))
        assert any("turned from z up" in note for note in out.notes) == z
        flat = [encode(document, uvmap, kind).data for kind in ("obj", "ply")]
        np.testing.assert_array_equal(*(read_data(data).mesh.points for data in flat))
    for target in ("obj", "ply"):
        with pytest.raises(OptionError, match="--up has no effect here"):
            check_target(document, target, WriteOptions(up="z"))
    check_target(document, "gltf", WriteOptions(up="z"))
    again = read_data(encode(document, uvmap, "glb").data)
    with pytest.raises(OptionError, match="a glTF stays as it stands"):
        check_target(again, "gltf", WriteOptions(up="z"))
