"""glTF: what accessors say is what is read, and only what uv touches changes in the tree."""

from __future__ import annotations

import copy
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import OptionError
from circparam.formats.document import WriteOptions
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.gltf.reading import Tree
from circparam.formats.io import encode, read, read_data, stored
from circparam.formats.vertex_split import split_vertices
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    GltfMaker,
    assert_round_trip,
    corners,
    corpus_files,
    grid,
    layout_with_seams,
    smooth_layout,
)


def tree_of(data: bytes) -> dict:
    """The JSON of a GLB or glTF."""
    if data[:4] == b"glTF":
        (size,) = struct.unpack_from("<I", data, 12)
        data = data[20 : 20 + size]
    return json.loads(data)


def full_mesh(n: int = 4, *, mode: int = 4, material: bool = True) -> GltfMaker:
    """A grid with normals, tangents, colours, joints, weights, a custom attribute and a morph target."""
    points, faces = grid(n)
    rng = np.random.default_rng(1)
    k = len(points)
    g = GltfMaker()
    attributes = {
        "POSITION": g.accessor(points),
        "NORMAL": g.accessor(rng.normal(size=(k, 3)).astype("f4")),
        "TANGENT": g.accessor(rng.normal(size=(k, 4)).astype("f4")),
        "TEXCOORD_0": g.accessor(rng.random((k, 2)).astype("f4")),
        "COLOR_0": g.accessor(rng.integers(0, 255, (k, 3)).astype("u1"), g.view(
            np.pad(rng.integers(0, 255, (k, 3)), ((0, 0), (0, 1))).astype("u1").tobytes(), byteStride=4
        ), normalized=True),
        "JOINTS_0": g.accessor(rng.integers(0, 9, (k, 4)).astype("u2")),
        "WEIGHTS_0": g.accessor(rng.random((k, 4)).astype("f4")),
        "_CUSTOM": g.accessor(rng.random(k).astype("f4")),
    }  # fmt: skip
    targets = [{"POSITION": g.accessor(points[::-1]), "TANGENT": g.accessor(points * 2)}]
    index = faces.ravel().astype("u2")
    primitive = {
        "attributes": attributes,
        "targets": targets,
        "indices": g.accessor(index, min=[0], max=[k - 1]),
        "extras": {"kept": [1, 2.5, None, "é"]},
    }
    if material:
        primitive["material"] = 0
    g.tree["materials"] = [{"name": "m", "normalTexture": {"index": 0}}]
    g.tree["meshes"] = [{"primitives": [primitive], "weights": [0.5], "name": "mesh"}]
    g.tree |= {"extensionsUsed": ["VENDOR_x"], "extensions": {"VENDOR_x": {"v": 1}}}
    return g.scene({"mesh": 0, "name": "node"}, {"camera": 0})


def corner_values(document: GltfDocument) -> list[dict[str, np.ndarray]]:
    """For every primitive, the raw bytes of every attribute and target at every corner."""
    out = []
    for p in document.primitives:
        pool = document.pools[p.pool]
        named = dict(pool.attributes)
        for k, target in enumerate(pool.targets):
            named |= {f"{k}:{name}": index for name, index in target.items()}
        out.append({n: document.tree.rows(i)[p.triangles] for n, i in named.items()})
    return out


def assert_same_but_uv(old: GltfDocument, new: GltfDocument, *changed: str) -> None:
    """Every attribute of every corner is equal, but for those named (by the beginning of the name)."""
    for a, b in zip(corner_values(old), corner_values(new), strict=True):
        for name in a:
            if not name.startswith(changed):
                np.testing.assert_array_equal(a[name], b[name], name)
    skip = ("accessors", "bufferViews", "buffers", "meshes")
    before, after = old.tree.json, new.tree.json
    assert {k: v for k, v in before.items() if k not in skip} == {
        k: v for k, v in after.items() if k not in skip
    }

    def bare(tree: dict) -> list:
        meshes = copy.deepcopy(tree["meshes"])
        for mesh in meshes:
            for p in mesh["primitives"]:
                for key in ("attributes", "targets", "indices", "mode"):
                    p.pop(key, None)
        return meshes

    assert bare(before) == bare(after)


@pytest.mark.parametrize("container", ["glb", "gltf"])
@pytest.mark.parametrize("seams", [False, True])
def test_everything_but_uv_is_kept(container: str, seams: bool) -> None:
    g = full_mesh()
    data = g.glb() if container == "glb" else g.gltf()
    document = read_data(data)
    assert isinstance(document, GltfDocument)
    assert document.format == container
    uvmap = layout_with_seams(document) if seams else smooth_layout(document)
    for format in ("glb", "gltf"):
        again = assert_round_trip(document, uvmap, format)
        assert isinstance(again, GltfDocument)
        assert_same_but_uv(document, again, "TEXCOORD_0", "TANGENT", "0:TANGENT")
        assert all("TANGENT" not in p.attributes for p in again.pools)
    notes = " ".join(encode(document, uvmap, "glb").notes)
    assert "tangents of 1" in notes
    assert "uv set 0 of the file was replaced" in notes
    assert ("duplicated" in notes) == seams


def test_tangents_stay_where_their_uv_stays() -> None:
    document = read_data(full_mesh().glb())
    for seams in (smooth_layout(document), layout_with_seams(document)):
        again = assert_round_trip(document, seams, "glb", WriteOptions(uv_set=1))
        assert_same_but_uv(document, again, "TEXCOORD_1")  # type: ignore[arg-type]
        assert "TANGENT" in again.pools[0].attributes  # type: ignore[attr-defined]


def test_uv_sets() -> None:
    g = full_mesh()
    document = read_data(g.glb())
    uvmap = layout_with_seams(document)
    with pytest.raises(OptionError, match="overwrite-uv"):
        encode(document, uvmap, "glb", options=WriteOptions(uv_set=0))
    assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=0, overwrite_uv=True))
    second = assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=1))
    assert second.uv_sets == (0, 1)
    np.testing.assert_array_equal(corners(second.uv(0)), corners(document.uv(0)))  # type: ignore[arg-type]
    fourth = assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=3))
    assert fourth.uv_sets == (0, 1, 2, 3)  # no gap: the lower ones get the same uv
    for k in (1, 2):
        np.testing.assert_array_equal(corners(fourth.uv(k)), corners(fourth.uv(3)))  # type: ignore[arg-type]
    del g.tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    bare = read_data(g.glb())
    filled = assert_round_trip(bare, uvmap, "glb", WriteOptions(uv_set=1))
    assert filled.uv_sets == (0, 1)


@settings(max_examples=100)
@given(st.lists(st.tuples(st.floats(-2, 3), st.floats(-2, 3)), min_size=3, max_size=3))
def test_the_flip_of_v_is_exact(values: list[tuple[float, float]]) -> None:
    """Reading what was written and writing it again gives the same bytes: nothing is rounded twice."""
    uvmap = UVMap(np.array(values), np.array([[0, 1, 2]]))
    once = stored(uvmap, "glb")
    np.testing.assert_array_equal(stored(once, "glb").uv, once.uv)
    file = (1.0 - once.uv[:, 1]).astype(np.float32)
    np.testing.assert_array_equal(file, (1.0 - uvmap.uv[:, 1]).astype(np.float32))  # rounded once
    # what lies in the file, turned exactly (negated), has the same differences as what is read
    np.testing.assert_array_equal(np.diff(-file.astype(np.float64)), np.diff(once.uv[:, 1]))


def test_the_first_corner_of_a_vertex_keeps_it() -> None:
    vertex = np.array([0, 1, 2, 2, 1, 3])
    split = split_vertices(4, vertex, np.arange(10.0).reshape(5, 2), np.array([0, 1, 2, 4, 1, 3]))
    assert split.corner.tolist() == [0, 1, 2, 4, 1, 3]
    assert split.source.tolist() == [0, 1, 2, 3, 2]
    assert split.uv.tolist() == [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]]
    assert split.added == 1


def test_a_tiny_triangle_near_the_top_is_not_flipped() -> None:
    """float32 has no number between 1 − 6e-8 and 1; the file holds 1 − v, and there it has many."""
    uv = np.array([[0.0, 1 - 3e-9], [1e-9, 1 - 3e-9], [0.0, 1 - 1e-9]])
    p = stored(UVMap(uv, np.array([[0, 1, 2]])), "glb").uv
    a, b = p[1] - p[0], p[2] - p[0]
    assert a[0] * b[1] - a[1] * b[0] == pytest.approx(2e-18, rel=1e-5)


def test_a_seam_keeps_index_types_small_and_grows_them_when_needed() -> None:
    points, faces = grid(5)
    g = GltfMaker()
    primitive = {
        "attributes": {"POSITION": g.accessor(points)},
        "indices": g.accessor(faces.ravel().astype("u1")),
    }
    g.tree["meshes"] = [{"primitives": [primitive]}]
    document = read_data(g.scene({"mesh": 0}).glb())
    for parts, code in ((2, 5121), (10**6, 5121)):
        out = tree_of(encode(document, layout_with_seams(document, parts=parts), "glb").data)
        index = out["meshes"][0]["primitives"][0]["indices"]
        assert out["accessors"][index]["componentType"] == code
    points, faces = grid(15)
    primitive = {
        "attributes": {"POSITION": g.accessor(points)},
        "indices": g.accessor(faces.ravel().astype("u1")),
    }
    g.tree["meshes"] = [{"primitives": [primitive]}]
    document = read_data(g.glb())
    out = tree_of(encode(document, layout_with_seams(document, parts=10**6), "glb").data)
    assert out["accessors"][out["meshes"][0]["primitives"][0]["indices"]]["componentType"] == 5123


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
    g.tree["meshes"] = [{"primitives": [primitive]}]
    document = read_data(g.scene({"mesh": 0}).glb())
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


@pytest.mark.parametrize("mode", [4, 5, 6])
@pytest.mark.parametrize("indexed", [False, True])
def test_strips_fans_and_unindexed(mode: int, indexed: bool) -> None:
    rng = np.random.default_rng(0)
    order = rng.permutation(9)
    points = rng.normal(size=(9, 3)).astype("f4")
    g = GltfMaker()
    primitive: dict = {"attributes": {"POSITION": g.accessor(points)}, "mode": mode}
    if indexed:
        primitive["indices"] = g.accessor(order.astype("u4"))
    k = order if indexed else np.arange(9)
    g.tree["meshes"] = [{"primitives": [primitive]}]
    document = read_data(g.scene({"mesh": 0}).glb())
    wanted = {
        4: [k[i : i + 3] for i in range(0, 9, 3)],
        5: [k[[i + i % 2, i + 1 - i % 2, i + 2]] for i in range(7)],
        6: [k[[0, i, i + 1]] for i in range(1, 8)],
    }[mode]
    np.testing.assert_array_equal(document.mesh.faces, wanted)
    assert_round_trip(document, smooth_layout(document), "glb")
    kept = tree_of(encode(document, smooth_layout(document), "glb").data)
    assert kept["meshes"][0]["primitives"][0]["mode"] == mode
    uvmap = UVMap(rng.random((3 * len(wanted), 2)), np.arange(3 * len(wanted)).reshape(-1, 3))
    assert_round_trip(document, uvmap, "glb")
    out = encode(document, uvmap, "glb")
    assert any("strip or fan" in note for note in out.notes) == (mode != 4)


def test_normalised_strided_sparse_and_interleaved() -> None:
    points, faces = grid(3)
    k = len(points)
    uv = np.random.default_rng(0).integers(0, 65535, (k, 2)).astype("u2")
    g = GltfMaker()
    inter = np.zeros(k, [("p", "<f4", 3), ("uv", "<u2", 2)])
    inter["p"], inter["uv"] = points, uv
    view = g.view(inter.tobytes(), byteStride=16)
    attributes = {
        "POSITION": g.accessor(points, view),
        "TEXCOORD_0": g.accessor(uv, view, 12, normalized=True),
    }
    moved = points.copy()
    moved[[1, 4]] += 5
    sparse = {
        "count": 2,
        "indices": {"bufferView": g.view(np.array([1, 4], "u1").tobytes()), "componentType": 5121},
        "values": {"bufferView": g.view(moved[[1, 4]].tobytes())},
    }
    other = dict(attributes)
    g.tree["accessors"].append({**g.tree["accessors"][attributes["POSITION"]], "sparse": sparse})
    other["POSITION"] = len(g.tree["accessors"]) - 1
    empty = {"componentType": 5126, "type": "VEC3", "count": k, "sparse": {**sparse}}
    g.tree["accessors"].append(empty)
    index = g.accessor(faces.ravel().astype("u2"))
    zeros = len(g.tree["accessors"]) - 2
    g.tree["meshes"] = [
        {
            "primitives": [
                {"attributes": a, "indices": index, "targets": [{"POSITION": zeros}]}
                for a in (attributes, other)
            ]
        }
    ]
    document = read_data(g.scene({"mesh": 0}).glb())
    np.testing.assert_array_equal(document.mesh.points, np.concatenate([points, moved]))
    read_uv = document.uv()
    assert read_uv is not None
    np.testing.assert_allclose(read_uv.uv[:k, 0], uv[:, 0] / 65535, rtol=0, atol=1e-16)
    for uvmap in (smooth_layout(document), layout_with_seams(document)):
        again = assert_round_trip(document, uvmap, "glb")
        assert_same_but_uv(document, again, "TEXCOORD_0")  # type: ignore[arg-type]


def test_quantised_positions() -> None:
    points = np.array([[0, 0, 0], [127, 0, -128], [0, 127, 5]], "i1")
    g = GltfMaker()
    g.view(b"")
    view = g.view(np.pad(points, ((0, 0), (0, 1))).tobytes(), byteStride=4)
    position = g.accessor(points, view, normalized=True)
    g.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}}]}]
    document = read_data(g.scene({"mesh": 0}).glb())
    np.testing.assert_array_equal(document.mesh.points, np.maximum(points / 127, -1))


def test_primitives_that_share_their_vertices_keep_sharing_them() -> None:
    points, faces = grid(4)
    g = GltfMaker()
    attributes = {"POSITION": g.accessor(points), "NORMAL": g.accessor(points * 2)}
    halves = [g.accessor(f.ravel().astype("u2")) for f in (faces[:7], faces[7:])]
    lines = {"attributes": attributes, "mode": 1, "indices": g.accessor(np.arange(4).astype("u2"))}
    g.tree["meshes"] = [
        {
            "primitives": [
                {"attributes": dict(attributes), "indices": i, "material": k}
                for k, i in enumerate(halves)
            ]
            + [lines]
        }
    ]
    g.tree["materials"] = [{"name": "a"}, {}]
    document = read_data(g.scene({"mesh": 0}).glb())
    assert len(document.mesh.points) == 16
    assert document.mesh.groups is not None
    assert document.mesh.groups.tolist() == [0] * 7 + [1] * 11
    assert document.group_names == ("a", "material_1")
    assert document.labels("primitive").tolist() == [0] * 7 + [1] * 11
    assert set(document.labels("mesh").tolist()) == {0}
    again = assert_round_trip(document, layout_with_seams(document), "glb")
    first, second, third = again.tree.json["meshes"][0]["primitives"]  # type: ignore[attr-defined]
    assert first["attributes"] == second["attributes"]
    assert "TEXCOORD_0" not in third["attributes"]
    assert any("no triangles" in note for note in document.notes)


def instanced() -> GltfMaker:
    points, faces = grid(3)
    g = GltfMaker()
    primitive = {
        "attributes": {"POSITION": g.accessor(points)},
        "indices": g.accessor(faces.ravel().astype("u2")),
    }
    g.tree["meshes"] = [{"primitives": [primitive]}, {"primitives": [copy.deepcopy(primitive)]}]
    nodes = [
        {"children": [2], "translation": [1, 2, 3], "scale": [2, 2, 2]},
        {"mesh": 1, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
        {"mesh": 0, "rotation": [0, 0, 0.7071067811865476, 0.7071067811865476], "children": [3]},
        {"mesh": 0, "translation": [10, 0, 0]},
    ]
    g.tree |= {"nodes": nodes, "scenes": [{"nodes": [1]}, {"nodes": [0, 1]}], "scene": 1}
    return g


def test_nodes_place_meshes_and_a_shared_mesh_is_read_once() -> None:
    points, _ = grid(3)
    document = read_data(instanced().glb())
    assert document.instances == 1
    turned = np.stack([-points[:, 1], points[:, 0], points[:, 2]], 1).astype(float)
    wanted = np.concatenate([turned * 2 + np.array([1, 2, 3]), turned + np.array([5, 0, 0])])
    np.testing.assert_allclose(document.mesh.points, wanted, atol=1e-12)
    assert_round_trip(document, layout_with_seams(document), "glb")


def test_unshared_meshes_get_their_own_uv() -> None:
    data = instanced().glb()
    document = read_data(data, unshare=True)
    assert document.instances == 0
    assert len(document.mesh.faces) == 3 * 8
    again = assert_round_trip(document, layout_with_seams(document), "glb")
    assert again.instances == 0
    assert len(again.mesh.faces) == 3 * 8
    assert tree_of(data)["nodes"][3]["mesh"] == 0  # the bytes given were not edited


def test_equal_points_stay_equal_in_world_space() -> None:
    rng = np.random.default_rng(3)
    base = rng.normal(size=(50, 3)).astype("f4")
    points = np.concatenate([base, base[::-1], base])
    g = GltfMaker()
    g.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": g.accessor(points)}}]}]
    node = {
        "mesh": 0,
        "rotation": [0.1, 0.2, 0.3, 0.9273618495495704],
        "translation": [1e3, 0.1, 7],
    }
    world = read_data(g.scene(node).glb()).mesh.points
    np.testing.assert_array_equal(world[:50], world[100:])
    np.testing.assert_array_equal(world[:50], world[50:100][::-1])


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
    from circparam.formats.io import write

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


@st.composite
def gltf_files(draw: st.DrawFn) -> bytes:
    """Trees with random accessors: types, strides, offsets, sharing, modes."""
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    g = GltfMaker()
    meshes = []
    for _ in range(draw(st.integers(1, 2))):
        primitives = []
        n = draw(st.integers(3, 12))
        points = rng.normal(size=(n, 3)).astype("f4")
        stride = draw(st.sampled_from([0, 12, 16, 20]))
        offset = draw(st.sampled_from([0, 4])) if stride > 12 else 0
        if stride:
            raw = np.zeros((n, stride), "u1")
            raw[:, offset : offset + 12] = points.view("u1").reshape(n, 12)
            position = g.accessor(points, g.view(raw.tobytes(), byteStride=stride), offset)
        else:
            position = g.accessor(points)
        attributes = {"POSITION": position}
        for name in draw(
            st.lists(
                st.sampled_from(["NORMAL", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "_ID"]),
                unique=True,
            )
        ):
            kind = {"NORMAL": ("f4", 3), "COLOR_0": ("u2", 4), "_ID": ("f4", 1)}.get(
                name, ("f4", 2)
            )
            array = rng.integers(0, 9, (n, kind[1])).astype(kind[0])
            attributes[name] = g.accessor(array if kind[1] > 1 else array[:, 0])
        for _ in range(draw(st.integers(1, 3))):
            p: dict = {"attributes": dict(attributes), "mode": draw(st.sampled_from([4, 4, 5, 6]))}
            if draw(st.booleans()):
                size = 3 * draw(st.integers(1, 6))
                p["indices"] = g.accessor(
                    rng.integers(0, n, size).astype(draw(st.sampled_from(["u1", "u2", "u4"])))
                )
            if draw(st.booleans()):
                p["attributes"].pop("TEXCOORD_0", None)
            primitives.append(p)
        meshes.append({"primitives": primitives})
    g.tree["meshes"] = meshes
    g.scene(*({"mesh": k, "translation": [k, 0, 0.5]} for k in range(len(meshes))))
    return g.glb() if draw(st.booleans()) else g.gltf()


@settings(max_examples=80)
@given(gltf_files(), st.integers(0, 9), st.sampled_from([None, 0, 1, 2]))
def test_generated_trees_come_back(data: bytes, seed: int, uv_set: int | None) -> None:
    document = read_data(data)
    options = WriteOptions(uv_set=uv_set, overwrite_uv=uv_set is not None)
    for uvmap in (smooth_layout(document, seed), layout_with_seams(document, seed)):
        for format in ("glb", "gltf"):
            again = assert_round_trip(document, uvmap, format, options)
            assert_same_but_uv(document, again, f"TEXCOORD_{uv_set or 0}")  # type: ignore[arg-type]
            assert again.uv_sets[: (uv_set or 0) + 1] == tuple(range((uv_set or 0) + 1))
    for format in ("obj", "ply"):
        assert_round_trip(document, layout_with_seams(document, seed), format)


@pytest.mark.parametrize("path", corpus_files(".glb", ".gltf"))
@pytest.mark.parametrize("uv_set", [None, 1])
@pytest.mark.parametrize("seams", [False, True])
def test_real_files_keep_everything_else(path: Path, uv_set: int | None, seams: bool) -> None:
    document = read(path)
    uvmap = layout_with_seams(document) if seams else smooth_layout(document)
    again = assert_round_trip(document, uvmap, "glb", WriteOptions(uv_set=uv_set))
    lost = () if uv_set else ("TANGENT",)
    assert_same_but_uv(document, again, f"TEXCOORD_{uv_set or 0}", *lost)  # type: ignore[arg-type]
    for image in document.tree.json.get("images", []):  # type: ignore[attr-defined]
        if "bufferView" in image:
            old = document.tree.view(image["bufferView"], "")[0]  # type: ignore[attr-defined]
            np.testing.assert_array_equal(again.tree.view(image["bufferView"], "")[0], old)  # type: ignore[attr-defined]


@pytest.mark.parametrize("path", corpus_files(".glb"))
def test_real_files_read_as_trimesh_reads_them(path: Path) -> None:
    """trimesh is the independent reader: every geometry at its first node's place."""
    import trimesh

    document = read(path)
    scene = trimesh.load(path, process=False)
    seen, ours = {}, document.mesh.points[document.mesh.faces]
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        seen.setdefault(name, (matrix, scene.geometry[name]))
    theirs = np.concatenate(
        [trimesh.transform_points(g.vertices, m)[g.faces] for m, g in seen.values()]
    )
    assert theirs.shape == ours.shape
    size = np.abs(ours).max()

    def key(t: np.ndarray) -> np.ndarray:
        rows = t.reshape(-1, 9)
        return rows[np.lexsort(np.round(rows / size, 4).T)]

    # a set of triangles: the nodes may come in another order, and one of several instances may differ
    if document.instances == 0:
        np.testing.assert_allclose(key(theirs), key(ours), atol=1e-6 * size)
