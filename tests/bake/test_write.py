"""Baked images on the disk, alone or inside a GLB."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.bake.bake import Baked, bake_document
from circparam.bake.write import embed, png, write_baked
from circparam.core.files import TEMPORARIES
from circparam.errors import InputError, OptionError, OutputError
from circparam.formats.document import Source, WriteOptions
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.io import read, write
from circparam.mesh.mesh import UVMap
from tests.support.baking import (
    back,
    sample_back,
    some_places,
)
from tests.support.full_disk import STEPS, fill_up


def chunks(data: bytes) -> tuple[dict, bytes]:
    """(JSON, binary chunk) of a GLB, by the layout of the standard."""
    assert data[:4] == b"glTF"
    version, total, size, kind = struct.unpack_from("<II I4s", data, 4)
    assert (version, total, kind, size % 4) == (2, len(data), b"JSON", 0)
    length, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert (kind, 28 + size + length) == (b"BIN\0", total)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def test_glb_with_its_image(files: Path):
    new = read(files / "new.obj")
    baked = bake_document(new, "texture", source=read(files / "old.obj"), size=64)
    paths, _ = write_baked(files / "out.glb", baked, new, 0, "texture")
    data = paths[0].read_bytes()
    assert struct.unpack_from("<I", data, 8)[0] == len(data)
    tree, binary = chunks(data)
    assert tree["buffers"][0]["byteLength"] <= len(binary)
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            material = tree["materials"][primitive["material"]]
            texture = tree["textures"][
                material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
            ]
            view = tree["bufferViews"][tree["images"][texture["source"]]["bufferView"]]
            assert view["byteOffset"] % 4 == 0
            png = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
            assert (np.asarray(Image.open(io.BytesIO(png))) == baked.tiles[0, 0]).all()
    again = read(paths[0])  # and the file can be baked from: its own texture, through its own uv
    layout = again.uv()
    assert layout is not None
    assert len(again.mesh.faces) == len(new.mesh.faces)
    third = bake_document(new, "texture", source=again, size=64)
    assert back(third, files) < 4 / 255


def test_second_uv_set_of_a_glb(files: Path):
    """The old texture through set 0, baked into set 1 of the same file."""
    old, new = read(files / "old.obj"), read(files / "new.obj")
    layout = new.uv()
    before = old.uv()
    assert layout is not None
    assert before is not None
    first = bake_document(new, "texture", source=old, size=64)
    write_baked(files / "one.glb", first, new, 0, "texture")
    one = read(files / "one.glb")
    swapped = UVMap(layout.uv[:, ::-1].copy(), layout.uv_faces[:, :])
    write(files / "two.glb", one, swapped, options=WriteOptions(uv_set=1))
    two = read(files / "two.glb")
    second = bake_document(two, "texture", uv_set=1, size=64)
    given = two.uv(1)
    assert given is not None
    face, bary = some_places(len(two.mesh.faces))
    error = sample_back(second, given, face, bary) - sample_back(first, layout, face, bary)
    assert np.abs(error).mean() < 4 / 255


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
    tree, binary = chunks((files / "first.glb").read_bytes())
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
    for drop in (False, True):
        out, body = chunks(embed(glb_bytes(tree, binary), Source("x.glb"), image, 1, drop))
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
        assert out["buffers"][0]["byteLength"] == len(body)


def test_only_a_glb_takes_an_image():
    with pytest.raises(InputError, match=r"x\.glb"):
        embed(b"no", Source("x.glb"), b"png")


def test_the_ending_says_what_is_written(files: Path):
    baked = Baked({(0, 0): np.zeros((2, 2, 3), np.uint8)}, 1.0)
    with pytest.raises(OptionError, match="bake into an image"):
        write_baked(files / "a.jpg", baked, read(files / "new.obj"), 0, "texture")
    with pytest.raises(InputError, match="no uv set 4"):
        write_baked(files / "a.glb", baked, read(files / "new.obj"), 4, "texture")


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize(("name", "tiles"), [("a.png", 1), ("a.png", 3), ("a.glb", 1)])
def test_a_full_disk_leaves_nothing(
    name: str, tiles: int, step: str, tmp_path: Path, files: Path, monkeypatch: pytest.MonkeyPatch
):
    document = read(files / "new.obj")
    baked = Baked({(k, 0): np.zeros((4, 4, 3), np.uint8) for k in range(tiles)}, 1.0)
    before = sorted(tmp_path.iterdir())
    fill_up(monkeypatch, step)
    with pytest.raises(OutputError, match=r"a(\.1003)?\.(png|glb).*No space left"):
        write_baked(tmp_path / name, baked, document, 0, "texture")
    assert sorted(tmp_path.iterdir()) == before
    assert TEMPORARIES == []
