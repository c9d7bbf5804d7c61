"""Morphs: where the vertices go, how they are lit on the way, and what of the file stays."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.errors import InputError
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.document import GltfDocument, read_gltf
from circparam.formats.io import encode, read, read_data
from circparam.formats.memory import from_arrays
from circparam.formats.source import Source
from circparam.maps.morph import morph
from circparam.maps.surface_map import Places
from circparam.mesh.mesh import Mesh, UVMap
from tests.bake.test_write import glb_parts
from tests.support import shapes
from tests.support.baking import stored, write_obj
from tests.support.bumps import belt
from tests.support.maps import cube_obj, known_map, same_map
from tests.support.validator import validate

Z_UP = {"rotation": [0, 0, 0.6, 0.8], "scale": [1, 2, 0.5], "translation": [1, 2, 3]}


def reopened(data: bytes) -> GltfDocument:
    return read_gltf(data, Source("morph.glb"))


def ends(document: GltfDocument) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) local positions and normals at weight 1, as a viewer adds them up."""
    points, normals = [], []
    for pool in document.pools:
        (target,) = pool.targets
        values = document.tree.values
        points.append(values(pool.attributes["POSITION"]) + values(target["POSITION"]))
        normals.append(values(pool.attributes["NORMAL"]) + values(target["NORMAL"]))
    return np.concatenate(points), np.concatenate(normals)


def test_the_target_is_where_the_map_says(tmp_path: Path):
    a, b = belt(8, 16), belt(14, 28, 0.05, 1.0)
    one, two = stored(tmp_path, "one", *a), stored(tmp_path, "two", *b)
    mapped = known_map(one.mesh, two.mesh)
    made = morph(one, two, mapped)
    document = reopened(made.data)
    points, normals = ends(document)
    corners = document.mesh.faces.ravel()
    wanted = mapped.to_b.of(two.mesh.points, two.mesh.faces)[one.mesh.faces.ravel()]
    assert np.abs(points[corners] - wanted).max() < 1e-6
    start = one.mesh.points[one.mesh.faces.ravel()]
    assert np.abs(document.mesh.points[corners] - start).max() < 1e-6
    # lit as the surface it becomes: the normal of the faces round each corner
    flat = shapes.normals(points[document.mesh.faces])
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    assert (normals[document.mesh.faces] * flat[:, None]).sum(2).min() > 0.7
    assert made.report["moved_max"] == pytest.approx(
        np.linalg.norm(wanted - start, axis=1).max(), rel=1e-9
    )
    assert made.report["reversed"] == 0
    # the other way round the map is the same
    turned = morph(one, two, mapped.turned())
    assert turned.data == made.data


@pytest.mark.parametrize("said", [False, True])
def test_a_pair_with_z_up_stands_upright(tmp_path: Path, said: bool):
    """PLY has z up; files of other formats say so themselves."""
    a, b = belt(8, 16), belt(14, 28, 0.05, 1.0)
    pair = [stored(tmp_path, name, *m) for name, m in (("one", a), ("two", b))]
    if said:
        given = [(d.mesh.points, d.mesh.faces) for d in pair]
        scans = [replace(from_arrays(*m), axis="z") for m in given]
    else:
        none = [UVMap(np.zeros((1, 2)), 0 * d.mesh.faces) for d in pair]
        scans = [read_data(encode(d, uv, "ply").data) for d, uv in zip(pair, none, strict=True)]
    made, flat = (morph(*two, known_map(two[0].mesh, two[1].mesh)) for two in (scans, pair))
    got, kept = reopened(made.data), reopened(flat.data)
    for points, lying in ((got.mesh.points, kept.mesh.points), (ends(got)[0], ends(kept)[0])):
        upright = lying[kept.mesh.faces][:, :, [0, 2, 1]] * [1, 1, -1]
        np.testing.assert_allclose(points[got.mesh.faces], upright, atol=1e-6)


@pytest.mark.parametrize("image", ["skin.png", "skin.bmp"])
def test_uv_and_texture_of_a_stay(tmp_path: Path, image: str):
    """An image in another format becomes a PNG of the same pixels."""
    mesh, layout = belt(4, 8)
    Image.new("RGB", (4, 4), (10, 200, 30)).save(tmp_path / image)
    (tmp_path / "m.mtl").write_text(f"newmtl m\nmap_Kd {image}\n")
    one = stored(tmp_path, "one", mesh, layout, mtl="m.mtl")
    two = stored(tmp_path, "two", Mesh(mesh.points * [1, 2, 3], mesh.faces), layout)
    data = morph(one, two, same_map(mesh)).data
    document = reopened(data)
    uv, found = document.uv(), document.textures()
    assert np.allclose(uv.uv[uv.uv_faces], layout.uv[layout.uv_faces], atol=1e-6)
    (skin,) = found.images
    assert image.endswith("bmp") or skin == (tmp_path / image).read_bytes()
    assert Image.open(io.BytesIO(skin)).format == "PNG"
    assert Image.open(io.BytesIO(skin)).getpixel((0, 0)) == (10, 200, 30)
    assert (found.face == 0).all()
    json.dumps(glb_parts(data)[0], allow_nan=False)


def test_vertex_colours_plain_colours_and_missing_images(tmp_path: Path):
    mesh, layout = belt(4, 8)
    rng = np.random.default_rng(0)
    colours = rng.random((len(mesh.points), 3))
    write_obj(tmp_path / "a.obj", mesh.points, layout, mesh.faces, colours=colours)
    one = read(tmp_path / "a.obj")
    shown = reopened(morph(one, one, same_map(mesh)).data).colours()
    assert np.abs(shown - colours[mesh.faces]).max() < 1e-5
    (tmp_path / "m.mtl").write_text("newmtl m\nKd 0.5 0.25 1\n")
    plain = stored(tmp_path, "plain", mesh, layout, mtl="m.mtl")
    looks = reopened(morph(plain, plain, same_map(mesh)).data).textures()
    assert np.allclose(looks.plain, [0.5, 0.25, 1], atol=1e-4)
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd gone.png\n")
    gone = morph(stored(tmp_path, "gone", mesh, layout, mtl="m.mtl"), one, same_map(mesh))
    assert any("gone.png is missing" in line for line in gone.warnings)
    (tmp_path / "gone.png").write_bytes(b"no image")
    broken = morph(stored(tmp_path, "gone", mesh, layout, mtl="m.mtl"), one, same_map(mesh))
    assert any("cannot be read" in line for line in broken.warnings)


def gltf_tree(mesh: Mesh, layout: UVMap, folder: Path) -> tuple[dict, bytes]:
    return glb_parts(encode(stored(folder, "t", mesh, layout), layout, "glb").data)


def test_a_gltf_tree_keeps_everything_and_moves_in_each_node(tmp_path: Path):
    """Two nodes show the mesh, the first turned and stretched; a primitive of points comes along."""
    tree, binary = gltf_tree(*belt(4, 8), tmp_path)
    tree["nodes"] = [{"mesh": 0, **Z_UP}, {"mesh": 0}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    tree["extras"] = {"mine": 1}
    tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 0})
    one = read_data(glb_bytes(tree, binary))
    two = read_data(glb_bytes({**tree, "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}, binary))
    made = morph(one, two, same_map(one.mesh))
    (tmp_path / "m.glb").write_bytes(made.data)
    document = reopened(made.data)
    assert document.tree.json["extras"] == {"mine": 1}
    assert len(document.tree.json["animations"][0]["channels"]) == 2
    assert document.tree.json["meshes"][0]["extras"]["targetNames"] == ["target"]
    local, normal = ends(document)
    turn = np.array([[0.28, -0.96, 0], [0.96, 0.28, 0], [0, 0, 1.0]])  # of the quaternion in Z_UP
    world = local * [1, 2, 0.5] @ turn.T + [1, 2, 3]
    assert np.abs(world - two.mesh.points).max() < 1e-5
    shaded = normal / [1, 2, 0.5] @ turn.T
    shaded /= np.linalg.norm(shaded, axis=1, keepdims=True)
    radial = two.mesh.points / np.linalg.norm(two.mesh.points, axis=1, keepdims=True)
    assert (shaded * radial).sum(1).min() > 0.9
    with pytest.raises(InputError, match="morph targets of its own"):
        morph(document, two, same_map(document.mesh, two.mesh))
    assert validate(tmp_path / "m.glb") == [set()]


def test_all_primitives_of_shared_vertices_move(tmp_path: Path):
    """Two materials of one mesh use the same vertices: both get the target, and each is drawn by itself."""
    mesh, layout = belt(4, 8)
    tree, binary = gltf_tree(mesh, layout, tmp_path)
    (first,) = tree["meshes"][0]["primitives"]
    whole = tree["accessors"][first["indices"]]
    half = whole["count"] // 6 * 3
    width = {5121: 1, 5123: 2, 5125: 4}[whole["componentType"]]
    rest = {**whole, "count": whole["count"] - half}
    rest["byteOffset"] = whole.get("byteOffset", 0) + half * width
    whole["count"] = half
    tree["accessors"].append(rest)
    tree["meshes"][0]["primitives"].append({**first, "indices": len(tree["accessors"]) - 1})
    one = read_data(glb_bytes(tree, binary))
    assert len(one.mesh.faces) == len(mesh.faces)
    two = read_data(encode(one, one.uv(), "glb").data)
    document = reopened(morph(one, two, same_map(one.mesh)).data)
    entries = document.tree.json["meshes"][0]["primitives"]
    assert len(entries) == 2
    assert entries[0]["targets"] == entries[1]["targets"]
    assert set(entries[0]["targets"][0]) == {"POSITION", "NORMAL"}


def test_faces_that_end_against_the_other_surface_are_counted(tmp_path: Path):
    mesh, layout = belt(6, 12)
    one = stored(tmp_path, "one", mesh, layout)
    same = same_map(mesh)
    # a corner of one face goes to the far end of the opposite side of its neighbours
    corner = int(mesh.faces[30, 0])
    around = np.unique(mesh.faces[(mesh.faces == corner).any(1)])
    goal = int(around[np.linalg.norm(mesh.points[around] - mesh.points[corner], axis=1).argmax()])
    beyond = np.unique(mesh.faces[(mesh.faces == goal).any(1)])
    goal = int(beyond[np.linalg.norm(mesh.points[beyond] - mesh.points[corner], axis=1).argmax()])
    face, weights = same.to_b.face.copy(), same.to_b.weights.copy()
    face[corner], weights[corner] = face[goal], weights[goal]
    made = morph(one, one, replace(same, to_b=Places(face, weights)))
    c = mesh.points.copy()
    c[corner] = mesh.points[goal]
    before, after = (shapes.normals(p[mesh.faces]) for p in (mesh.points, c))
    against = int(((before * after).sum(1) < 0).sum())
    assert against >= 1
    assert made.report["reversed"] == against


@pytest.mark.parametrize("uv", [True, False])
def test_the_validator_finds_nothing_and_the_animation_plays_the_weight(tmp_path: Path, uv: bool):
    a, b = belt(6, 12), belt(8, 16, 0.05)
    one, two = stored(tmp_path, "one", *a), stored(tmp_path, "two", *b)
    one = one if uv else from_arrays(one.mesh.points, one.mesh.faces)
    path = tmp_path / "m.glb"
    path.write_bytes(morph(one, two, known_map(one.mesh, two.mesh), 5).data)
    document = reopened(path.read_bytes())
    assert document.uv_sets == ((0,) if uv else ())
    tree = document.tree
    (animation,) = tree.json["animations"]
    (channel,) = animation["channels"]
    assert channel["target"] == {"node": 0, "path": "weights"}
    sampler = animation["samplers"][channel["sampler"]]
    times, weights = (tree.values(sampler[k])[:, 0] for k in ("input", "output"))
    assert len(times) == len(weights) == 9
    assert weights.max() == weights[4] == 1
    for index, values in (
        (sampler["input"], times),
        (document.pools[0].targets[0]["POSITION"], None),
    ):
        accessor = tree.json["accessors"][index]
        rows = tree.values(index) if values is None else values[:, None]
        assert accessor["min"] == rows.min(0).tolist()
        assert accessor["max"] == rows.max(0).tolist()
    assert tree.json["meshes"][0]["weights"] == [0.0]
    assert validate(path) == [set()]


def test_what_is_refused(tmp_path: Path):
    a, b = belt(4, 8), belt(5, 9)
    one, two = stored(tmp_path, "one", *a), stored(tmp_path, "two", *b)
    with pytest.raises(InputError, match=r"two\.obj: the map was made for another mesh"):
        morph(one, two, same_map(one.mesh))
    over = Mesh(two.mesh.points, two.mesh.faces[:, ::-1])
    turned = stored(tmp_path, "turned", over, UVMap(b[1].uv, b[1].uv_faces[:, ::-1]))
    with pytest.raises(InputError, match="mirrored"):
        morph(one, turned, known_map(one.mesh, turned.mesh))


@pytest.mark.parametrize("kind", ["obj", "glb"])
def test_sharp_edges_of_a_file_stay_sharp(tmp_path: Path, kind: str):
    """Each side of a cube stays flat at both ends of a morph, by vn lines or the normals of a tree."""
    one = cube_obj(tmp_path)
    assert np.allclose(one.normals(), shapes.normals(one.mesh.points[one.mesh.faces])[:, None])
    one = one if kind == "obj" else read_data(encode(one, one.uv(), "glb").data)
    p = one.mesh.points
    sheared = Mesh(p * [1, 2, 1] + p[:, [1, 2, 0]] * [0.5, 0, 0], one.mesh.faces)
    other = stored(tmp_path, "sheared", sheared, one.uv())
    document = reopened(morph(one, other, same_map(one.mesh)).data)
    points, after = ends(document)
    own = document.mesh.faces
    assert np.allclose(
        document.normals(), shapes.normals(document.mesh.points[own])[:, None], atol=1e-5
    )
    assert np.allclose(after[own], shapes.normals(points[own])[:, None], atol=1e-5)
