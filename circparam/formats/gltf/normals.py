"""Normals and tangents written into a glTF tree."""

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.formats.gltf.buffers import Packing
from circparam.formats.gltf.document import read_gltf
from circparam.formats.gltf.model import ARRAY_BUFFER
from circparam.formats.gltf.reading import sound_tree
from circparam.formats.gltf.scene import mesh_matrices, times
from circparam.formats.source import Source


def with_frames(glb: bytes, source: Source, normal: FloatArray, tangent: FloatArray) -> bytes:
    """A GLB whose vertices have the NORMAL and TANGENT of its corners; NORMAL stays where it has one.

    normal: (m, 3, 3) of the corners of its triangles in the order of reading, in the world. tangent: (m, 3, 4),
    w last. The last of the corners that share a vertex counts. Raises InputError if the bytes are no sound
    glTF.
    """
    document = read_gltf(glb, source)
    tree = document.tree
    n = len(document.mesh.points)
    vertex = document.mesh.faces.ravel()
    rows = np.zeros((n, 7))
    rows[:, 2] = rows[:, 3] = rows[:, 6] = 1
    rows[vertex] = np.concatenate([normal.reshape(-1, 3), tangent.reshape(-1, 4)], 1)
    edit = Packing(tree)
    with sound_tree(source):
        matrix = mesh_matrices(tree)
        for k, pool in enumerate(document.pools):
            users = [p for p in document.primitives if p.pool == k]
            if not users:
                continue
            part = rows[pool.first : pool.first + pool.count]
            whole = matrix[users[0].mesh][:3, :3]
            new = {
                "TANGENT": np.c_[
                    unit_rows(times(part[:, 3:6], np.linalg.pinv(whole).T)), part[:, 6]
                ]
            }
            if "NORMAL" not in pool.attributes:
                new["NORMAL"] = unit_rows(times(part[:, :3], whole))
            attributes = {name: _add(edit, values) for name, values in new.items()}
            for p in users:
                entry = edit.json["meshes"][p.mesh]["primitives"][p.number]
                edit.touched |= {entry["attributes"].get("TANGENT", -1)} - {-1}
                entry["attributes"] |= attributes
        data, _, _ = edit.finish("glb", "")
    return data


def _add(edit: Packing, values: FloatArray) -> int:
    """A float accessor of vectors; returns its number."""
    raw = np.ascontiguousarray(values, "<f4")
    entry = {"componentType": 5126, "type": f"VEC{values.shape[1]}"}
    return edit.accessor(entry, raw.view(np.uint8).reshape(len(raw), -1), ARRAY_BUFFER)


def unit_rows(rows: FloatArray) -> FloatArray:
    """Vectors of length 1; where there is no direction, any (x), since glTF allows no other length."""
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    out: FloatArray = np.where(length > 0, rows / np.maximum(length, 1e-300), [1.0, 0.0, 0.0])
    return out
