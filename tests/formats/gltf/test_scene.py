"""Nodes place meshes, modes make triangles, shared meshes are read once or copied."""

import numpy as np
import pytest

from circparam.formats.gltf.reading import Tree
from circparam.formats.gltf.scene import node_matrix
from circparam.formats.io import encode, read_data
from circparam.formats.source import Source
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    GltfMaker,
    assert_round_trip,
    grid,
    layout_with_seams,
    refused,
    smooth_layout,
)
from tests.support.gltf_files import instanced, small, tree_of


def facing(corners: np.ndarray) -> np.ndarray:
    """(m, 3) normals of triangles (m, 3, 3), twice their areas long."""
    return np.cross(*np.diff(corners, axis=1).swapaxes(0, 1))


@pytest.mark.parametrize("mode", [4, 5, 6])
@pytest.mark.parametrize("indexed", [False, True])
def test_strips_fans_and_unindexed(mode: int, indexed: bool) -> None:
    """A negative determinant reverses the winding (glTF 2.0, 3.7.4); the index list keeps that of the file."""
    rng = np.random.default_rng(0)
    order = rng.permutation(9)
    g = GltfMaker()
    position = g.accessor(rng.normal(size=(9, 3)).astype("f4"))
    primitive: dict = {"attributes": {"POSITION": position}, "mode": mode}
    if indexed:
        primitive["indices"] = g.accessor(order.astype("u4"))
    k = order if indexed else np.arange(9)
    plain = read_data(g.model(primitive).glb())
    expected = {
        4: [k[i : i + 3] for i in range(0, 9, 3)],
        5: [k[[i + i % 2, i + 1 - i % 2, i + 2]] for i in range(7)],
        6: [k[[0, i, i + 1]] for i in range(1, 8)],
    }[mode]
    np.testing.assert_array_equal(plain.mesh.faces, expected)
    kept = tree_of(encode(plain, smooth_layout(plain), "glb").data)
    assert kept["meshes"][0]["primitives"][0]["mode"] == mode
    g.tree["nodes"][0]["scale"] = [1, -1, 1]
    mirrored = read_data(g.glb())
    before = facing(plain.mesh.corners)
    np.testing.assert_allclose(facing(mirrored.mesh.corners), before * [1, -1, 1], atol=1e-12)
    count = mirrored.mesh.faces.size
    uvmap = UVMap(rng.random((count, 2)), np.arange(count).reshape(-1, 3))
    for document in (plain, mirrored):
        assert_round_trip(document, uvmap, "glb")
        out = encode(document, uvmap, "glb")
        assert any("strip or fan" in note for note in out.notes) == (mode != 4)
        tree = Tree(out.data, Source("a.glb"))
        entry = tree.json["meshes"][0]["primitives"][0]
        points = tree.values(entry["attributes"]["POSITION"])
        index = tree.integers(entry["indices"]) if "indices" in entry else np.arange(len(points))
        written = points[index.reshape(-1, 3)]
        same = np.sort(plain.mesh.corners, axis=1)
        np.testing.assert_array_equal(np.sort(written, axis=1), same)
        np.testing.assert_allclose(facing(written), before)


def test_nodes_place_meshes_and_a_shared_mesh_is_read_once() -> None:
    points, _ = grid(3)
    document = read_data(instanced().glb())
    assert document.instances == 1
    turned = np.stack([-points[:, 1], points[:, 0], points[:, 2]], 1).astype(float)
    expected = np.concatenate([turned * 2 + np.array([1, 2, 3]), turned + np.array([5, 0, 0])])
    np.testing.assert_allclose(document.mesh.points, expected, atol=1e-12)
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


def test_unshare_without_shared_meshes_is_told() -> None:
    says = "--unshare has no effect: no two nodes share a mesh"
    assert read_data(instanced().glb(), unshare=True).warnings == ()
    assert read_data(small().glb(), unshare=True).warnings == (says,)


def test_a_node_names_the_meshes_below_it_at_any_depth() -> None:
    """And no mesh beside it; nodes without a name have none."""
    g = instanced()
    for node, name in zip(g.tree["nodes"], ("root", "other", "", "leaf"), strict=True):
        node |= {"name": name} if name else {}
    document = read_data(g.glb())
    named = document.named("node")
    assert set(named.names) == {("root", 0), ("leaf", 0), ("other", 1)}
    np.testing.assert_array_equal(named.label, document.labels("mesh"))


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


def test_primitives_that_share_their_vertices_keep_sharing_them() -> None:
    points, faces = grid(4)
    g = GltfMaker()
    attributes = {"POSITION": g.accessor(points), "NORMAL": g.accessor(points * 2)}
    halves = [
        g.primitive(attributes, f, material=1 - k) for k, f in enumerate((faces[:7], faces[7:]))
    ]
    lines = g.primitive(attributes, np.arange(4), mode=1)
    g.tree["materials"] = [{"name": "a"}, {}]
    document = read_data(g.model(*halves, lines).glb())
    assert len(document.mesh.points) == 16
    assert document.mesh.groups.tolist() == [0] * 7 + [1] * 11
    assert document.group_names == ("material_1", "a")
    assert document.labels("primitive").tolist() == [0] * 7 + [1] * 11
    assert set(document.labels("mesh").tolist()) == {0}
    again = assert_round_trip(document, layout_with_seams(document), "glb")
    first, second, third = again.tree.json["meshes"][0]["primitives"]
    assert first["attributes"] == second["attributes"]
    assert "TEXCOORD_0" not in third["attributes"]
    assert any("no triangles" in note for note in document.notes)


def test_long_cycles_end() -> None:
    g = small()
    n = 2000
    g.tree["nodes"] = [{"children": [(k + 1) % n]} for k in range(n)]
    refused(g.glb(), "cycle")
    g.tree["nodes"] = [{"children": [k + 1]} for k in range(n - 1)] + [{"mesh": 0}]
    g.tree["scenes"] = [{"nodes": [0]}]
    assert len(read_data(g.glb()).mesh.faces) == 8  # deep, but a tree


def test_few_bytes_do_not_become_many_vertices() -> None:
    """Ten thousand meshes that all show the same big accessor."""
    g = GltfMaker()
    position = g.accessor(np.zeros((20_000, 3), "f4"))
    g.tree["meshes"] = [
        {"primitives": [{"attributes": {"POSITION": position}}]} for _ in range(10_000)
    ]
    refused(g.scene(*({"mesh": k} for k in range(10_000))).glb(), "more vertices than its data")


def test_a_node_moves_then_turns_then_scales() -> None:
    """Column vectors, translation · rotation · scale (glTF 2.0, 3.5.3)."""
    half = np.sqrt(0.5)
    node = {"translation": [1, 2, 3], "rotation": [half, 0, 0, half], "scale": [2, 3, 4]}
    m = node_matrix(node)
    # a quarter turn about x takes y to z and z to −y
    np.testing.assert_allclose(m @ [1, 0, 0, 1], [3, 2, 3, 1], atol=1e-12)
    np.testing.assert_allclose(m @ [0, 1, 0, 1], [1, 2, 6, 1], atol=1e-12)
    np.testing.assert_allclose(m @ [0, 0, 1, 1], [1, -2, 3, 1], atol=1e-12)
    matrix = {"matrix": list(range(16))}
    assert node_matrix(matrix).T.ravel().tolist() == list(range(16))
    np.testing.assert_array_equal(node_matrix({}), np.eye(4))


def test_indices_end_at_the_last_vertex() -> None:
    g = GltfMaker()
    position = g.accessor(np.eye(3, dtype="f4"))
    for last, ok in ((2, True), (3, False)):
        index = g.accessor(np.array([0, 1, last], "u1"))
        primitive = {"attributes": {"POSITION": position}, "indices": index}
        data = g.model(primitive).glb()
        if ok:
            assert read_data(data).mesh.faces.tolist() == [[0, 1, 2]]
        else:
            refused(data, "mesh 0, primitive 0 names vertex 3 of 3")


def test_the_default_scene_comes_first_and_a_root_of_two_is_shown_once() -> None:
    g = instanced()
    g.tree["scenes"] = [{"nodes": [1]}, {"nodes": [0, 1]}]
    for scene, first in ((0, 1), (1, 0)):
        g.tree["scene"] = scene
        document = read_data(g.glb())
        assert document.primitives[0].mesh == first
        assert document.instances == 1
    for key in ("scene", "scenes"):
        g.tree.pop(key)
    assert read_data(g.glb()).instances == 1  # without scenes: every node that has no parent
    g.tree["nodes"] = []
    assert len(read_data(g.glb()).mesh.faces) == 16  # without nodes: every mesh


def test_copies_lie_where_their_nodes_put_them() -> None:
    """The read mesh moved by a copy's transform is what the copy's own node makes of the local points."""
    document = read_data(instanced().glb())
    (copy,) = document.instance_transforms()
    faces, matrix = copy
    assert np.array_equal(document.copies()[0][1], matrix)  # the older name
    apart = read_data(instanced().glb(), unshare=True)
    assert apart.instance_transforms() == []
    where = document.mesh.points[document.mesh.faces[faces]] @ matrix[:3, :3].T + matrix[:3, 3]
    mine = apart.mesh.points[apart.mesh.faces]
    found = [
        k for k in range(0, len(mine), len(faces)) if np.allclose(mine[k : k + len(faces)], where)
    ]
    assert len(found) == 1
    assert document.instances == 1


def test_normals_stay_upright_on_a_mesh_that_a_node_stretches() -> None:
    """They turn by the inverse transpose, not by the matrix of the points."""
    points = np.array([[0, 0, 0], [1, 0, 1], [0, 1, 0]], "f4")
    normals = np.tile(np.float32([-(0.5**0.5), 0, 0.5**0.5]), (3, 1))
    g = GltfMaker()
    attributes = {"POSITION": g.accessor(points), "NORMAL": g.accessor(normals)}
    g.tree["meshes"] = [{"primitives": [{"attributes": attributes}]}]
    node = {"mesh": 0, "scale": [4, 1, 1], "rotation": [0.6, 0, 0, 0.8]}
    document = read_data(g.scene(node).glb())
    a, b, c = document.mesh.points
    flat = np.cross(b - a, c - a)
    found = document.normals()
    np.testing.assert_allclose(found[0], [flat / np.linalg.norm(flat)] * 3, atol=1e-7)


@pytest.mark.parametrize("mirrored_first", [False, True])
def test_of_two_nodes_of_a_mesh_the_plain_one_decides(mirrored_first: bool) -> None:
    g = small()
    nodes = [{"mesh": 0, "translation": [9, 0, 0]}, {"mesh": 0, "scale": [-1, 1, 1]}]
    document = read_data(g.scene(*(nodes[::-1] if mirrored_first else nodes)).glb())
    plain = read_data(small().scene(nodes[0]).glb()).mesh
    np.testing.assert_array_equal(document.mesh.points, plain.points)
    np.testing.assert_array_equal(document.mesh.faces, plain.faces)
    ((_, other),) = document.instance_transforms()
    np.testing.assert_allclose(other @ [9, 0, 0, 1], [0, 0, 0, 1])


@pytest.mark.parametrize("format", ["obj", "ply"])
def test_places_that_another_format_loses_are_told(format: str) -> None:
    """OBJ and PLY have no nodes: a mesh that is shown again would vanish there without a word."""
    shared, copied = (read_data(instanced().glb(), unshare=own) for own in (False, True))
    out = encode(shared, layout_with_seams(shared), format)
    assert any("1 further node are lost; --unshare" in warning for warning in out.warnings)
    assert not encode(copied, layout_with_seams(copied), format).warnings
    assert not encode(shared, layout_with_seams(shared), "glb").warnings


def test_shapes_that_another_format_loses_are_told() -> None:
    """Points, lines and instances on the graphics card are no part of the mesh, and stay in a glTF alone."""
    g = small()
    position = g.tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    places = g.accessor(np.arange(6, dtype="f4").reshape(2, 3))
    g.tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": position}, "mode": 0})
    g.tree["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}
    }
    document = read_data(g.glb())
    (said,) = encode(document, layout_with_seams(document), "obj").warnings
    assert "1 primitive without triangles, the instances of 1 node" in said
    assert not encode(document, layout_with_seams(document), "glb").warnings
