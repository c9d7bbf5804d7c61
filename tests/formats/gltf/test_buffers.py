"""New data in a tree: nothing piles up, nothing that may be in use is touched, files are whole."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from circparam.formats.document import WriteOptions
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import encode, read, read_data, stored, write
from tests.support.formats_tools import GltfMaker, corners, grid, layout_with_seams, smooth_layout
from tests.support.gltf_files import assert_same_but_uv, chunks, full_mesh


def test_data_that_an_extension_may_use_is_left_alone() -> None:
    g = full_mesh()
    g.tree["extensions"]["VENDOR_x"] = {"attributes": {"ROTATION": 2}}
    document = read_data(g.glb())
    old = document.tree
    new = Tree(encode(document, layout_with_seams(document), "glb").data, document.source)
    for k, accessor in enumerate(old.json["accessors"]):
        assert new.json["accessors"][k] == accessor
        np.testing.assert_array_equal(new.rows(k), old.rows(k))


def test_external_buffers_and_images(tmp_path: Path) -> None:
    g = full_mesh()
    (tmp_path / "a b.bin").write_bytes(g.bin)
    image = b"\x89PNG and more"
    (tmp_path / "t.png").write_bytes(image)
    g.tree["images"] = [{"uri": "t.png"}]
    (tmp_path / "in.gltf").write_bytes(g.gltf("a%20b.bin"))
    document = read(tmp_path / "in.gltf")
    uvmap = smooth_layout(document)
    out = tmp_path / "out"
    out.mkdir()
    bare = write(out / "x.gltf", document, uvmap, options=WriteOptions(copy_assets=False))
    assert sorted(p.name for p in bare.files) == ["a b.bin", "x.bin", "x.gltf"]
    assert sum("t.png" in w and "--no-copy-assets" in w for w in bare.warnings) == 1
    assert (out / "a b.bin").read_bytes() == bytes(g.bin)
    read(out / "x.gltf")  # what it needs is there
    copied = write(out / "y.gltf", document, uvmap)
    assert sorted(p.name for p in copied.files) == ["t.png", "y.bin", "y.gltf"]
    assert not any("t.png" in w for w in copied.warnings)
    assert (out / "t.png").read_bytes() == image
    again = read(out / "y.gltf")
    np.testing.assert_array_equal(corners(again.uv()), corners(stored(uvmap, "gltf")))
    packed = write(out / "z.glb", document, uvmap)
    assert [p.name for p in packed.files] == ["z.glb"]
    alone = read(out / "z.glb")
    np.testing.assert_array_equal(alone.mesh.points[:16], document.mesh.points)
    (entry,) = alone.tree.json["images"]
    assert entry == {"bufferView": entry["bufferView"], "mimeType": "image/png", "name": "t"}
    assert alone.tree.view(entry["bufferView"], "")[0].tobytes() == image
    third = write(out / "y.gltf", again, uvmap, overwrite=True)
    # y.bin held nothing but uv, which are new: it is replaced, not kept beside a second one
    assert sorted(p.name for p in third.files) == ["y.bin", "y.gltf"]
    assert_same_but_uv(document, read(out / "y.gltf"), "TEXCOORD_0", "TANGENT", "0:TANGENT")
    # a seam duplicates vertices: all that the old buffer held stands in the new one, and it stays behind
    cut = write(out / "c.gltf", document, layout_with_seams(document))
    assert sorted(p.name for p in cut.files) == ["c.bin", "c.gltf"]
    assert len(read(out / "c.gltf").tree.json["buffers"]) == 1


def test_bytes_that_a_living_view_shares_stay() -> None:
    """A view that only old uv used lies over one that an image uses: its bytes are not cut out."""
    points, faces = grid(3)
    g = GltfMaker()
    uv = np.random.default_rng(0).random((9, 2)).astype("f4")
    attributes = {"POSITION": g.accessor(points), "TEXCOORD_0": g.accessor(uv)}
    old = dict(g.tree["bufferViews"][1])
    g.tree["bufferViews"].append({**old, "byteOffset": old["byteOffset"] + 8, "byteLength": 10})
    g.tree["images"] = [{"bufferView": 2, "mimeType": "image/png"}]
    document = read_data(g.model(g.primitive(attributes, faces)).glb())
    again = read_data(encode(document, smooth_layout(document), "glb").data)
    for tree in (document.tree, again.tree):
        assert tree.view(2, "image")[0].tobytes() == uv.tobytes()[8:18]


def test_further_chunks_and_extras_are_kept() -> None:
    g = full_mesh()
    data = g.glb()
    rest = struct.pack("<II", 8, 0x1234) + b"whatever"
    data = data[:8] + struct.pack("<I", len(data) + len(rest)) + data[12:] + rest
    document = read_data(data)
    out = encode(document, smooth_layout(document), "glb").data
    assert chunks(out)[2] == (0x1234, b"whatever")


@pytest.mark.parametrize("indent", [None, 1, 4, "\t"])
def test_json_is_indented_as_it_was(indent: int | str | None) -> None:
    g = full_mesh()
    text = json.dumps(json.loads(g.gltf()), indent=indent)
    document = read_data(text.encode())
    out = encode(document, smooth_layout(document), "gltf").data.decode()
    separators = (",", ":") if indent is None else None
    again = json.dumps(json.loads(out), indent=indent, separators=separators, ensure_ascii=False)
    assert out == again + ("" if indent is None else "\n")
