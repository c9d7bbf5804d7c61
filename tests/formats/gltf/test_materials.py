"""COLOR_0 as sRGB, and the base colour of materials: images in views, data URIs and files."""

import base64
from pathlib import Path

import numpy as np
import pytest

from circparam.bake.write import embed
from circparam.errors import InputError
from circparam.formats.gltf.materials import uv_transform
from circparam.formats.io import encode, read, read_data
from circparam.formats.materials import srgb
from circparam.formats.source import Source
from tests.support.formats_tools import GltfMaker, grid, layout_with_seams
from tests.support.gltf_files import full_mesh, tree_of


def two_primitives(**second: object) -> GltfMaker:
    """Two primitives of one grid; ``second`` goes into the entry of the second."""
    points, faces = grid(3)
    g = GltfMaker()
    attributes = {"POSITION": g.accessor(points)}
    first = g.primitive(attributes, faces[:3])
    return g.model(first, g.primitive(attributes, faces[3:], **second))


def test_colours_are_linear_light_and_white_where_a_mesh_has_none() -> None:
    points, faces = grid(3)
    g = two_primitives()
    linear = np.random.default_rng(0).integers(0, 256, (9, 4)).astype("u1")
    assert read_data(g.glb()).colours() is None
    attributes = {
        "POSITION": g.accessor(points),
        "COLOR_0": g.accessor(linear, normalized=True),
    }
    g.tree["meshes"].append({"primitives": [g.primitive(attributes, faces)]})
    colours = read_data(g.scene({"mesh": 0}, {"mesh": 1}).glb()).colours()
    assert (colours[:8] == 1).all()
    np.testing.assert_allclose(colours[8:], srgb(linear[:, :3] / 255)[faces])


def painted(info: dict, texture: object = None, factor: list[float] | None = None) -> GltfMaker:
    """Two primitives, the second with a base colour from the last of two images."""
    g = two_primitives(material=1)
    pbr = {"baseColorTexture": {"index": 0, **info}, "baseColorFactor": factor or [1, 1, 1, 1]}
    g.tree["materials"] = [{}, {"pbrMetallicRoughness": pbr}]
    g.tree["textures"] = [{"source": 1} if texture is None else texture]
    g.tree["images"] = [
        {"bufferView": g.view(b"zero")},
        {"bufferView": g.view(b"one"), "name": "n"},
    ]
    return g


BASIS = {"KHR_texture_basisu": {"source": 0}}
TRANSFORM = "KHR_texture_transform"


@pytest.mark.parametrize(
    ("texture", "info", "uv_set", "said"),
    [
        ({"source": 1}, {}, 0, None),
        ({"extensions": {"EXT_texture_webp": {"source": 1}}}, {"texCoord": 1}, 1, None),
        ({"source": 1}, {"extensions": {TRANSFORM: {"scale": [2, 2]}}}, 0, None),
        ({"source": 1}, {"texCoord": 2, "extensions": {TRANSFORM: {"texCoord": 1}}}, 1, None),
        ({"extensions": BASIS, "source": 1}, {}, 0, None),
        ({"extensions": BASIS}, {}, 0, "a texture is there by KHR_texture_basisu alone"),
        ({}, {}, 0, ""),
    ],
)
def test_textures_of_primitives(texture: dict, info: dict, uv_set: int, said: str | None) -> None:
    """Some programs leave nothing but a compressed image, which is told."""
    found = read_data(painted(info, texture, [0.5, 0, 1, 1]).glb()).textures()
    np.testing.assert_allclose(found.plain[0], [1, 1, 1])
    np.testing.assert_allclose(found.plain[3], srgb(np.array([0.5, 0, 1])))
    assert found.uv_set == uv_set
    if said is None:
        assert (found.images, found.names, found.notes) == ((b"one",), ("n",), [])
        assert found.face.tolist() == [-1] * 3 + [0] * 5
    else:
        assert [note[: len(said)] for note in found.notes] == [said] * bool(said)


def test_one_image_for_two_materials_and_uv_sets_that_differ() -> None:
    g = painted({"texCoord": 2})
    g.tree["meshes"][0]["primitives"][0]["material"] = 0
    g.tree["materials"][0] = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    found = read_data(g.glb()).textures()
    assert (found.face.tolist(), found.images, found.uv_set) == ([0] * 8, (b"one",), 0)
    assert found.notes == ["textures refer to several uv sets: all are read with set 0"]


def test_images_beside_the_file_and_in_the_json(tmp_path: Path) -> None:
    g = two_primitives(material=0)
    g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    g.tree["textures"] = [{"source": 0}]
    for uri, image, notes in (
        ("data:image/png;base64," + base64.b64encode(b"png").decode(), (b"png",), []),
        ("t.png", (b"file",), []),
        ("no.png", (), ["texture no.png is missing: put it beside the mesh"]),
        (
            "data:image/png;base64,a",
            (),
            ["texture image 0 holds malformed base64: export it again"],
        ),
    ):
        (tmp_path / "t.png").write_bytes(b"file")
        g.tree["images"] = [{"uri": uri}]
        (tmp_path / "m.glb").write_bytes(g.glb())
        found = read(tmp_path / "m.glb").textures()
        assert (found.images, found.notes) == (image, notes)
        assert found.face.tolist() == [-1] * 3 + [len(image) - 1] * 5


def test_white_materials_are_none_and_wrong_ones_an_error() -> None:
    g = two_primitives(material=0)
    g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}}]
    assert read_data(g.glb()).textures() is None
    g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {}}}]
    with pytest.raises(InputError, match="a material is malformed"):
        read_data(g.glb()).textures()


def test_specular_glossiness_of_older_exports() -> None:
    """As Sketchfab writes: the picture is in the extension, and bake takes the extension out."""
    g = full_mesh()
    g.tree["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(b"picture").decode()}]
    g.tree["textures"] = [{"source": 0}]
    gloss = {"diffuseTexture": {"index": 0, "texCoord": 0}, "diffuseFactor": [1, 0, 0, 1]}
    g.tree["materials"] = [{"extensions": {"KHR_materials_pbrSpecularGlossiness": gloss}}]
    document = read_data(g.glb())
    found = document.textures()
    assert found.images == (b"picture",)
    assert (found.face == 0).all()
    np.testing.assert_allclose(found.plain, np.tile([1.0, 0, 0], (len(found.plain), 1)), atol=1e-9)
    assert document.textured_sets() == {0}
    g.tree["extensionsUsed"] = ["KHR_materials_pbrSpecularGlossiness", "VENDOR_x"]
    tree = tree_of(embed(g.glb(), Source("x"), b"new"))
    assert tree["extensionsUsed"] == ["VENDOR_x"]
    (material,) = tree["materials"]
    assert not material.get("extensions")
    assert "baseColorTexture" in material["pbrMetallicRoughness"]


@pytest.mark.parametrize(
    ("source", "named"),
    [(Source("standard input"), "FILE;"), (Source("a b.glb", Path("a b.glb")), "'a b.glb';")],
)
def test_the_cure_of_a_lost_uv_set_can_be_typed(source: Source, named: str) -> None:
    g = full_mesh()
    g.tree["materials"] = [{"normalTexture": {"index": 0}}]
    document = read_data(g.glb(), source)
    (warning,) = encode(document, layout_with_seams(document), "glb").warnings
    assert f"circparam bake --all --source {named}" in warning


def extended(kind: str) -> GltfMaker:
    """A textured mesh with an extension that uses its textures or its materials."""
    g = full_mesh()
    g.tree["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(b"picture").decode()}]
    g.tree["textures"] = [{"source": 0}]
    g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    (primitive,) = g.tree["meshes"][0]["primitives"]
    if kind == "KHR_materials_variants":
        primitive["extensions"] = {kind: {"mappings": [{"material": 0, "variants": [0]}]}}
    if kind == "EXT_mesh_features":
        texture = {"index": 0, "texCoord": 1, "channels": [0]}
        primitive["extensions"] = {kind: {"featureIds": [{"featureCount": 2, "texture": texture}]}}
    if kind == "KHR_animation_pointer":
        pointer = {"pointer": "/materials/0/pbrMetallicRoughness/baseColorFactor"}
        time, value = (g.accessor(np.zeros((2, w), "f4")) for w in (1, 4))
        channel = {"sampler": 0, "target": {"path": "pointer", "extensions": {kind: pointer}}}
        g.tree["animations"] = [
            {"channels": [channel], "samplers": [{"input": time, "output": value}]}
        ]
    return g


@pytest.mark.parametrize(
    "kind", ["KHR_materials_variants", "EXT_mesh_features", "KHR_animation_pointer"]
)
def test_textures_that_an_extension_uses_are_not_carried_away(kind: str) -> None:
    """Nothing in the core refers to them: their numbers would name other textures, or none."""
    with pytest.raises(InputError, match=f"by {kind}.*--lightmap"):
        read_data(extended(kind).glb()).looks()


def test_a_texture_of_an_extension_of_faces_needs_its_uv_set() -> None:
    assert read_data(extended("EXT_mesh_features").glb()).textured_sets() == {0, 1}


def test_texture_transforms_scale_then_turn_then_move() -> None:
    """KHR_texture_transform: axes keep their lengths through the turn, and stay at right angles."""
    turn, scale, offset = 0.4, [2.0, 0.3], [0.1, -5.0]
    found = uv_transform({"rotation": turn, "scale": scale, "offset": offset})
    np.testing.assert_allclose(found[:, 2], offset)
    axes = found[:, :2] / scale
    np.testing.assert_allclose(axes.T @ axes, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(axes[:, 0], [np.cos(turn), -np.sin(turn)])
    np.testing.assert_array_equal(uv_transform({}), [[1, 0, 0], [0, 1, 0]])
