"""Small mesh files written the plain way, and ways to spoil them."""

import json
import re
import struct
from collections.abc import Callable

import numpy as np
from hypothesis import strategies as st

from tests.support.shapes import Shape


def obj(points: np.ndarray, faces: np.ndarray) -> bytes:
    """Wavefront OBJ."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces.tolist()]
    return ("\n".join(lines) + "\n").encode()


def off(points: np.ndarray, faces: np.ndarray) -> bytes:
    """Object File Format."""
    lines = ["OFF", f"{len(points)} {len(faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    return ("\n".join(lines) + "\n").encode()


def ply_text(points: np.ndarray, faces: np.ndarray) -> bytes:
    """PLY, ascii, double coordinates."""
    lines = [f"{x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    return _ply_header("ascii", len(points), len(faces)) + ("\n".join(lines) + "\n").encode()


def ply_binary(points: np.ndarray, faces: np.ndarray) -> bytes:
    """PLY, binary little endian, double coordinates."""
    record = np.zeros(len(faces), np.dtype([("k", "u1"), ("i", "<i4", 3)]))
    record["k"], record["i"] = 3, faces
    head = _ply_header("binary_little_endian", len(points), len(faces))
    return head + points.astype("<f8").tobytes() + record.tobytes()


def _ply_header(kind: str, n: int, m: int) -> bytes:
    lines = ["ply", f"format {kind} 1.0", f"element vertex {n}"]
    lines += [f"property double {c}" for c in "xyz"]
    lines += [f"element face {m}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode()


def stl(points: np.ndarray, faces: np.ndarray) -> bytes:
    """Binary STL (float32)."""
    record = np.zeros(len(faces), np.dtype([("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")]))
    with np.errstate(over="ignore"):
        record["p"] = points[faces]
    return b"fuzz".ljust(80) + struct.pack("<I", len(faces)) + record.tobytes()


def stl_text(points: np.ndarray, faces: np.ndarray) -> bytes:
    """STL as text."""
    lines = ["solid fuzz"]
    for corners in points[faces].tolist():
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in corners]
        lines += ["endloop", "endfacet"]
    return ("\n".join([*lines, "endsolid fuzz"]) + "\n").encode()


def glb(points: np.ndarray, faces: np.ndarray) -> bytes:
    """Binary glTF with one primitive (float32)."""
    with np.errstate(over="ignore"):
        p = points.astype("<f4")
    i = faces.astype("<u4")
    blob = p.tobytes() + i.tobytes()
    finite = np.isfinite(p).all()
    bounds = {"min": p.min(0).tolist(), "max": p.max(0).tolist()} if finite else {}
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(p), "type": "VEC3", **bounds},
        {"bufferView": 1, "componentType": 5125, "count": i.size, "type": "SCALAR"},
    ]
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": p.nbytes},
        {"buffer": 0, "byteOffset": p.nbytes, "byteLength": i.nbytes},
    ]
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(blob)}],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


WRITERS: dict[str, tuple[str, Callable[[np.ndarray, np.ndarray], bytes]]] = {
    "obj": (".obj", obj),
    "off": (".off", off),
    "ply text": (".ply", ply_text),
    "ply binary": (".ply", ply_binary),
    "stl": (".stl", stl),
    "stl text": (".stl", stl_text),
    "glb": (".glb", glb),
}
SUFFIXES = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf", ".OBJ", ".txt", "")

_WORDS = [
    b"nan", b"inf", b"-inf", b"1e400", b"1e308", b"-1", b"0", b"99999999999", b"-99999999999", b"4294967295",
    b"2147483648", b"65536", b"1e-320", b"", b"abc", b"1/1/1", b"1//2", b"-1/-1", b"\xff\xfe", b"\xe2\x82\xac",
]  # fmt: skip
_LINES = [
    b"f 1 2 3 4 5 6 7 8 9\n", b"f 1\n", b"f\n", b"f 0 1 2\n", b"f -1 -2 -3\n", b"f 1 1 1\n", b"v 1 2\n",
    b"v 1 2 3 4 5 6\n", b"vt 0.5\n", b"usemtl x\n", b"mtllib missing.mtl\n", b"o x\n", b"\\\n",
    b"element face 3\n",
    b"property list uchar int vertex_indices\n", b"end_header\n", b"facet normal 0 0 1\n", b"curv 0 1 1 2\n",
]  # fmt: skip


@st.composite
def spoiled(draw: st.DrawFn, data: bytes) -> bytes:
    """One to four changes to the bytes of a file."""
    for _ in range(draw(st.integers(1, 4))):
        data = _change(draw, data)
    return data


def _change(draw: st.DrawFn, data: bytes) -> bytes:
    at = round(draw(st.floats(0, 1)) * len(data))
    size = draw(st.sampled_from([1, 1, 2, 4, 16, 100]))
    kind = draw(
        st.sampled_from(["cut", "drop", "flip", "zero", "ones", "twice", "junk", "word", "line"])
    )
    if kind == "cut":
        return data[:at]
    if kind == "drop":
        return data[:at] + data[at + size :]
    if kind == "flip" and at < len(data):
        return data[:at] + bytes([data[at] ^ (1 << draw(st.integers(0, 7)))]) + data[at + 1 :]
    if kind in ("zero", "ones"):
        return data[:at] + (b"\0" if kind == "zero" else b"\xff") * size + data[at + size :]
    if kind == "twice":
        return data[: at + size] + data[at:]
    if kind == "junk":
        return data[:at] + draw(st.binary(max_size=64)) + data[at:]
    if kind == "word":
        words = list(re.finditer(rb"[-+.\w]+", data))
        if words:
            word = words[min(round(draw(st.floats(0, 1)) * len(words)), len(words) - 1)]
            return data[: word.start()] + draw(st.sampled_from(_WORDS)) + data[word.end() :]
    start = data.rfind(b"\n", 0, at) + 1
    return data[:start] + draw(st.sampled_from(_LINES)) + data[start:]


def whole(shape: Shape, writer: str) -> tuple[str, bytes]:
    """(suffix, bytes) of a mesh in one of the formats."""
    suffix, write = WRITERS[writer]
    return suffix, write(*shape)
