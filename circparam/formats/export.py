"""Write a mesh with uv into a format that is not its own: OBJ, PLY or GLB from anything."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.arrays import IntArray
from circparam.errors import OptionError, OutputError
from circparam.formats.document import Document, Encoded, WriteOptions
from circparam.formats.gltf_pack import ARRAY_BUFFER, ELEMENT_BUFFER, glb_bytes
from circparam.formats.gltf_tree import COMPONENTS, Json
from circparam.formats.gltf_write import file_uv, stored_uv
from circparam.formats.obj import compact
from circparam.formats.obj_scan import vt_lines
from circparam.formats.ply import POLYGON_UV
from circparam.formats.polygons import polygon_of_corner
from circparam.formats.seamsplit import split_vertices
from circparam.formats.splice import ByteArray, as_bytes, digits, interleave
from circparam.mesh import UVMap


def lost(document: Document, *kept: str) -> list[str]:
    """A note on what of the input the new format does not carry."""
    gone = [f for f in document.features if f not in kept]
    return [f"not carried into the new format: {', '.join(gone)}"] if gone else []


def only_first_set(options: WriteOptions, format: str) -> None:
    """Raise OptionError for a uv set that a new file does not have."""
    if options.uv_set:
        raise OptionError(
            f"uv set {options.uv_set}: a new {format.upper()} file gets one uv set; leave it out"
        )


def to_obj(document: Document, uvmap: UVMap, options: WriteOptions) -> Encoded:
    """OBJ: points in order, polygons kept, a ``usemtl`` line where the group changes."""
    only_first_set(options, "obj")
    polys = document.polygons()
    corner = polys.corner_uv(uvmap, document.source.name)
    used, corner = compact(corner, len(uvmap.uv))
    points = "".join([f"v {x!r} {y!r} {z!r}\n" for x, y, z in document.mesh.points.tolist()])
    size = np.diff(polys.start)
    v, v_size = digits(polys.corners + 1, b" ")
    t, t_size = digits(np.maximum(corner, 0) + 1, b"/")
    if (corner < 0).any():
        t, t_size = t[np.repeat(corner >= 0, t_size)], np.where(corner < 0, 0, t_size)
    text, length = interleave([(v, v_size), (t, t_size)])
    per_face = np.bincount(polygon_of_corner(polys.start), length, len(size)).astype(np.int64)
    head = np.full(len(size), 1)
    head_text = [b"f"] * len(size)
    names, label = _polygon_groups(document, polys.owner, len(size))
    if names:
        change = np.flatnonzero(np.diff(label, prepend=-1))
        for f in change.tolist():
            head_text[f] = b"usemtl " + names[label[f]] + b"\nf"
        head = np.array([len(h) for h in head_text])
    some = size > 2
    newline = np.full(len(size), 1)
    body, lengths = interleave(
        [
            (as_bytes(b"".join(head_text)), head),
            (text, per_face),
            (as_bytes(b"\n" * len(size)), newline),
        ]
    )
    lines = body[np.repeat(some, lengths)].tobytes() if not some.all() else body.tobytes()
    data = points.encode() + vt_lines(uvmap.uv[used], "\n") + lines
    n, m = len(document.mesh.points), len(document.mesh.faces)
    notes = lost(document, "polygons", "groups")
    return Encoded(data, "obj", np.arange(n), np.arange(m), notes=notes)


def _polygon_groups(
    document: Document, owner: IntArray, count: int
) -> tuple[list[bytes], IntArray]:
    """Names as OBJ takes them, and the label of each polygon."""
    groups = document.mesh.groups
    if groups is None:
        return [], np.zeros(0, np.int64)
    label = np.zeros(count, np.int64)
    label[owner] = groups
    given = document.group_names
    names = [
        ("_".join(given[k].split()) if k < len(given) else "") or f"group_{k}"
        for k in range(int(groups.max()) + 1)
    ]
    return [name.encode() for name in names], label


def to_ply(document: Document, uvmap: UVMap, options: WriteOptions) -> Encoded:
    """Binary PLY: polygons kept, uv at the vertices or, where a seam would split them, at the faces."""
    only_first_set(options, "ply")
    if options.ply_uv not in (None, "vertex", "face"):
        raise OptionError(f"unknown place for uv {options.ply_uv!r}: choose vertex or face")
    polys = document.polygons()
    uv = uvmap.uv.astype(np.float32).astype(np.float64)
    corner = polys.corner_uv(UVMap(uv, uvmap.uv_faces), document.source.name)
    n = len(document.mesh.points)
    split = split_vertices(n, polys.corners, uv, corner)
    at_faces = (options.ply_uv or ("face" if split.added else "vertex")) == "face"
    source = np.arange(n) if at_faces else split.source
    points = document.mesh.points[source]
    with np.errstate(over="ignore", invalid="ignore"):
        exact = bool((points.astype(np.float32) == points)[np.isfinite(points)].all())
    kind = "f4" if exact else "f8"
    fields = [(c, "<" + kind) for c in "xyz"]
    if not at_faces:
        fields += [("s", "<f4"), ("t", "<f4")]
    vertex = np.zeros(len(points), fields)
    for k, c in enumerate("xyz"):
        vertex[c] = points[:, k]
    if not at_faces:
        vertex["s"], vertex["t"] = split.uv.T
    size = np.diff(polys.start)
    wide = int(size.max(initial=0)) > (127 if at_faces else 255)
    count = "<i4" if wide else "u1"
    index = (polys.corners if at_faces else split.corner).astype("<i4")
    parts = [_raw(size.astype(count)), (index.view(np.uint8), 4 * size)]
    if at_faces:
        table = np.concatenate([uv, np.zeros((1, 2))]).astype("<f4")
        parts += [
            _raw((2 * size).astype(count)),
            (table[corner].reshape(-1).view(np.uint8), 8 * size),
        ]
    body, _ = interleave(parts)
    name, count_name = {"f4": "float", "f8": "double"}[kind], "int" if wide else "uchar"
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment written by circparam",
        f"element vertex {len(points)}",
    ]
    lines += [f"property {name} {c}" for c in "xyz"]
    lines += [] if at_faces else ["property float s", "property float t"]
    lines += [f"element face {len(size)}", f"property list {count_name} int vertex_indices"]
    lines += [f"property list {count_name} float texcoord"] if at_faces else []
    head = "\n".join([*lines, "end_header", ""]).encode()
    notes = lost(document, "polygons")
    if at_faces and polys.labels is not None and options.ply_uv is None:
        notes.append(POLYGON_UV)
    if not at_faces and split.added:
        notes.append(f"{split.added} vertices were duplicated along seams, behind the input's")
    data = head + vertex.tobytes() + body.tobytes()
    return Encoded(data, "ply", source, np.arange(len(document.mesh.faces)), notes=notes)


def _raw(values: npt.NDArray[Any]) -> tuple[ByteArray, IntArray]:
    return values.view(np.uint8), np.full(len(values), values.dtype.itemsize, np.int64)


def to_glb(document: Document, uvmap: UVMap, options: WriteOptions) -> Encoded:
    """GLB: input vertices first, seam duplicates behind, one primitive for each group."""
    only_first_set(options, "glb")
    mesh = document.mesh
    n = len(mesh.points)
    split = split_vertices(n, mesh.faces.ravel(), stored_uv(uvmap.uv), uvmap.uv_faces.ravel())
    with np.errstate(over="ignore"):
        points = np.nan_to_num(mesh.points, posinf=0.0, neginf=0.0).astype(np.float32)
    if not np.isfinite(points).all():
        far = float(np.abs(mesh.points[np.unique(mesh.faces)]).max())
        raise OutputError(
            f"positions up to {far:.3g} do not fit in float32, all that glTF stores: write OBJ or PLY, or "
            "scale the mesh"
        )
    notes = lost(document)
    if (points != mesh.points)[np.unique(mesh.faces)].any():
        notes.append("positions were rounded to float32, all that glTF stores")
    if split.added:
        notes.append(f"{split.added} vertices were duplicated along seams, behind the input's")
    groups = np.zeros(len(mesh.faces), np.int64) if mesh.groups is None else mesh.groups
    order = np.argsort(groups, kind="stable")
    count = np.bincount(groups)
    tree = _new_tree(document, points[split.source], count)
    corner = split.corner.reshape(-1, 3)[order].ravel()
    kind = 5123 if len(split.source) <= 65535 else 5125
    parts = [
        points[split.source].tobytes(),
        file_uv(split.uv).tobytes(),
        corner.astype(COMPONENTS[kind]).tobytes(),
    ]
    at = 0
    for data, target in zip(parts, (ARRAY_BUFFER, ARRAY_BUFFER, ELEMENT_BUFFER), strict=True):
        tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": at, "byteLength": len(data), "target": target}
        )
        at += len(data)
    width, offset = np.dtype(COMPONENTS[kind]).itemsize, 0
    for k in count[count > 0].tolist():
        tree["accessors"].append(
            {"bufferView": 2, "byteOffset": offset, "componentType": kind, "count": 3 * k}
            | {"type": "SCALAR"}
        )
        offset += 3 * k * width
    tree["buffers"] = [{"byteLength": at}]
    return Encoded(glb_bytes(tree, b"".join(parts)), "glb", split.source, order, notes=notes)


def _new_tree(document: Document, points: npt.NDArray[np.float32], count: IntArray) -> Json:
    """A tree with one node and mesh; views and indices are still to come."""
    used = points.min(0).tolist(), points.max(0).tolist()
    name = document.path.stem if document.path is not None else "mesh"
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
