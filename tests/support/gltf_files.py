"""glTF trees with everything that must be kept, and comparisons of what comes back."""

from __future__ import annotations

import copy
import json
import struct

import numpy as np

from circparam.formats.gltf.buffers import accessor_slots, view_slots
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.gltf.reading import Tree
from tests.support.formats_tools import GltfMaker, grid


def chunks(data: bytes) -> list[tuple[int, bytes]]:
    """(type, body) of every chunk of a GLB; the lengths must be whole words and add up."""
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    out, at = [], 12
    while at < len(data):
        size, kind = struct.unpack_from("<II", data, at)
        assert size % 4 == 0
        out.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    assert at == len(data)
    return out


def tree_of(data: bytes) -> dict:
    """The JSON of a GLB or glTF."""
    return json.loads(chunks(data)[0][1] if data[:4] == b"glTF" else data)


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

    def bare(tree: dict) -> dict:
        meshes = copy.deepcopy(tree["meshes"])
        for p in (p for mesh in meshes for p in mesh["primitives"]):
            for key in ("attributes", "targets", "indices", "mode"):
                p.pop(key, None)
        return {k: v for k, v in tree.items() if k not in skip} | {"meshes": meshes}

    assert bare(resolved(old.tree)) == bare(resolved(new.tree))


def resolved(tree: Tree) -> dict:
    """The JSON of a tree with the bytes in place of the numbers of views and accessors outside the meshes."""
    out = copy.deepcopy(tree.json)
    for image in out.get("images", []):
        if "bufferView" in image:
            image["bufferView"] = tree.view(image["bufferView"], "")[0].tobytes()
    for container, key in accessor_slots({k: v for k, v in out.items() if k != "meshes"}):
        container[key] = tree.rows(container[key]).tobytes()
    return out


def unused_entries(tree: dict) -> tuple[set[int], set[int]]:
    """Accessors and views that nothing in the core of glTF refers to: what validators complain of."""
    accessors = set(range(len(tree.get("accessors", []))))
    views = set(range(len(tree.get("bufferViews", []))))
    used = {c[k] for c, k in accessor_slots(tree)}
    return accessors - used, views - {c[k] for c, k in view_slots(tree)}


def instanced() -> GltfMaker:
    g = small()
    g.tree["meshes"].append(copy.deepcopy(g.tree["meshes"][0]))
    nodes = [
        {"children": [2], "translation": [1, 2, 3], "scale": [2, 2, 2]},
        {"mesh": 1, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
        {"mesh": 0, "rotation": [0, 0, 0.7071067811865476, 0.7071067811865476], "children": [3]},
        {"mesh": 0, "translation": [10, 0, 0]},
    ]
    g.tree |= {"nodes": nodes, "scenes": [{"nodes": [1]}, {"nodes": [0, 1]}], "scene": 1}
    return g


def small() -> GltfMaker:
    points, faces = grid(3)
    g = GltfMaker()
    g.tree["meshes"] = [{"primitives": [g.primitive({"POSITION": g.accessor(points)}, faces)]}]
    return g.scene({"mesh": 0}, {"name": "empty"})
