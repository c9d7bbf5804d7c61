"""Mesh files written the plain way, without the package: points (n, 3), faces (m, 3) → bytes."""

import json
import struct
from collections.abc import Callable, Mapping

import numpy as np


def obj(
    points: np.ndarray,
    faces: np.ndarray,
    uv: np.ndarray | None = None,
    uv_faces: np.ndarray | None = None,
    materials: Mapping[str, np.ndarray] | None = None,
    library: str = "",
) -> bytes:
    """Wavefront OBJ. points: (n, 3), or (n, 6) with colours. uv_faces: ``faces`` where left out.

    materials: name → (m,) bool, the faces of each; library: file that has them.
    """
    lines = [f"mtllib {library}"] if library else []
    lines += ["v " + " ".join(map(repr, row)) for row in np.asarray(points, float).tolist()]
    index = faces + 1
    corners = index[..., None]
    if uv is not None:
        lines += [f"vt {u!r} {v!r}" for u, v in np.asarray(uv, float).tolist()]
        corners = np.stack([index, index if uv_faces is None else uv_faces + 1], 2)
    rows = ["f " + " ".join("/".join(map(str, c)) for c in face) for face in corners.tolist()]
    for name, chosen in (materials or {}).items():
        lines += [f"usemtl {name}", *(rows[k] for k in np.flatnonzero(chosen))]
    return ("\n".join([*lines, *(rows if materials is None else [])]) + "\n").encode()


def off(points: np.ndarray, faces: np.ndarray) -> bytes:
    """Object File Format."""
    head = ["OFF", f"{len(points)} {len(faces)} 0"]
    return ("\n".join([*head, *_rows(points, faces)]) + "\n").encode()


def ply_text(points: np.ndarray, faces: np.ndarray) -> bytes:
    """PLY, ascii."""
    return _ply_header("ascii", points, faces) + ("\n".join(_rows(points, faces)) + "\n").encode()


def ply_binary(points: np.ndarray, faces: np.ndarray) -> bytes:
    """PLY, binary little endian, coordinates in the precision of the points."""
    record = np.zeros(len(faces), np.dtype([("k", "u1"), ("i", "<i4", 3)]))
    record["k"], record["i"] = 3, faces
    return _ply_header("binary_little_endian", points, faces) + points.tobytes() + record.tobytes()


def _rows(points: np.ndarray, faces: np.ndarray) -> list[str]:
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    return rows + [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]


def _ply_header(kind: str, points: np.ndarray, faces: np.ndarray) -> bytes:
    number = "float" if points.dtype == np.float32 else "double"
    lines = ["ply", f"format {kind} 1.0", f"element vertex {len(points)}"]
    lines += [f"property {number} {c}" for c in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode()


def stl(points: np.ndarray, faces: np.ndarray) -> bytes:
    """Binary STL (float32)."""
    record = np.zeros(len(faces), np.dtype([("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")]))
    with np.errstate(over="ignore"):
        record["p"] = points[faces]
    return b"made by a test".ljust(80) + struct.pack("<I", len(faces)) + record.tobytes()


def stl_text(points: np.ndarray, faces: np.ndarray) -> bytes:
    """STL as text."""
    lines = ["solid test"]
    for corners in points[faces].tolist():
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in corners]
        lines += ["endloop", "endfacet"]
    return ("\n".join([*lines, "endsolid test"]) + "\n").encode()


def triangles_tree(points: np.ndarray, faces: np.ndarray) -> tuple[dict, bytes]:
    """A glTF tree of one primitive (float32, uint32), and the bytes of its one buffer."""
    with np.errstate(over="ignore"):
        p = points.astype("<f4")
    i = faces.astype("<u4")
    bounds = {"min": p.min(0).tolist(), "max": p.max(0).tolist()} if np.isfinite(p).all() else {}
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(p), "type": "VEC3", **bounds},
            {"bufferView": 1, "componentType": 5125, "count": i.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": p.nbytes},
            {"buffer": 0, "byteOffset": p.nbytes, "byteLength": i.nbytes},
        ],
        "buffers": [{"byteLength": p.nbytes + i.nbytes}],
    }  # fmt: skip
    return tree, p.tobytes() + i.tobytes()


def glb_of(tree: dict, body: bytes) -> bytes:
    """A GLB of a tree and its buffer."""
    text = json.dumps(tree).encode()
    chunks = b""
    for kind, data, fill in ((b"JSON", text, b" "), (b"BIN\0", body, b"\0")):
        data += fill * (-len(data) % 4)
        chunks += struct.pack("<I4s", len(data), kind) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def glb(points: np.ndarray, faces: np.ndarray) -> bytes:
    """Binary glTF with one primitive."""
    return glb_of(*triangles_tree(points, faces))


WRITERS: dict[str, tuple[str, Callable[[np.ndarray, np.ndarray], bytes]]] = {
    "obj": (".obj", obj),
    "off": (".off", off),
    "ply text": (".ply", ply_text),
    "ply binary": (".ply", ply_binary),
    "stl": (".stl", stl),
    "stl text": (".stl", stl_text),
    "glb": (".glb", glb),
}
