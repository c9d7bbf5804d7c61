"""What the sample script builds with: grids, rounded numbers, OBJ, PNG and GLB writers, topology counts."""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import dataclass, field

import numpy as np

DIGITS = 5


@dataclass
class Sample:
    """One file: what it shows, the mesh for the manifest, and the bytes of every file it consists of.

    pair: the sample that it belongs to, where two surfaces are meant to be mapped onto each other.
    """

    name: str
    summary: str
    points: np.ndarray
    faces: list[tuple[int, ...]]
    files: dict[str, bytes] = field(default_factory=dict)
    pair: str = "-"


Part = tuple[str, np.ndarray, np.ndarray, np.ndarray, dict[str, list[float]]]


def grid_points(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The coordinates of a grid, u-major, flat."""
    a, b = np.meshgrid(u, v, indexing="ij")
    return a.ravel(), b.ravel()


def grid_quads(nu: int, nv: int, closed_u: bool = False, closed_v: bool = False) -> np.ndarray:
    """(q, 4) quads of a grid of nu × nv vertices, u-major."""
    i, j = np.meshgrid(
        np.arange(nu if closed_u else nu - 1), np.arange(nv if closed_v else nv - 1), indexing="ij"
    )
    i, j = i.ravel(), j.ravel()
    i1, j1 = (i + 1) % nu, (j + 1) % nv
    return np.stack([i * nv + j, i1 * nv + j, i1 * nv + j1, i * nv + j1], 1)


def split(quads: np.ndarray) -> np.ndarray:
    """Two triangles a quad, along the first diagonal."""
    return np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], 1).reshape(-1, 3)


def compact(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop vertices that no face uses."""
    used, inverse = np.unique(faces, return_inverse=True)
    return points[used], inverse.reshape(faces.shape)


def rounded(points: np.ndarray) -> np.ndarray:
    """Coordinates on a decimal grid: the same on every machine (and no minus zero)."""
    return np.round(points, DIGITS) + 0.0


def number(x: float) -> str:
    """The shortest decimal of a rounded coordinate."""
    return f"{x:.{DIGITS}f}".rstrip("0").rstrip(".")


def vertex_lines(points: np.ndarray) -> list[str]:
    """The v lines of an OBJ file."""
    return ["v " + " ".join(map(number, p)) for p in rounded(points).tolist()]


def face_lines(faces: np.ndarray | list[tuple[int, ...]]) -> list[str]:
    """The f lines of an OBJ file."""
    return ["f " + " ".join(str(i + 1) for i in f) for f in faces]


def obj(name: str, *blocks: list[str]) -> bytes:
    """An OBJ file out of its lines."""
    lines = [f"# {name}: a sample mesh of circparam", *[line for b in blocks for line in b]]
    return ("\n".join(lines) + "\n").encode()


def tuples(faces: np.ndarray) -> list[tuple[int, ...]]:
    """Faces as a list of tuples."""
    return [tuple(f) for f in faces.tolist()]


def turned(profile: np.ndarray, around: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A body of revolution round y with a uv seam: points, uv, faces. profile: (k, 2) radius, height."""
    k = len(profile)
    a, i = grid_points(2 * np.pi * np.arange(around + 1) / around, np.arange(k))
    r, y = profile[i.astype(int)].T
    p = np.stack([r * np.cos(a), y, -r * np.sin(a)], 1)
    p[-k:] = p[:k]  # the seam's two sides hold the same numbers
    uv = np.stack([a / (2 * np.pi), i / (k - 1)], 1)  # v runs downwards in glTF
    return rounded(p), np.round(uv, DIGITS), split(grid_quads(around + 1, k)[:, ::-1])


def png(pixels: np.ndarray) -> bytes:
    """An RGB image (h, w, 3) uint8 as PNG, in one stored block, so the bytes depend on no compressor."""
    h, w, _ = pixels.shape
    raw = np.concatenate([np.zeros((h, 1), np.uint8), pixels.reshape(h, -1)], 1).tobytes()
    if len(raw) > 65535:
        raise ValueError("one stored block holds 65535 bytes")
    stored = b"\x78\x01\x01" + struct.pack("<HH", len(raw), len(raw) ^ 0xFFFF) + raw
    stored += struct.pack(">I", zlib.adler32(raw))

    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    head = struct.pack(">IIBBBBB", w, h, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", stored) + chunk(b"IEND", b"")
    )


def ply(name: str, points: np.ndarray, faces: np.ndarray) -> bytes:
    """A binary PLY of triangles."""
    vertex = points.astype("<f4")
    face = np.zeros(len(faces), np.dtype([("k", "u1"), ("i", "<i4", 3)]))
    face["k"], face["i"] = 3, faces
    head = [
        "ply", "format binary_little_endian 1.0", f"comment {name}: a sample mesh of circparam",
        f"element vertex {len(points)}", *[f"property float {c}" for c in "xyz"],
        f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n",
    ]  # fmt: skip
    return "\n".join(head).encode() + vertex.tobytes() + face.tobytes()


def gltf(
    parts: list[Part],
    images: list[bytes],
    materials: list[dict[str, object]],
    normals: list[np.ndarray] | None = None,
) -> bytes:
    """A GLB with textured materials; parts: (name, points, uv, faces, node transform).

    images: PNG bytes, the texture of each has its number. materials: one for all parts, or one each. normals:
    of the points of each part.
    """
    blob = b""
    views: list[dict[str, int]] = []
    accessors: list[dict[str, object]] = []

    def add(data: bytes, target: int | None = None) -> int:
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        if target is not None:
            views[-1]["target"] = target
        blob += data + b"\0" * (-len(data) % 4)
        return len(views) - 1

    meshes, nodes = [], []
    for number, (name, p, uv, f, transform) in enumerate(parts):
        p32 = p.astype("<f4")
        attributes = {}
        for key, array, kind in (
            ("POSITION", p32, "VEC3"),
            *([("NORMAL", normals[number].astype("<f4"), "VEC3")] if normals else []),
            ("TEXCOORD_0", uv.astype("<f4"), "VEC2"),
        ):
            accessor: dict[str, object] = {"bufferView": add(array.tobytes(), 34962)}
            accessor |= {"componentType": 5126, "count": len(array), "type": kind}
            if key == "POSITION":
                accessor |= {"min": p32.min(0).tolist(), "max": p32.max(0).tolist()}
            accessors.append(accessor)
            attributes[key] = len(accessors) - 1
        index = f.astype("<u2").ravel()
        accessors.append(
            {
                "bufferView": add(index.tobytes(), 34963),
                "componentType": 5123,
                "count": len(index),
                "type": "SCALAR",
            }
        )
        material = number if len(materials) > 1 else 0
        primitive = {"attributes": attributes, "indices": len(accessors) - 1, "material": material}
        nodes.append({"name": name, "mesh": len(meshes)} | transform)
        meshes.append({"name": name, "primitives": [primitive]})
    pictures = [add(image) for image in images]
    document = {
        "asset": {"version": "2.0", "generator": "circparam sample"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "textures": [{"source": k, "sampler": 0} for k in range(len(images))],
        "samplers": [{"wrapS": 10497, "wrapT": 10497}],
        "images": [{"bufferView": k, "mimeType": "image/png"} for k in pictures],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    if "KHR_texture_transform" in json.dumps(materials):
        document["extensionsUsed"] = ["KHR_texture_transform"]
    return glb(document, blob)


def plain_material(name: str) -> dict[str, object]:
    """A material that shows image 0."""
    return {"name": name, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def glb(document: dict[str, object], blob: bytes) -> bytes:
    """A GLB file of its JSON and its binary chunk (whose length is a multiple of 4)."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = (
        struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(blob), b"BIN\0")
        + blob
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def topology(points: np.ndarray, polygons: list[tuple[int, ...]]) -> dict[str, object]:
    """Counts on welded points: components, genus and boundary loops where the surface is a manifold."""
    _, weld = np.unique(rounded(points), axis=0, return_inverse=True)
    weld = weld.reshape(-1)
    polygons = [tuple(int(weld[i]) for i in q) for q in polygons]
    triangles = sum(len(q) - 2 for q in polygons)
    sides = np.array([e for q in polygons for e in zip(q, q[1:] + q[:1], strict=True)])
    edges, count = np.unique(np.sort(sides, 1), axis=0, return_counts=True)
    vertices = np.unique(sides)
    components = len(set(roots(edges, len(points))[vertices].tolist()))
    manifold = bool(count.max() <= 2 and (edges[:, 0] != edges[:, 1]).all())
    boundary = edges[count == 1]
    loops = len(set(roots(boundary, len(points))[boundary[:, 0]].tolist())) if len(boundary) else 0
    euler = len(vertices) - len(edges) + len(polygons)
    genus = (2 * components - loops - euler) // 2
    return {
        "vertices": len(points), "polygons": len(polygons), "triangles": triangles, "components": components,
        "genus": genus if manifold else "-", "boundaries": loops if manifold else "-",
        "nonmanifold_edges": int((count > 2).sum()),
    }  # fmt: skip


def roots(edges: np.ndarray, n: int) -> np.ndarray:
    """Lowest vertex connected to each vertex, by repeated minima over the edges."""
    root = np.arange(n)
    while len(edges):
        low = root.copy()
        np.minimum.at(low, edges[:, 0], root[edges[:, 1]])
        np.minimum.at(low, edges[:, 1], root[edges[:, 0]])
        low = low[low]
        if (low == root).all():
            break
        root = low
    return root
