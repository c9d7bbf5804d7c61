"""Write any document as GLB."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import NoResultError, OutputError
from circparam.formats.document import (
    Document,
    Encoded,
    WriteOptions,
    check_new_set,
    exported_grouping,
    not_carried,
)
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.document import read_gltf
from circparam.formats.gltf.editing import file_uv, index_type, stored_uv
from circparam.formats.gltf.groups import store_grouping
from circparam.formats.gltf.model import ARRAY_BUFFER, COMPONENTS, ELEMENT_BUFFER, Json
from circparam.formats.source import Source
from circparam.formats.vertex_split import duplicated, split_vertices
from circparam.mesh.mesh import UVMap

FAR = 16  # sizes from the origin up to which float32 keeps a shape to a millionth of its size
LARGEST = float(np.finfo(np.float32).max)


def to_glb(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """GLB: input vertices first, seam duplicates behind, one primitive for each group."""
    check_new_set(options, "glb")
    mesh = document.mesh
    n = len(mesh.points)
    split = split_vertices(n, mesh.faces.ravel(), stored_uv(uvmap.uv), uvmap.uv_faces.ravel())
    used = np.zeros(n, bool)
    used[mesh.faces.ravel()] = True
    far = float(np.abs(mesh.points[used]).max())
    at = _origin(mesh.points[used])
    with np.errstate(over="ignore"):
        points = (np.nan_to_num(mesh.points, posinf=0.0, neginf=0.0) - at).astype(np.float32)
    if not far <= LARGEST or not np.isfinite(points).all():
        raise OutputError(
            f"positions up to {far:.3g} do not fit in float32, all that glTF stores: write OBJ or PLY, or "
            "scale the mesh"
        )
    notes, warnings = not_carried(document, "glb")
    if (points.astype(np.float64) + at != mesh.points)[used].any():
        notes.append("positions were rounded to float32, all that glTF stores")
    if split.added:
        notes.append(duplicated(split.added))
    groups = np.zeros(len(mesh.faces), np.int64) if mesh.groups is None else mesh.groups
    order = np.argsort(groups, kind="stable")
    count = np.bincount(groups)
    tree = _new_tree(document, points[split.source], count)
    store_grouping(tree, 0, exported_grouping(document, options.group_by))
    if at.any():
        tree["nodes"][0]["translation"] = at.tolist()
        notes.append(
            "the mesh lies far from the origin: its node holds the place, its positions the shape"
        )
    corner = split.corner.reshape(-1, 3)[order].ravel()
    kind = index_type(len(split.source))
    parts = [
        points[split.source].tobytes(),
        file_uv(split.uv).tobytes(),
        corner.astype(COMPONENTS[kind]).tobytes(),
    ]
    begin = 0
    for data, target in zip(parts, (ARRAY_BUFFER, ARRAY_BUFFER, ELEMENT_BUFFER), strict=True):
        tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": begin, "byteLength": len(data), "target": target}
        )
        begin += len(data)
    width, offset = np.dtype(COMPONENTS[kind]).itemsize, 0
    for k in count[count > 0].tolist():
        tree["accessors"].append(
            {"bufferView": 2, "byteOffset": offset, "componentType": kind, "count": 3 * k}
            | {"type": "SCALAR"}
        )
        offset += 3 * k * width
    tree["buffers"] = [{"byteLength": begin}]
    data = glb_bytes(tree, b"".join(parts))
    return Encoded(data, "glb", split.source, order, notes=notes, warnings=warnings)


def _origin(points: FloatArray) -> FloatArray:
    """(3,) where the node of a mesh is put, in numbers that float32 has: 0 unless it lies so far away that its
    shape would be rounded away with its place, as that of a scan in the coordinates of a map."""
    low, high = points.min(0), points.max(0)
    with np.errstate(over="ignore", invalid="ignore"):
        near = not np.maximum(-low, high).max() > FAR * (high - low).max()
        middle = np.zeros(3) if near else ((low + high) / 2).astype(np.float32).astype(np.float64)
    return np.where(np.isfinite(middle), middle, 0.0)


def to_gltf(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """glTF: the GLB of it, taken apart; ``stem`` names the file of its buffer (none: inside the JSON)."""
    encoded = to_glb(document, uvmap, options)
    again = read_gltf(encoded.data, Source("memory"))
    whole = again.uv()
    if whole is None:
        raise NoResultError("the new glTF has no uv")
    out = again.rewrite(whole, WriteOptions(group_by=again.group_by()), "gltf", stem)
    if out is None:
        raise NoResultError("the new glTF can't be written")
    return replace(encoded, data=out.data, extra=out.extra, format="gltf")


def _new_tree(document: Document, points: npt.NDArray[np.float32], count: IntArray) -> Json:
    """A tree with one node and mesh; views and indices are still to come."""
    used = points.min(0).tolist(), points.max(0).tolist()
    name = document.path.stem if document.path is not None else "mesh"
    name = name.encode("utf-8", "replace").decode()  # names on a disk may be any bytes
    floats = {"componentType": 5126, "count": len(points)}
    tree: Json = {
        "asset": {"version": "2.0", "generator": "circparam"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": []}],
        "accessors": [
            {"bufferView": 0, **floats, "type": "VEC3", "min": used[0], "max": used[1]},
            {"bufferView": 1, **floats, "type": "VEC2"},
        ],
        "bufferViews": [],
    }
    groups = np.flatnonzero(count)
    for k, group in enumerate(groups.tolist()):
        primitive: Json = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2 + k}
        if len(groups) > 1:
            given = document.group_names
            label = (given[group] if group < len(given) else "") or f"group_{group}"
            tree.setdefault("materials", []).append({"name": label})
            primitive["material"] = k
        tree["meshes"][0]["primitives"].append(primitive)
    return tree
