"""Accessors, buffers and chunks: what the tree says is what is read, and trees that lie are refused."""

import copy
import json
import struct
from pathlib import Path

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import read, read_data
from circparam.formats.source import Source
from tests.support.formats_tools import GltfMaker, refused
from tests.support.gltf_files import small


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (("accessors", 0, "count"), 4_000_000_000, "promises 4000000000"),
        (("accessors", 1, "count"), 4_000_000_000, "promises 4000000000"),
        (("accessors", 0, "count"), -1, "whole number"),
        (("accessors", 0, "count"), 1e300, "whole number|promises"),
        (("accessors", 0, "count"), "9", "whole number"),
        (("accessors", 0, "componentType"), 1, "component type 1"),
        (("accessors", 0, "type"), "VEC9", "'VEC9' is missing"),
        (("accessors", 0, "type"), "VEC2", "VEC3"),
        (("accessors", 0, "bufferView"), 7, "no entry 7"),
        (("accessors", 0, "bufferView"), -1, "no entry -1"),
        (("accessors", 0, "byteOffset"), 4_000_000_000, "promises"),
        (("accessors", 1, "componentType"), 5126, "list of integers"),
        (("bufferViews", 0, "byteLength"), 4_000_000_000, "beyond its buffer"),
        (("bufferViews", 0, "byteOffset"), 4_000_000_000, "beyond its buffer"),
        (("bufferViews", 0, "byteStride"), 4_000_000_000, "promises"),
        (("bufferViews", 0, "buffer"), 3, "no entry 3"),
        (("buffers", 0, "byteLength"), 4_000_000_000, "promises 4000000000 bytes"),
        (("nodes", 0, "children"), [0], "cycle|two parents"),
        (("nodes", 0, "children"), [1, 1], "two parents"),
        (("nodes", 0, "children"), [9], "no entry 9"),
        (("nodes", 0, "mesh"), 9, "no entry 9"),
        (("nodes", 0, "matrix"), [1, 2], "matrix of a node has 2 numbers, 16 are"),
        (("nodes", 0, "rotation"), [0, 1], "rotation of a node has 2 numbers, 4 are"),
        (("nodes", 0, "scale"), 2, "scale of a node has 1 numbers, 3 are"),
        (("nodes", 0, "translation"), [1, 2, "x"], "malformed"),
        (("scenes", 0, "nodes"), [5], "no entry 5"),
        (("scenes", 0, "nodes"), [1], "no triangles"),
        (("meshes", 0, "primitives"), [], "no triangles"),
        (("meshes", 0, "primitives", 0, "mode"), 0, "no triangles"),
        (("meshes", 0, "primitives", 0, "attributes"), [], "malformed|no triangles"),
        (("meshes", 0, "primitives", 0, "attributes", "POSITION"), 99, "no entry 99"),
        (("meshes",), {}, "not a list|no entry"),
        (("meshes", 0), None, "malformed"),
        (("meshes", 0, "primitives", 0), "text", "another type than glTF allows.*validate IN.glb"),
        (("asset",), {"version": "1.0"}, "version"),
        (("asset",), None, "asset"),
        (("extensionsRequired",), ["KHR_draco_mesh_compression"], "KHR_draco_mesh_compression"),
        (("extensionsRequired",), ["EXT_meshopt_compression"], "EXT_meshopt_compression"),
        (("bufferViews", 0, "extensions"), {"EXT_meshopt_compression": {}}, "EXT_meshopt_compression"),
    ],
)  # fmt: skip
def test_trees_that_lie(path: tuple, value: object, says: str) -> None:
    g = small()
    g.glb()
    tree = copy.deepcopy(g.tree)
    place = tree
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    refused(glb_bytes(tree, bytes(g.bin)), says)


def test_names_and_links_that_lead_out_of_the_folder_are_refused(tmp_path: Path) -> None:
    g = small()
    (tmp_path / "x.bin").write_bytes(g.bin)
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "m.gltf").write_bytes(g.gltf("x.bin"))
    (folder / "n.gltf").write_bytes(g.gltf("..\\x.bin"))
    with pytest.raises(InputError, match=r"n\.gltf.*outside"):
        read(folder / "n.gltf")
    (folder / "x.bin").symlink_to(tmp_path / "x.bin")
    with pytest.raises(InputError, match="outside"):
        read(folder / "m.gltf")
    (folder / "x.bin").unlink()
    with pytest.raises(InputError, match=r"x\.bin.*No such file"):
        read(folder / "m.gltf")
    (folder / "x.bin").write_bytes(g.bin[:-1])
    with pytest.raises(InputError, match="promises"):
        read(folder / "m.gltf")
    (folder / "x.bin").write_bytes(g.bin)
    assert len(read(folder / "m.gltf").mesh.faces) == 8


def test_buffers_from_standard_input_need_a_path() -> None:
    refused(small().gltf("x.bin"), "standard input")


def test_glb_chunks_that_lie() -> None:
    good = bytearray(small().glb())
    assert len(read_data(bytes(good)).mesh.faces) == 8
    for at, value in ((8, 2**32 - 1), (12, 2**32 - 1), (16, 7), (4, 1), (4, 3)):
        bad = good.copy()
        struct.pack_into("<I", bad, at, value)
        refused(bytes(bad), "GLB")
    for end in range(4, len(good)):
        refused(bytes(good[:end]), "", "glb")
    refused(b"glTF" + b"\xff" * 100, "GLB")


def test_normalised_integers_are_fractions() -> None:
    """glTF 2.0, 3.11: c / 127 and no less than −1; c / 255."""
    g = small()
    signed = g.accessor(np.array([-128, -127, 0, 127], "i1"), normalized=True)
    byte = g.accessor(np.array([0, 51, 255], "u1"), normalized=True)
    plain = g.accessor(np.array([0, 51, 255], "u1"))
    real = g.accessor(np.array([2.0, -3.0], "f4"), normalized=True)
    tree = Tree(g.glb(), Source("x"))
    assert tree.values(signed)[:, 0].tolist() == [-1, -1, 0, 1]
    np.testing.assert_allclose(tree.values(byte)[:, 0], [0, 0.2, 1])
    assert tree.values(plain)[:, 0].tolist() == [0, 51, 255]
    assert tree.values(real)[:, 0].tolist() == [2, -3]
    assert tree.integers(plain).tolist() == [0, 51, 255]


def test_accessors_may_end_with_their_view_and_no_later() -> None:
    g = GltfMaker()
    raw = np.arange(10, dtype="u1")
    view = g.view(raw.tobytes(), byteStride=4)
    entry = {"bufferView": view, "componentType": 5121, "type": "VEC2", "byteOffset": 0}
    for count, offset, have in ((3, 0, None), (2, 4, None), (3, 1, 2), (4, 0, 3), (3, 4, 2)):
        g.tree["accessors"] = [{**entry, "count": count, "byteOffset": offset}]
        tree = Tree(g.glb(), Source("x"))
        if have is None:
            expected = [[offset + 4 * k, offset + 4 * k + 1] for k in range(count)]
            assert tree.rows(0).tolist() == expected
        else:
            with pytest.raises(InputError, match=f"promises {count} .* view has {have}"):
                tree.rows(0)
    g.tree["bufferViews"][0]["byteLength"] = 13  # the chunk is padded to 12
    with pytest.raises(InputError, match="reaches beyond its buffer"):
        Tree(g.glb(), Source("x")).view(0, "x")


def test_sparse_values_end_at_the_last_element() -> None:
    g = GltfMaker()
    base = np.array([1.0, 2.0, 3.0], "f4")
    at = g.accessor(base)
    values = {"bufferView": g.view(np.array([9.0], "f4").tobytes())}
    for place, expected in ((0, [9, 2, 3]), (2, [1, 2, 9]), (3, None)):
        indices = {"bufferView": g.view(bytes([place])), "componentType": 5121}
        g.tree["accessors"][at]["sparse"] = {"count": 1, "indices": indices, "values": values}
        tree = Tree(g.glb(), Source("x"))
        if expected is None:
            with pytest.raises(InputError, match="sparse index beyond its 3 elements"):
                tree.rows(at)
        else:
            assert tree.values(at)[:, 0].tolist() == expected


@pytest.mark.parametrize(
    ("uri", "says"),
    [
        ("data:application/octet-stream;base64,AAEC", None),
        ("data:,%00%01%02", None),
        ("data:;base64,AAE", "malformed base64"),
        ("data:;base64,AA", "malformed base64"),
        ("data:;base64,AAE=", "promises 3 bytes and has 2"),
    ],
)
def test_data_uris(uri: str, says: str | None) -> None:
    tree = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 3, "uri": uri}]}
    data = json.dumps(tree).encode()
    if says is None:
        assert Tree(data, Source("x")).buffer(0) == b"\0\1\2"
    else:
        with pytest.raises(InputError, match=says):
            Tree(data, Source("x"))


def test_whole_numbers_may_be_written_as_decimals() -> None:
    g = small()
    g.tree["accessors"][0]["count"] = 9.0
    assert len(read_data(g.glb()).mesh.points) == 9
    for wrong in (9.5, True, -0.5, None):
        g.tree["accessors"][0]["count"] = wrong
        refused(g.glb(), "whole number")


def test_a_json_chunk_may_be_padded_with_zeros() -> None:
    """glTF demands blanks; exporters write zeros, and other readers take both."""
    data = small().glb()
    size = int.from_bytes(data[12:16], "little")
    text = data[20 : 20 + size].rstrip(b" ")
    text += b"\0" * (4 + -len(text) % 4)
    chunks = len(text).to_bytes(4, "little") + data[16:20] + text + data[20 + size :]
    padded = data[:8] + (12 + len(chunks)).to_bytes(4, "little") + chunks
    np.testing.assert_array_equal(read_data(padded).mesh.points, read_data(data).mesh.points)
