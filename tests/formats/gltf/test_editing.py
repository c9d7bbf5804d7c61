"""Uv put into a glTF tree: only what uv touches changes."""

import base64

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read_data
from circparam.formats.looks import Carried, Group, Slot
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    GltfMaker,
    assert_round_trip,
    corners,
    layout_with_seams,
    smooth_layout,
)
from tests.support.gltf_files import full_mesh, tree_of


def test_uv_sets() -> None:
    g = full_mesh()
    document = read_data(g.glb())
    uvmap = layout_with_seams(document)
    with pytest.raises(OptionError, match="overwrite-uv"):
        encode(document, uvmap, "glb", options=WriteOptions(uv_set=0))
    assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=0, overwrite_uv=True))
    second = assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=1))
    assert second.uv_sets == (0, 1)
    np.testing.assert_array_equal(corners(second.uv(0)), corners(document.uv(0)))
    fourth = assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=3))
    assert fourth.uv_sets == (0, 1, 2, 3)  # no gap: the lower ones get the same uv
    for k in (1, 2):
        np.testing.assert_array_equal(corners(fourth.uv(k)), corners(fourth.uv(3)))
    del g.tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    bare = read_data(g.glb())
    filled = assert_round_trip(bare, uvmap, "glb", WriteOptions(uv_set=1))
    assert filled.uv_sets == (0, 1)


@pytest.mark.parametrize(
    ("vertices", "kind"), [(255, "u1"), (256, "u2"), (257, "u2"), (65535, "u2"), (65536, "u4")]
)
def test_the_highest_index_of_a_type_is_never_used(vertices: int, kind: str) -> None:
    """It restarts primitives (glTF 2.0, 3.7.2.1): 255 vertices go into bytes, 256 do not."""
    before = "u1" if vertices < 1000 else "u2"
    points = np.random.default_rng(0).random((vertices - 1, 3)).astype("f4")
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    g = GltfMaker()
    primitive = {
        "attributes": {"POSITION": g.accessor(points)},
        "indices": g.accessor(faces.ravel().astype(before)),
    }
    document = read_data(g.model(primitive).glb())
    # a seam through vertex 0 alone: one vertex more, the last
    uv = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1], [0.5, 0.75]])
    data = encode(document, UVMap(uv, np.array([[0, 1, 2], [4, 2, 3]])), "glb").data
    tree = tree_of(data)
    entry = tree["meshes"][0]["primitives"][0]
    assert tree["accessors"][entry["attributes"]["POSITION"]]["count"] == vertices
    index = tree["accessors"][entry["indices"]]
    code = {"u1": 5121, "u2": 5123, "u4": 5125}[kind]
    assert index["componentType"] == code
    again = read_data(data).mesh.faces
    assert again.max() == vertices - 1 < np.iinfo(kind).max


@pytest.mark.parametrize(
    ("normal", "uv_set", "lost"),
    [
        ({"index": 0}, None, True),
        ({"index": 0, "texCoord": 1}, None, False),
        ({"index": 0, "texCoord": 1}, 1, True),
        ({"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}}, None, False),
        ({"index": 0, "texCoord": 2}, 3, True),  # set 2 is filled on the way
        ({"index": 0}, 1, False),
    ],
)
def test_tangents_go_with_the_uv_set_of_the_normal_map(normal, uv_set, lost):
    g = full_mesh()
    g.tree["materials"][0]["normalTexture"] = normal
    document = read_data(g.glb())
    out = encode(document, smooth_layout(document), "glb", options=WriteOptions(uv_set=uv_set))
    primitive = tree_of(out.data)["meshes"][0]["primitives"][0]
    assert ("TANGENT" not in primitive["attributes"]) == lost
    assert ("TANGENT" not in primitive["targets"][0]) == lost
    assert any("tangents of 1 primitive were" in note for note in out.notes) == lost


def test_extensions_of_textures_that_are_gone_leave_the_lists() -> None:
    """Those of a texture that stays, and all others, keep their places; an empty list goes."""
    g = full_mesh()
    picture = base64.b64encode(b"picture").decode()
    g.tree["images"] = [{"uri": f"data:image/png;base64,{picture}"}]
    g.tree["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}}
    g.tree["materials"] = [{"normalTexture": {"index": 0}, "emissiveTexture": moved}]
    g.tree["extensionsUsed"] = ["KHR_texture_transform", "VENDOR_x", "EXT_texture_webp"]
    g.tree["extensionsRequired"] = ["EXT_texture_webp"]
    document = read_data(g.glb())
    (material,) = document.looks().materials[:1]
    base, normal, emissive = (
        next(slot for slot in material.factors if slot.page == page)
        for page in ("base_color", "normal", "emissive")
    )

    def dressed(*slots: Slot) -> dict:
        pages = {slot.page: b"\x89PNG" for slot in slots}
        factors = {slot: material.factors[slot] for slot in slots}
        carried = Carried(pages, (Group((0,), factors, slots),), 0)
        return tree_of(encode(document.dressed(carried), smooth_layout(document), "glb").data)

    none = dressed(base, normal, emissive)
    assert none["extensionsUsed"] == ["VENDOR_x"]
    assert "extensionsRequired" not in none
    (new,) = none["materials"]
    assert new["pbrMetallicRoughness"].keys() == {"baseColorTexture"}
    assert new.keys() >= {"normalTexture", "emissiveTexture"}
    some = dressed(base, normal)
    assert some["extensionsUsed"] == g.tree["extensionsUsed"]
    assert some["extensionsRequired"] == ["EXT_texture_webp"]
