"""COLOR_0 as sRGB, and the base colour of materials: images in views, data URIs and files."""

import base64
from pathlib import Path

import numpy as np
import pytest

from circparam.bake.write import embed
from circparam.errors import InputError
from circparam.formats.io import read, read_data
from circparam.formats.materials import srgb
from circparam.formats.source import Source
from tests.support.formats_tools import GltfMaker, grid
from tests.support.gltf_files import full_mesh, tree_of


def two_primitives(**second: object) -> GltfMaker:
    """Two primitives of one grid; ``second`` goes into the entry of the second."""
    points, faces = grid(3)
    g = GltfMaker()
    attributes = {"POSITION": g.accessor(points)}
    parts = [g.accessor(f.ravel().astype("u2")) for f in (faces[:3], faces[3:])]
    g.tree["meshes"] = [
        {
            "primitives": [
                {"attributes": attributes, "indices": parts[0]},
                {"attributes": dict(attributes), "indices": parts[1], **second},
            ]
        }
    ]
    return g.scene({"mesh": 0})


def test_colours_are_linear_light_and_white_where_a_mesh_has_none() -> None:
    points, faces = grid(3)
    g = two_primitives()
    linear = np.random.default_rng(0).integers(0, 256, (9, 4)).astype("u1")
    assert read_data(g.glb()).colours() is None
    g.tree["meshes"].append(
        {"primitives": [{"attributes": {"POSITION": g.accessor(points),
                                        "COLOR_0": g.accessor(linear, normalized=True)},
                         "indices": g.accessor(faces.ravel().astype("u2"))}]}
    )  # fmt: skip
    colours = read_data(g.scene({"mesh": 0}, {"mesh": 1}).glb()).colours()
    assert (colours[:8] == 1).all()
    np.testing.assert_allclose(colours[8:], srgb(linear[:, :3] / 255)[faces])


def test_factors_and_images_of_primitives() -> None:
    g = two_primitives(material=1)
    texture = {"index": 1, "texCoord": 1}
    g.tree["materials"] = [{}, {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0, 1, 1],
                                                         "baseColorTexture": texture}}]  # fmt: skip
    g.tree["textures"] = [{"source": 0}, {"extensions": {"EXT_texture_webp": {"source": 1}}}]
    g.tree["images"] = [
        {"bufferView": g.view(b"zero")},
        {"bufferView": g.view(b"one"), "name": "n"},
    ]
    found = read_data(g.glb()).textures()
    assert found.face.tolist() == [-1] * 3 + [0] * 5
    np.testing.assert_allclose(found.plain[0], [1, 1, 1])
    np.testing.assert_allclose(found.plain[3], srgb(np.array([0.5, 0, 1])))
    assert (found.images, found.names, found.uv_set, found.notes) == ((b"one",), ("n",), 1, [])


def test_one_image_for_two_materials_and_uv_sets_that_differ() -> None:
    g = two_primitives(material=1)
    g.tree["meshes"][0]["primitives"][0]["material"] = 0
    g.tree["materials"] = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": k}}} for k in (2, 0)
    ]
    g.tree["textures"] = [{"source": 0}]
    g.tree["images"] = [{"bufferView": g.view(b"zero")}]
    found = read_data(g.glb()).textures()
    assert found.face.tolist() == [0] * 8
    assert (found.images, found.names, found.uv_set) == ((b"zero",), ("image 0",), 2)
    assert found.notes == ["textures refer to several uv sets: all are read with set 2"]


def test_images_beside_the_file_and_in_the_json(tmp_path: Path) -> None:
    g = two_primitives(material=0)
    g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    g.tree["textures"] = [{"source": 0}]
    for uri, image, notes in (
        ("data:image/png;base64," + base64.b64encode(b"png").decode(), (b"png",), []),
        ("t.png", (b"file",), []),
        ("no.png", (), ["texture no.png is missing: put it beside the mesh"]),
        ("data:image/png;base64,a", (), ["texture image 0 is malformed"]),
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
    ("texture", "info", "words"),
    [
        ({"source": 0}, {}, None),
        ({"source": 0}, {"texCoord": 0}, None),
        ({"source": 0}, {"scale": [2, 2]}, None),
        ({"extensions": {"KHR_texture_basisu": {"source": 0}}}, {}, "KHR_texture_basisu"),
        ({"extensions": {"KHR_texture_basisu": {"source": 0}}, "source": 0}, {}, None),
        ({}, {}, None),
    ],
)
def test_textures_that_are_not_shown_as_they_are_meant_are_told(
    texture: dict[str, object], info: dict[str, object], words: str | None
) -> None:
    """Some programs leave nothing but a compressed image; what a transform moves is read."""
    g = full_mesh()
    g.tree["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(b"picture").decode()}]
    g.tree["textures"] = [texture]
    extensions = {"extensions": {"KHR_texture_transform": info}} if info else {}
    pbr = {"baseColorTexture": {"index": 0, **extensions}}
    g.tree["materials"] = [{"pbrMetallicRoughness": pbr}, {"pbrMetallicRoughness": pbr}]
    found = read_data(g.glb()).textures()
    notes = [] if found is None else found.notes
    assert len(notes) == (words is not None)
    assert words is None or words in notes[0]


def test_a_transform_may_name_another_uv_set() -> None:
    g = full_mesh()
    g.tree["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(b"picture").decode()}]
    g.tree["textures"] = [{"source": 0}]
    info = {"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    g.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": info}}]
    found = read_data(g.glb()).textures()
    assert (found.uv_set, found.notes) == (1, [])
