"""Write any document as PLY."""

from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import IntArray
from circparam.formats.document import Document, Encoded, WriteOptions, check_new_set, not_carried
from circparam.formats.page_names import page_lines
from circparam.formats.ply import editing
from circparam.formats.tokens import ByteArray, interleave
from circparam.formats.vertex_split import duplicated, split_vertices
from circparam.mesh.mesh import UVMap


def to_ply(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """Binary PLY: polygons kept, uv at the vertices, duplicated along seams, or at the faces."""
    check_new_set(options, "ply")
    at_faces = editing.at_faces(options.ply_uv)
    polys = document.polygons()
    uv_kind = "f8" if options.uv_double else "f4"
    uv = uvmap.uv.astype(uv_kind).astype(np.float64)
    corner = polys.corner_uv(UVMap(uv, uvmap.uv_faces), document.source.name)
    n = len(document.mesh.points)
    split = split_vertices(n, polys.corners, uv, corner)
    source = np.arange(n) if at_faces else split.source
    points = document.mesh.points[source]
    with np.errstate(over="ignore", invalid="ignore"):
        exact = bool((points.astype(np.float32) == points)[np.isfinite(points)].all())
    kind = "f4" if exact else "f8"
    fields = [(c, "<" + kind) for c in "xyz"]
    if not at_faces:
        fields += [("s", "<" + uv_kind), ("t", "<" + uv_kind)]
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
        table = np.concatenate([uv, np.zeros((1, 2))]).astype("<" + uv_kind)
        parts += [
            _raw((2 * size).astype(count)),
            (table[corner].reshape(-1).view(np.uint8), 2 * table.itemsize * size),
        ]
    body, _ = interleave(parts)
    names = {"f4": "float", "f8": "double"}
    name, uv_name, count_name = names[kind], names[uv_kind], "int" if wide else "uchar"
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment written by circparam",
        *(f"comment {line}" for line in page_lines(options.pages)),
        f"element vertex {len(points)}",
    ]
    lines += [f"property {name} {c}" for c in "xyz"]
    lines += [] if at_faces else [f"property {uv_name} {c}" for c in "st"]
    lines += [f"element face {len(size)}", f"property list {count_name} int vertex_indices"]
    lines += [f"property list {count_name} {uv_name} texcoord"] if at_faces else []
    head = "\n".join([*lines, "end_header", ""]).encode()
    notes, warnings = not_carried(document, "ply", "polygons")
    if not at_faces and split.added:
        notes.append(duplicated(split.added))
    data = head + vertex.tobytes() + body.tobytes()
    faces = np.arange(len(document.mesh.faces))
    return Encoded(data, "ply", source, faces, notes=notes, warnings=warnings)


def _raw(values: npt.NDArray[Any]) -> tuple[ByteArray, IntArray]:
    return values.view(np.uint8), np.full(len(values), values.dtype.itemsize, np.int64)
