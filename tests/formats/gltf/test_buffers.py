"""New data in a tree: nothing piles up, nothing that may be in use is touched, files are whole."""

import base64
import itertools
import json
import struct
from pathlib import Path

import numpy as np
import pytest

from circparam.formats.document import WriteOptions
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.reading import Tree
from circparam.formats.gltf.unused import accessor_spans
from circparam.formats.io import encode, read, read_data, stored, write
from tests.support.formats_tools import (
    GltfMaker,
    assert_round_trip,
    corners,
    grid,
    layout_with_seams,
    smooth_layout,
)
from tests.support.gltf_files import assert_same_but_uv, full_mesh, tree_of, unused_entries


def test_old_data_does_not_stay_in_the_file() -> None:
    """Written twice with the same seams the file has the same size: nothing piles up."""
    document = read_data(full_mesh(8).glb())
    uvmap = layout_with_seams(document)
    once = encode(document, uvmap, "glb").data
    again = read_data(once)
    twice = encode(again, again.uv(), "glb").data
    sizes = [tree_of(data)["buffers"][0]["byteLength"] for data in (once, twice)]
    assert sizes[0] == sizes[1]
    smaller = encode(document, smooth_layout(document), "glb").data
    assert len(smaller) < len(full_mesh(8).glb())  # tangents are gone, with their bytes


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
    (tmp_path / "t.png").write_bytes(b"png")
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
    assert (out / "t.png").read_bytes() == b"png"
    again = read(out / "y.gltf")
    np.testing.assert_array_equal(corners(again.uv()), corners(stored(uvmap, "gltf")))
    packed = write(out / "z.glb", document, uvmap)
    assert [p.name for p in packed.files] == ["z.glb"]
    np.testing.assert_array_equal(read(out / "z.glb").mesh.points[:16], document.mesh.points)
    third = write(out / "y.gltf", again, uvmap, overwrite=True)
    # y.bin held nothing but uv, which are new: it is replaced, not kept beside a second one
    assert sorted(p.name for p in third.files) == ["y.bin", "y.gltf"]
    assert_same_but_uv(document, read(out / "y.gltf"), "TEXCOORD_0", "TANGENT", "0:TANGENT")
    # a seam duplicates vertices: all that the old buffer held stands in the new one, and it stays behind
    cut = write(out / "c.gltf", document, layout_with_seams(document))
    assert sorted(p.name for p in cut.files) == ["c.bin", "c.gltf"]
    assert len(read(out / "c.gltf").tree.json["buffers"]) == 1


def chunks(data: bytes) -> list[tuple[int, bytes]]:
    """(type, body) of every chunk; the lengths must be whole words and add up."""
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    out, at = [], 12
    while at < len(data):
        size, kind = struct.unpack_from("<II", data, at)
        assert size % 4 == 0
        out.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    assert at == len(data)
    return out


@pytest.mark.parametrize("size", [0, 1, 3, 4, 5])
def test_chunks_are_whole_words(size: int) -> None:
    body = bytes(range(size))
    (json_kind, text), (bin_kind, padded) = chunks(glb_bytes({"é": "x" * size}, body))
    assert (json_kind, bin_kind) == (0x4E4F534A, 0x004E4942)
    assert json.loads(text) == {"é": "x" * size}
    assert text.startswith('{"é":"x'.encode()[: 7 + (size > 0)]), "no escapes, no blanks"
    assert padded.rstrip(b"\0") == body.rstrip(b"\0")
    assert len(padded) - size in range(4)
    assert len(chunks(glb_bytes({}, None))) == 1
    assert chunks(glb_bytes({}, body, struct.pack("<II", 4, 7) + b"rest"))[2] == (7, b"rest")


def views_do_not_overlap(data: bytes) -> None:
    """Views of accessors begin at whole words, inside the buffer, and share no byte."""
    tree = tree_of(data)
    size = tree["buffers"][0]["byteLength"]
    spans = []
    for k in {a["bufferView"] for a in tree["accessors"] if "bufferView" in a}:
        view = tree["bufferViews"][k]
        start = view.get("byteOffset", 0)
        assert start % 4 == 0
        assert start + view["byteLength"] <= size
        spans.append((start, start + view["byteLength"]))
    spans.sort()
    assert all(a[1] <= b[0] for a, b in itertools.pairwise(spans))


@pytest.mark.parametrize("seams", [False, True])
def test_views_stay_apart_and_aligned(seams: bool) -> None:
    document = read_data(full_mesh(5).glb())
    uvmap = layout_with_seams(document) if seams else smooth_layout(document)
    data = encode(document, uvmap, "glb").data
    views_do_not_overlap(data)
    tree = tree_of(data)
    colour = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    assert tree["bufferViews"][colour["bufferView"]]["byteStride"] == 4  # three bytes and one more
    views_do_not_overlap(encode(read_data(data), uvmap, "glb").data)


@pytest.mark.parametrize("seams", [False, True])
def test_views_that_accessors_share_lose_the_bytes_of_those_that_go(seams: bool) -> None:
    """All vertex data in one view, each attribute behind the other, as many exporters write them."""
    points, faces = grid(6)
    rng = np.random.default_rng(0)
    rows = [points, rng.normal(size=points.shape), rng.random((36, 2)), rng.random((36, 4))]
    g = GltfMaker()
    view = g.view(b"".join(r.astype("f4").tobytes() for r in rows))
    names, at, attributes = ("POSITION", "NORMAL", "TEXCOORD_0", "TANGENT"), 0, {}
    for name, r in zip(names, rows, strict=True):
        attributes[name] = g.accessor(r.astype("f4"), view, byteOffset=at)
        at += 4 * r.size
    index = g.accessor(faces.ravel().astype("u2"))
    g.tree["meshes"] = [{"primitives": [{"attributes": attributes, "indices": index}]}]
    document = read_data(g.scene({"mesh": 0}).glb())
    uvmap = layout_with_seams(document) if seams else smooth_layout(document)
    data = encode(document, uvmap, "glb").data
    again = read_data(data)
    assert_same_but_uv(document, again, "TEXCOORD_0", "TANGENT")
    tree = tree_of(data)
    assert unused_entries(tree) == (set(), set())
    spans = [s for a in tree["accessors"] for s in accessor_spans(tree, a)]
    assert sum(s.end - s.start for s in spans) == tree["buffers"][0]["byteLength"]
    views_do_not_overlap(data)


def test_bytes_that_a_living_view_shares_stay() -> None:
    """A view that only old uv used lies over one that an image uses: its bytes are not cut out."""
    points, faces = grid(3)
    g = GltfMaker()
    uv = np.random.default_rng(0).random((9, 2)).astype("f4")
    attributes = {"POSITION": g.accessor(points), "TEXCOORD_0": g.accessor(uv)}
    old = dict(g.tree["bufferViews"][1])
    g.tree["bufferViews"].append({**old, "byteOffset": old["byteOffset"] + 8, "byteLength": 10})
    g.tree["images"] = [{"bufferView": 2, "mimeType": "image/png"}]
    index = g.accessor(faces.ravel().astype("u2"))
    g.tree["meshes"] = [{"primitives": [{"attributes": attributes, "indices": index}]}]
    document = read_data(g.scene({"mesh": 0}).glb())
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


def test_a_gltf_without_buffers_becomes_a_glb() -> None:
    """Positions of zeros need no data; the new uv do."""
    g = GltfMaker()
    g.tree["accessors"] = [{"componentType": 5126, "type": "VEC3", "count": 3}]
    g.tree["bufferViews"] = []
    g.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}}]}]
    g.scene({"mesh": 0})
    document = read_data(json.dumps(g.tree).encode())
    for format in ("glb", "gltf"):
        again = assert_round_trip(document, smooth_layout(document), format)
        assert again.mesh.points.tolist() == [[0, 0, 0]] * 3


@pytest.mark.parametrize("size", [4, 5, 7])
def test_entries_left_over_have_bytes_of_their_own(size: int) -> None:
    """Views of the dropped tangents keep their numbers; an image of any length ends the buffer."""
    g = full_mesh()
    image = bytes(range(1, size + 1))
    g.tree["images"] = [{"bufferView": g.view(image), "mimeType": "image/png"}]
    old = read_data(g.glb())
    data = encode(old, smooth_layout(old), "glb").data
    tree = tree_of(data)
    assert {v["buffer"] for v in tree["bufferViews"]} == {0}
    spans = sorted((v.get("byteOffset", 0), v["byteLength"]) for v in tree["bufferViews"])
    assert all(start % 4 == 0 for start, _ in spans)
    ends = [start + length for start, length in spans]
    assert ends[-1] <= tree["buffers"][0]["byteLength"]
    # the two left over may share four bytes with each other, with nothing else
    apart = sorted(set(spans))
    assert all(a[0] + a[1] <= b[0] for a, b in itertools.pairwise(apart))
    again = read_data(data)
    assert again.tree.view(tree["images"][0]["bufferView"], "")[0].tobytes() == image


@pytest.mark.parametrize("first", [0, 8])
def test_bytes_of_old_uv_go_from_wherever_they_lay(first: int) -> None:
    """Old uv at the very beginning of the buffer, or behind bytes that no view covers and that stay."""
    points, faces = grid(3)
    g = GltfMaker()
    g.bin += b"keepthis"[:first]
    uv = g.accessor(np.zeros((9, 2), "f4"))
    attributes = {"TEXCOORD_0": uv, "POSITION": g.accessor(points)}
    g.bin += b"and this"
    index = g.accessor(faces.ravel().astype("u2"))
    g.tree["meshes"] = [{"primitives": [{"attributes": attributes, "indices": index}]}]
    document = read_data(g.scene({"mesh": 0}).glb())
    sizes, bodies = [], []
    for _ in range(2):
        data = encode(document, smooth_layout(document), "glb").data
        sizes.append(tree_of(data)["buffers"][0]["byteLength"])
        bodies.append(chunks(data)[1][1])
        document = read_data(data)
    assert sizes[0] == sizes[1] == len(g.bin), "as many bytes of uv came as went"
    for body in bodies:
        assert body.startswith(b"keepthis"[:first])
        assert body.count(b"and this") == 1
    np.testing.assert_array_equal(document.mesh.points, points)


def test_a_glb_becomes_a_gltf_with_its_data_beside_it_or_inside(tmp_path: Path) -> None:
    document = read_data(full_mesh(4).glb())
    uvmap = smooth_layout(document)
    assert_round_trip(document, uvmap, "gltf")
    inside = json.loads(encode(document, uvmap, "gltf").data)
    assert [set(b) for b in inside["buffers"]] == [{"uri", "byteLength"}]
    (tmp_path / "in.glb").write_bytes(full_mesh(4).glb())
    files = write(tmp_path / "out.gltf", read(tmp_path / "in.glb"), uvmap).files
    assert files[0].name == "out.gltf", "the file itself first"
    assert sorted(p.name for p in files) == ["out.bin", "out.gltf"]
    beside = json.loads((tmp_path / "out.gltf").read_bytes())
    assert [b["uri"] for b in beside["buffers"]] == ["out.bin"]
    size = (tmp_path / "out.bin").stat().st_size
    assert [b["byteLength"] for b in beside["buffers"]] == [size]
    np.testing.assert_array_equal(read(tmp_path / "out.gltf").mesh.points, document.mesh.points)


def test_several_buffers_become_one_in_a_glb() -> None:
    """Positions in one buffer, normals and indices in another of odd length before it, all data URIs."""
    points, faces = grid(3)
    normals = np.random.default_rng(3).normal(size=(9, 3)).astype("f4")
    index = faces.ravel().astype("u2")
    bodies = [index.tobytes() + b"?", points.tobytes(), b"????" + normals.tobytes()]
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [
            {
                "byteLength": len(body),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(body).decode(),
            }
            for body in bodies
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": index.nbytes},
            {"buffer": 1, "byteLength": points.nbytes},
            {"buffer": 2, "byteOffset": 4, "byteLength": normals.nbytes},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5123, "count": index.size, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": 9, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": 9, "type": "VEC3"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1, "NORMAL": 2}, "indices": 0}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    document = read_data(json.dumps(tree).encode())
    assert document.mesh.faces.tolist() == faces.tolist()
    data = encode(document, smooth_layout(document), "glb").data
    assert len(tree_of(data)["buffers"]) == 1
    assert {v["buffer"] for v in tree_of(data)["bufferViews"]} == {0}
    views_do_not_overlap(data)
    again = read_data(data)
    np.testing.assert_array_equal(again.mesh.points, document.mesh.points)
    np.testing.assert_array_equal(again.mesh.faces, document.mesh.faces)
    entry = tree_of(data)["meshes"][0]["primitives"][0]["attributes"]
    np.testing.assert_array_equal(again.tree.rows(entry["NORMAL"]).view("f4"), normals)
