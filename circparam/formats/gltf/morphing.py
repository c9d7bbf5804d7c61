"""A morph target in a glTF tree, and an animation that plays it."""

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.records import dataclass
from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.gltf.model import ARRAY_BUFFER, Json, Primitive
from circparam.formats.gltf.reading import sound_tree
from circparam.formats.gltf.scene import mesh_matrices, times
from circparam.formats.tokens import ByteArray


@dataclass(frozen=True, eq=False)
class Target:
    """Places to which vertices move, in the world, as (n, 3) of ``Document.mesh.points``.

    normals: before and after, unit. times, weights: the key frames of its animation, seconds from 0 on and
    0..1. colours: (n, 3) linear, or None. name: of the target and its animation.
    """

    points: FloatArray
    normals: tuple[FloatArray, FloatArray]
    times: FloatArray
    weights: FloatArray
    name: str
    colours: FloatArray | None = None


class Morphing(Packing):
    """A copy of a tree that gets a morph target."""

    def floats(self, values: FloatArray, bounds: bool = False, target: int = ARRAY_BUFFER) -> int:
        """A float accessor of vectors (n, k) or scalars (n,): its number. bounds: with least and largest."""
        raw = np.ascontiguousarray(values.reshape(len(values), -1), "<f4")
        kind = "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}"
        entry: Json = {"componentType": 5126, "type": kind}
        if bounds:
            entry |= {"min": raw.min(0).tolist(), "max": raw.max(0).tolist()}
        return self.accessor(entry, raw.view(np.uint8).reshape(len(raw), -1), target)

    def accessor(self, entry: Json, rows: ByteArray, target: int) -> int:
        """As ever; data of animations have views without a target."""
        number = super().accessor(entry, rows, target)
        if not target:
            self.data[-1][0].pop("target")
        return number

    def primitive(self, p: Primitive) -> Json:
        """The entry of a primitive in the new tree."""
        entry: Json = self.json["meshes"][p.mesh]["primitives"][p.number]
        return entry


def with_morph(document: GltfDocument, target: Target) -> bytes:
    """The document as GLB with a morph target on all its triangles, and an animation of its weight.

    Meshes that nodes show several times move alike in each place. Raises InputError if it has morph targets.
    """
    tree = document.tree
    edit = Morphing(tree)
    with sound_tree(document.source):
        if any(p.get("targets") for mesh in edit.json["meshes"] for p in mesh["primitives"]):
            raise document.source.error(
                "it has morph targets of its own: take them out, or give the meshes the other way round"
            )
        matrix = mesh_matrices(tree)
        for k in range(len(document.pools)):
            users = [p for p in document.primitives if p.pool == k]
            if users:
                _pool(edit, document, users, target, matrix[users[0].mesh])
        meshes = {p.mesh for p in document.primitives}
        for mesh in meshes:
            _mesh(edit, edit.json["meshes"][mesh], target.name)
        _play(edit, meshes, target)
        data, _, _ = edit.finish("glb", "")
    return data


def _pool(
    edit: Morphing,
    document: GltfDocument,
    users: list[Primitive],
    target: Target,
    matrix: FloatArray,
) -> None:
    """Deltas of one pool of vertices, in the space of its mesh, for the primitives that use it."""
    pool = document.pools[users[0].pool]
    part = slice(pool.first, pool.first + pool.count)
    turn = np.linalg.pinv(matrix[:3, :3])
    before, after = (_unit(times(rows[part], matrix[:3, :3])) for rows in target.normals)
    start = document.tree.values(pool.attributes["POSITION"])
    delta = times(target.points[part] - matrix[:3, 3], turn.T) - start
    attributes = {} if "NORMAL" in pool.attributes else {"NORMAL": edit.floats(before)}
    if target.colours is not None:
        attributes["COLOR_0"] = edit.floats(target.colours[part])
    if "NORMAL" in pool.attributes:
        before = document.tree.values(pool.attributes["NORMAL"])
    goal = {"POSITION": edit.floats(delta, True), "NORMAL": edit.floats(after - before, True)}
    for p in users:
        entry = edit.primitive(p)
        entry["attributes"] |= attributes
        entry["targets"] = [dict(goal)]


def _mesh(edit: Morphing, mesh: Json, name: str) -> None:
    """A weight and a name for the target; primitives that have no triangles get a target that moves nothing."""
    mesh["weights"] = [0.0]
    extras = mesh.get("extras")
    mesh["extras"] = {**(extras if isinstance(extras, dict) else {}), "targetNames": [name]}
    for p in mesh["primitives"]:
        if "targets" not in p and "POSITION" in p["attributes"]:
            count = edit.json["accessors"][p["attributes"]["POSITION"]]["count"]
            still = {"componentType": 5126, "type": "VEC3", "count": count}
            edit.json["accessors"].append({**still, "min": [0.0] * 3, "max": [0.0] * 3})
            p["targets"] = [{"POSITION": len(edit.json["accessors"]) - 1}]


def _play(edit: Morphing, meshes: set[int], target: Target) -> None:
    """The animation: one sampler, a channel for every node that shows a mesh."""
    if not edit.json.get("nodes"):  # a file of meshes alone
        edit.json["nodes"] = [{"mesh": k} for k in range(len(edit.json["meshes"]))]
        edit.json["scenes"] = [{"nodes": list(range(len(edit.json["meshes"])))}]
        edit.json["scene"] = 0
    nodes = [k for k, node in enumerate(edit.json["nodes"]) if node.get("mesh") in meshes]
    sampler = {
        "input": edit.floats(target.times, True, 0),
        "output": edit.floats(target.weights, False, 0),
        "interpolation": "LINEAR",
    }
    channels = [{"sampler": 0, "target": {"node": k, "path": "weights"}} for k in nodes]
    edit.json.setdefault("animations", []).append(
        {"name": target.name, "samplers": [sampler], "channels": channels}
    )


def _unit(rows: FloatArray) -> FloatArray:
    """Vectors of length 1; any direction (z) where there is none, since glTF allows no other length."""
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    out: FloatArray = np.where(length > 0, rows / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
    return out
