"""Baked images on the disk, alone or inside a GLB."""

import base64
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.bake.bake import Across, Baked, bake_document
from circparam.bake.sampling import Closest
from circparam.bake.write import embed, png, write_baked
from circparam.errors import OptionError
from circparam.formats.document import Source, WriteOptions
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.materials import GLOSS
from circparam.formats.gltf.morphing import with_frames
from circparam.formats.gltf.scene import mesh_matrices
from circparam.formats.io import encode, read, read_data
from circparam.formats.memory import from_arrays
from circparam.geometry.shading import unit
from circparam.mesh.mesh import UVMap
from tests.support import shapes
from tests.support.baking import sample_back, some_places, stored
from tests.support.bumps import belt
from tests.support.formats_tools import grid
from tests.support.gltf_files import chunks
from tests.support.maps import cube_obj
from tests.support.ply_files import INDEX, XYZ, build
from tests.support.validator import validate


def glb_parts(data: bytes) -> tuple[dict, bytes]:
    """(JSON, binary chunk) of a GLB."""
    (_, text), (_, body) = chunks(data)
    return json.loads(text), body


def test_png_of_several_tiles(tmp_path: Path, files: Path):
    image = np.zeros((4, 4, 3), np.uint8)
    document = read(files / "new.obj")
    baked = Baked({(0, 0): image, (1, 0): image, (0, 1): image}, 1.0)
    paths, _ = write_baked(tmp_path / "a.png", baked, document, 0, "texture")
    assert [p.name for p in paths] == ["a.1001.png", "a.1002.png", "a.1011.png"]
    with pytest.raises(OptionError, match="several tiles"):
        write_baked(tmp_path / "a.glb", baked, document, 0, "texture")


def test_materials_and_colours_of_a_glb_show_the_image(files: Path):
    """A plain colour gives way to the image, a texture is replaced, vertex colours do not tint it."""
    new = read(files / "new.obj")
    first = bake_document(new, "texture", source=read(files / "old.obj"), size=8)
    write_baked(files / "first.glb", first, new, 0, "texture")
    tree, binary = glb_parts((files / "first.glb").read_bytes())
    primitive = tree["meshes"][0]["primitives"][0]
    own = dict(primitive["attributes"])
    own["COLOR_0"] = own["POSITION"]
    plain = {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0.5}}
    factor = {"baseColorFactor": [0.5, 0.5, 0.5, 1], "baseColorTexture": {"index": 0}}
    tree["materials"] = [plain, {"pbrMetallicRoughness": factor}]
    tree["meshes"][0]["primitives"] = [
        {**primitive, "material": 0, "attributes": dict(own)},
        {**primitive, "material": 1, "attributes": dict(own)},
        {k: v for k, v in primitive.items() if k != "material"} | {"attributes": dict(own)},
        {k: v for k, v in primitive.items() if k != "material"} | {"attributes": dict(own)},
    ]
    image = png(np.full((2, 2, 3), 7, np.uint8))
    for kind, drop in (("texture", False), ("vertex-colors", True)):
        out, body = glb_parts(embed(glb_bytes(tree, binary), Source("x.glb"), image, 1, kind))
        shown = [m["pbrMetallicRoughness"] for m in out["materials"]]
        assert len(shown) == 3  # one new material for both faces without
        assert [m["baseColorTexture"] for m in shown] == [{"index": 1, "texCoord": 1}] * 3
        assert "baseColorFactor" not in shown[0]
        assert shown[0]["metallicFactor"] == 0.5
        assert shown[1]["baseColorFactor"] == [0.5, 0.5, 0.5, 1]
        primitives = out["meshes"][0]["primitives"]
        assert [p["material"] for p in primitives] == [0, 1, 2, 2]
        assert all(("COLOR_0" in p["attributes"]) != drop for p in primitives)
        view = out["bufferViews"][out["images"][out["textures"][1]["source"]]["bufferView"]]
        assert body[view["byteOffset"] :][: view["byteLength"]] == image
        assert body[: len(binary)] == binary
        assert 0 <= len(body) - out["buffers"][0]["byteLength"] < 4  # a chunk is whole words


def gloss_glb(image: int | None, **gloss: object) -> bytes:
    """A triangle whose material is one of specular-glossiness, perhaps with an image of one red texel."""
    new = from_arrays(np.eye(3), [[0, 1, 2]], np.eye(3)[:, :2] * 0.9)
    layout = new.uv()
    tree, binary = glb_parts(encode(new, layout, "glb").data)
    tree["materials"] = [{"name": "g", "extensions": {GLOSS: gloss}}]
    tree["extensionsUsed"] = [GLOSS]
    if image is not None:
        texel = base64.b64encode(png(np.uint8([[[255, 0, 0]]]))).decode()
        tree["images"] = [{"uri": f"data:image/png;base64,{texel}"}]
        tree["textures"] = [{"source": 0}]
        gloss["diffuseTexture"] = {"index": 0}
    return glb_bytes(tree, binary)


@pytest.mark.parametrize("image", [None, 0])
def test_gloss_alpha_and_tint_are_kept(tmp_path: Path, image: int | None):
    data = gloss_glb(image, diffuseFactor=[1, 0.5, 0.5, 0.3], glossinessFactor=0.75)
    new = read_data(data)
    baked = Baked({(0, 0): np.zeros((2, 2, 3), np.uint8)}, 1.0)
    found = new.textures()
    baked = replace(baked, tints=found.tints)
    paths, notes = write_baked(tmp_path / "a.glb", baked, new, 0, "texture")
    tree, _ = glb_parts(paths[0].read_bytes())
    assert "extensionsUsed" not in tree
    pbr = tree["materials"][0]["pbrMetallicRoughness"]
    tinted = [1, 0.5, 0.5, 0.3] if image == 0 else [1, 1, 1, 0.3]  # else it is part of the image
    assert pbr["baseColorFactor"] == tinted
    assert (pbr["metallicFactor"], pbr["roughnessFactor"]) == (0, 0.25)
    (said,) = notes
    assert said.startswith("1 material of specular-glossiness became metallic-roughness")
    _, notes = write_baked(tmp_path / "a.png", baked, new, 0, "texture")
    times = "its texture times 1, 0.5, 0.5 with " if image == 0 else ""
    assert notes == [f"material 'g' shows {times}alpha 0.3, which is not part of the image"]


def test_a_source_in_other_axes_is_turned(tmp_path: Path):
    """A scan with z up, unwrapped into a GLB, gets its own colours back, not those of what lies there."""
    points, faces = grid(5)
    rng = np.random.default_rng(0)
    red = rng.integers(0, 256, len(points))
    colours = [f"uchar {c}" for c in ("red", "green", "blue")]
    vertices = [[*p, r, 0, 0] for p, r in zip(points.tolist(), red.tolist(), strict=True)]
    cells = [[face] for face in faces.tolist()]
    elements = {"vertex": (XYZ + colours, vertices), "face": ([INDEX], cells)}
    scan = read_data(build("ascii", elements))
    layout = UVMap(points[:, :2] / 5 + 0.05, faces)
    turned = read_data(encode(scan, layout, "glb").data)
    kept = read_data(encode(scan, layout, "glb", options=WriteOptions(up="y")).data)
    np.testing.assert_array_equal(turned.mesh.points, points[:, [0, 2, 1]] * [1, 1, -1])
    np.testing.assert_array_equal(kept.mesh.points, points)
    images = []
    for document in (turned, kept):
        baked = bake_document(document, "vertex-colors", source=scan, size=64)
        images.append(baked.tiles[0, 0])
        assert ("turned from z up to y up" in " ".join(baked.notes)) == (document is turned)
    np.testing.assert_array_equal(*images)
    assert np.ptp(images[0][..., 0]) > 200
    other = UVMap(layout.uv, faces[::-1])  # other faces: places are sought
    far = from_arrays(turned.mesh.points, faces[::-1], layout.uv, other.uv_faces)
    glb = read_data(encode(far, other, "glb").data)
    assert any(
        "closest" in n for n in bake_document(glb, "vertex-colors", source=scan, size=8).notes
    )
    normals = bake_document(turned, "normals", source=scan, size=16)
    assert normals.report["missed"] == 0


def test_a_glb_stands_as_the_file_says(tmp_path: Path):
    points, faces = shapes.grid(3, 3)
    flat = replace(from_arrays(points, faces, points[:, :2] / 4), axis="z")
    baked = Baked({(0, 0): np.zeros((4, 4, 3), np.uint8)}, 1.0)
    (path,), _ = write_baked(tmp_path / "out.glb", baked, flat, 0, "texture")
    assert (np.ptp(read(path).mesh.points, axis=0) == 0).tolist() == [False, True, False]


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_glb_with_normals_has_the_frames_they_are_told_in(tmp_path: Path, up: str):
    """What a viewer decodes with the file's own NORMAL and TANGENT is the direction of the source, turned where
    its z is up."""
    low, high = belt(12, 24), belt(40, 80, 0.02, 1.0)
    target, source = stored(tmp_path, "low", *low), stored(tmp_path, "high", *high)
    across = Across("nearest", 0.06)
    baked = bake_document(target, "normals", source=source, across=across, size=256)
    (path,), _ = write_baked(tmp_path / "out.glb", baked, target, 0, "normals", up=up)
    tree, _ = glb_parts(path.read_bytes())
    (primitive,) = tree["meshes"][0]["primitives"]
    material = tree["materials"][primitive["material"]]
    assert "baseColorTexture" not in material["pbrMetallicRoughness"]
    assert tree["textures"][material["normalTexture"]["index"]]["source"] == 0
    document = read(path)
    normal = document.normals()
    tangent = document.tree.values(primitive["attributes"]["TANGENT"])[document.mesh.faces]
    face, bary = some_places(len(low[0].faces), 500)
    x, y, z = (2 * sample_back(baked, document.uv(), face, bary) - 1).T[..., None]
    side = tangent[..., 3:] * np.cross(normal, tangent[..., :3])
    t, b, n = (
        unit(np.einsum("pk,pkc->pc", bary, axis[face])) for axis in (tangent[..., :3], side, normal)
    )
    place = np.einsum("pk,pkc->pc", bary, document.mesh.points[document.mesh.faces[face]])
    found = unit(x * t + y * b + z * n)
    if up == "z":
        place, found = (v[:, [0, 2, 1]] * [1, -1, 1] for v in (place, found))
    there, _, _ = Closest(high[0].points, high[0].faces).find(place * 1.001)
    truth = shapes.normals(high[0].points[high[0].faces])[there]
    cosine = np.clip((found * truth).sum(1), -1, 1)
    assert np.degrees(np.arccos(cosine)).mean() < 4
    if up == "z":
        return
    # the file again as a target: its own normals stay, and the frames are the same
    again = bake_document(document, "normals", source=source, across=across, size=256)
    assert np.abs(again.tiles[0, 0].astype(int) - baked.tiles[0, 0]).mean() < 1
    (second,), _ = write_baked(tmp_path / "again.glb", again, document, 0, "normals")
    assert np.allclose(read(second).normals(), normal)
    assert validate(path) == [set()]
    assert validate(second)[0] <= {"UNUSED_OBJECT"}  # the image that it had stays in the file


def test_frames_are_told_in_the_space_of_their_node(tmp_path: Path):
    """A node that turns and stretches its mesh: the normals of the file are those of the world, turned back."""
    mesh, layout = belt(6, 12)
    document = stored(tmp_path, "a", mesh, layout)
    tree, binary = glb_parts(encode(document, document.uv(), "glb").data)
    tree["nodes"][0] |= {"rotation": [0, 0, 0.6, 0.8], "scale": [1, 2, 3]}
    glb = glb_bytes(tree, binary)
    faces = len(mesh.faces)
    normal = np.broadcast_to(unit(np.array([1.0, 2, 3])), (faces, 3, 3))
    tangent = np.broadcast_to([0.6, 0, 0.8, -1.0], (faces, 3, 4))
    data = with_frames(glb, Source("x.glb"), normal, tangent)
    found = read_data(data)
    assert np.allclose(found.normals(), normal, atol=1e-6)
    local = found.tree.values(found.pools[0].attributes["TANGENT"])
    turn = mesh_matrices(found.tree)[0][:3, :3]
    assert np.allclose(unit(local[:, :3] @ turn.T), [0.6, 0, 0.8], atol=1e-6)
    assert (local[:, 3] == -1).all()


def test_heights_have_no_place_in_a_glb(tmp_path: Path, files: Path):
    baked = Baked({(0, 0): np.zeros((4, 4, 1), np.uint16)}, 1.0)
    document = read(files / "new.obj")
    with pytest.raises(OptionError, match=r"bake them into \.png"):
        write_baked(tmp_path / "a.glb", baked, document, 0, "height")
    write_baked(tmp_path / "a.png", baked, document, 0, "height")
    assert Image.open(tmp_path / "a.png").mode == "I;16"


def test_a_cube_of_an_obj_is_shaded_as_its_vn_say(tmp_path: Path):
    """Sharp edges in the GLB as in the file, so a bake of the cube onto itself is level everywhere."""
    cube = cube_obj(tmp_path)
    baked = bake_document(cube, "normals", source=cube, across=Across("nearest", 0.1), size=64)
    assert np.abs(baked.tiles[0, 0].astype(int) - [128, 128, 255]).max() <= 1
    (path,), notes = write_baked(tmp_path / "c.glb", baked, cube, 0, "normals")
    assert not any("normals" in note for note in notes)
    normals = read(path).normals()
    assert np.allclose(normals, cube.normals())
    assert validate(path) == [set()]
