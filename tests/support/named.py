"""A small mesh whose parts have names in every way that files name them."""

import json
import struct
from pathlib import Path

import numpy as np

from tests.support import shapes

NAMES = (("face", "head", "Head"), ("sole", "foot", "Foot"), ("hide", "trunk", "Trunk"))


def named_scene(folder: Path) -> tuple[Path, Path]:
    """Three boxes as OBJ and GLB: material, group (the mesh), node; the node Body has Head and Foot below."""
    points, faces = shapes.cube(1)
    obj = folder / "named.obj"
    lines = []
    for k, (material, group, node) in enumerate(NAMES):
        lines += [f"v {x} {y} {z}" for x, y, z in (points + np.array([3.0 * k, 0, 0])).tolist()]
        lines += [f"o {node}", f"g {group}", f"usemtl {material}"]
        lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1 + k * len(points)).tolist()]
    obj.write_text("\n".join(lines) + "\n")
    glb = folder / "named.glb"
    glb.write_bytes(_glb(points, faces))
    return obj, glb


def _glb(points: np.ndarray, faces: np.ndarray) -> bytes:
    """One mesh for each name, over the same numbers."""
    place, index = points.astype("<f4").tobytes(), faces.astype("<u2").tobytes()
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [2, 3]}],
        "nodes": [
            {"name": "Head", "mesh": 0},
            {"name": "Foot", "mesh": 1, "translation": [3, 0, 0]},
            {"name": "Trunk", "mesh": 2, "translation": [6, 0, 0]},
            {"name": "Body", "children": [0, 1]},
        ],
        "materials": [{"name": material} for material, _, _ in NAMES],
        "meshes": [
            {"name": group, "primitives": [{**primitive, "material": k}]}
            for k, (_, group, _) in enumerate(NAMES)
        ],
        "accessors": [
            {
                "bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
                "min": points.min(0).tolist(), "max": points.max(0).tolist(),
            },
            {"bufferView": 1, "componentType": 5123, "count": faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(place)},
            {"buffer": 0, "byteOffset": len(place), "byteLength": len(index)},
        ],
        "buffers": [{"byteLength": len(place) + len(index)}],
    }  # fmt: skip
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    data = place + index
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
