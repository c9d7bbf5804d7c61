"""Vertex data that a glTF tree gets: morph targets, normals, tangents."""

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.document import GltfDocument, read_gltf
from circparam.formats.gltf.reading import Primitive, sound_tree
from circparam.formats.gltf.scene import local_tangents, mesh_matrices, times, unit_rows
from circparam.formats.source import Source


@dataclass(frozen=True, eq=False)
class Target:
    """Places to which vertices move, in the world, as (n, 3) of ``Document.mesh.points``.

    normals: before and after, unit. times, weights: the key frames of its animation, seconds from 0 on and
    0..1. name: of the target and its animation.
    """

    points: FloatArray
    normals: tuple[FloatArray, FloatArray]
    times: FloatArray
    weights: FloatArray
    name: str


def with_morph(document: GltfDocument, target: Target) -> bytes:
    """The document as GLB with a morph target on all its triangles, and an animation of its weight.

    Meshes that nodes show several times move alike in each place. Raises InputError if it has morph targets.
    """
    tree = document.tree
    edit = Packing(tree)
    with sound_tree(document.source):
        if any(p.get("targets") for mesh in edit.json["meshes"] for p in mesh["primitives"]):
            raise document.source.error(
                "it has morph targets of its own: take them out, or give the meshes the other way round"
            )
        matrix = mesh_matrices(tree)
        for users in document.users():
            _pool(edit, document, users, target, matrix[users[0].mesh])
        meshes = {p.mesh for p in document.primitives}
        for mesh in (edit.json["meshes"][k] for k in meshes):
            extras = mesh.get("extras")
            own = extras if isinstance(extras, dict) else {}
            mesh |= {"weights": [0.0], "extras": {**own, "targetNames": [target.name]}}
            for p in mesh["primitives"]:  # what has no triangles gets a target that moves nothing
                if "targets" not in p and "POSITION" in p["attributes"]:
                    count = edit.json["accessors"][p["attributes"]["POSITION"]]["count"]
                    still = {"componentType": 5126, "type": "VEC3", "count": count}
                    edit.json["accessors"].append({**still, "min": [0.0] * 3, "max": [0.0] * 3})
                    p["targets"] = [{"POSITION": len(edit.json["accessors"]) - 1}]
        # the animation: one sampler, a channel for every node that shows a mesh
        if not edit.json.get("nodes"):  # a file of meshes alone
            edit.json["nodes"] = [{"mesh": k} for k in range(len(edit.json["meshes"]))]
            edit.json["scenes"] = [{"nodes": list(range(len(edit.json["meshes"])))}]
            edit.json["scene"] = 0
        nodes = [k for k, node in enumerate(edit.json["nodes"]) if node.get("mesh") in meshes]
        sampler = {
            "input": edit.array(target.times, 0, bounds=True),
            "output": edit.array(target.weights, 0),
            "interpolation": "LINEAR",
        }
        channels = [{"sampler": 0, "target": {"node": k, "path": "weights"}} for k in nodes]
        edit.json.setdefault("animations", []).append(
            {"name": target.name, "samplers": [sampler], "channels": channels}
        )
        data, _, _ = edit.finish("glb", "")
    return data


def _pool(
    edit: Packing,
    document: GltfDocument,
    users: list[Primitive],
    target: Target,
    matrix: FloatArray,
) -> None:
    """Deltas of one pool of vertices, in the space of its mesh, for the primitives that use it."""
    pool = document.pools[users[0].pool]
    part = pool.part
    turn = np.linalg.pinv(matrix[:3, :3])
    before, after = (
        unit_rows(times(rows[part], matrix[:3, :3]), (0.0, 0.0, 1.0)) for rows in target.normals
    )
    start = document.tree.values(pool.attributes["POSITION"])
    delta = times(target.points[part] - matrix[:3, 3], turn.T) - start
    attributes = {} if "NORMAL" in pool.attributes else {"NORMAL": edit.array(before)}
    if "NORMAL" in pool.attributes:
        before = document.tree.values(pool.attributes["NORMAL"])
    moved = {"POSITION": delta, "NORMAL": after - before}
    goal = {name: edit.array(rows, bounds=True) for name, rows in moved.items()}
    for p in users:
        entry = p.entry(edit.json)
        entry["attributes"] |= attributes
        entry["targets"] = [dict(goal)]


def with_frames(glb: bytes, source: Source, normal: FloatArray, tangent: FloatArray) -> bytes:
    """A GLB whose vertices have the NORMAL and TANGENT of its corners; NORMAL stays where it has one.

    normal: (m, 3, 3) of the corners of its triangles in the order of reading, in the world. tangent: (m, 3, 4),
    w last. The last of the corners that share a vertex counts. Raises InputError if the bytes are no sound
    glTF.
    """
    document = read_gltf(glb, source)
    corner, n = document.mesh.faces.ravel(), len(document.mesh.points)
    normals, tangents = np.tile([0.0, 0.0, 1.0], (n, 1)), np.tile([1.0, 0.0, 0.0, 1.0], (n, 1))
    normals[corner], tangents[corner] = normal.reshape(-1, 3), tangent.reshape(-1, 4)
    edit = Packing(document.tree)
    with sound_tree(source):
        matrix = mesh_matrices(document.tree)
        for users in document.users():
            pool = document.pools[users[0].pool]
            place = matrix[users[0].mesh]
            new = {"TANGENT": edit.array(local_tangents(tangents[pool.part], place))}
            if "NORMAL" not in pool.attributes:
                new["NORMAL"] = edit.array(unit_rows(times(normals[pool.part], place[:3, :3])))
            for p in users:
                p.entry(edit.json)["attributes"] |= new
        data, _, _ = edit.finish("glb", "")
    return data
