"""New data in a tree: nothing piles up, nothing that may be in use is touched, files are whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from circparam.formats.document import WriteOptions
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import encode, read, read_data, stored, write
from tests.support.formats_tools import (
    corners,
    layout_with_seams,
    smooth_layout,
)
from tests.support.gltf_files import (
    assert_same_but_uv,
    full_mesh,
    tree_of,
)


def test_old_data_does_not_stay_in_the_file() -> None:
    """Written twice with the same seams the file has the same size: nothing piles up."""
    document = read_data(full_mesh(8).glb())
    uvmap = layout_with_seams(document)
    once = encode(document, uvmap, "glb").data
    again = read_data(once)
    twice = encode(again, again.uv(), "glb").data  # type: ignore[arg-type]
    sizes = [tree_of(data)["buffers"][0]["byteLength"] for data in (once, twice)]
    assert sizes[0] == sizes[1]
    smaller = encode(document, smooth_layout(document), "glb").data
    assert len(smaller) < len(full_mesh(8).glb())  # tangents are gone, with their bytes


def test_data_that_an_extension_may_use_is_left_alone() -> None:
    g = full_mesh()
    g.tree["extensions"]["VENDOR_x"] = {"attributes": {"ROTATION": 2}}
    document = read_data(g.glb())
    assert isinstance(document, GltfDocument)
    old = document.tree
    new = Tree(encode(document, layout_with_seams(document), "glb").data, document.source)
    for k, accessor in enumerate(old.json["accessors"]):
        assert new.json["accessors"][k] == accessor
        np.testing.assert_array_equal(new.rows(k), old.rows(k))


def test_external_buffers_and_images(tmp_path: Path) -> None:
    g = full_mesh()
    (tmp_path / "a b.bin").write_bytes(g.bin)
    (tmp_path / "t.png").write_bytes(b"png")
    g.tree["images"] = [{"uri": "t.png"}]
    (tmp_path / "in.gltf").write_bytes(g.gltf("a%20b.bin"))
    document = read(tmp_path / "in.gltf")
    uvmap = layout_with_seams(document)
    out = tmp_path / "out"
    out.mkdir()
    plain = write(out / "x.gltf", document, uvmap)
    assert sorted(p.name for p in plain.files) == ["x.bin", "x.gltf"]
    assert sum("--copy-assets" in note for note in plain.notes) == 2
    copied = write(out / "y.gltf", document, uvmap, options=WriteOptions(copy_assets=True))
    assert sorted(p.name for p in copied.files) == ["a b.bin", "t.png", "y.bin", "y.gltf"]
    assert (out / "a b.bin").read_bytes() == bytes(g.bin)
    again = read(out / "y.gltf")
    np.testing.assert_array_equal(corners(again.uv()), corners(stored(uvmap, "gltf")))  # type: ignore[arg-type]
    packed = write(out / "z.glb", document, uvmap)
    assert [p.name for p in packed.files] == ["z.glb"]
    np.testing.assert_array_equal(read(out / "z.glb").mesh.points[:16], document.mesh.points)
    third = write(out / "y.gltf", again, uvmap, overwrite=True)
    assert "y_uv.bin" in [p.name for p in third.files]  # y.bin is still in use
    assert_same_but_uv(document, read(out / "y.gltf"), "TEXCOORD_0", "TANGENT", "0:TANGENT")  # type: ignore[arg-type]
