"""Textured glTF models, and what their materials show at points of the surface, looked up in another way.

The look-up reads the JSON by itself and samples with scipy's ``map_coordinates``, face by face.
"""

import io
from typing import Any

import numpy as np
from PIL import Image
from scipy.ndimage import map_coordinates

from circparam.core.arrays import FloatArray, IntArray
from circparam.formats.gltf.document import GltfDocument
from tests.support.formats_tools import GltfMaker, grid
from tests.support.shapes import areas

MODES = {10497: "grid-wrap", 33648: "reflect", 33071: "nearest"}


def waves(seed: int, n: int = 64, alpha: bool = False) -> np.ndarray:
    """(n, n, 3 or 4) a smooth picture that goes on where it is repeated."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n)
    layers = []
    for _ in range(4 if alpha else 3):
        a, b = rng.integers(-2, 3, 2)
        layers.append(0.5 + 0.45 * np.sin(2 * np.pi * (a * x + b * y + rng.random())))
    return np.round(np.stack(layers, 2) * 255).astype(np.uint8)


def bumps(seed: int, n: int = 64) -> np.ndarray:
    """(n, n, 3) a normal map of smooth bumps."""
    height = waves(seed, n)[..., 0] / 255
    slope = np.gradient(np.pad(height, 1, mode="wrap"))
    vector = np.stack([-3 * slope[1], 3 * slope[0], np.ones((n + 2, n + 2))], 2)[1:-1, 1:-1]
    vector /= np.linalg.norm(vector, axis=2, keepdims=True)
    return np.round((0.5 + 0.5 * vector) * 255).astype(np.uint8)


def image_bytes(array: np.ndarray, kind: str = "PNG") -> bytes:
    out = io.BytesIO()
    Image.fromarray(array).save(out, kind, **({"lossless": True} if kind == "WEBP" else {}))
    return out.getvalue()


class Painted(GltfMaker):
    """A glTF maker that takes images."""

    def texture(self, array: np.ndarray | bytes, wrap: int = 10497, **sampler: int) -> int:
        data = array if isinstance(array, bytes) else image_bytes(array)
        for kind in ("images", "textures", "samplers"):
            self.tree.setdefault(kind, [])
        self.tree["images"].append({"bufferView": self.view(data), "mimeType": "image/png"})
        self.tree["samplers"].append({"wrapS": wrap, "wrapT": wrap, **sampler})
        last = len(self.tree["textures"])
        self.tree["textures"].append({"source": last, "sampler": last})
        return last


def sheet(n: int = 9) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
    """A wavy sheet: (points, faces, normals, uv in the unit square, v down)."""
    points, faces = grid(n)
    points = (points * [1, 1, 0.3] / (n - 1)).astype(np.float32)
    normal = np.zeros((len(points), 3))
    a, b, c = (points[faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    for k in range(3):
        np.add.at(normal, faces[:, k], flat)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return points, faces, normal.astype(np.float32), points[:, :2].astype(np.float32)


def turned(uv: FloatArray, angle: float, scale: float = 1.0, offset: float = 0.0) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return (uv @ np.array([[c, -s], [s, c]]) * scale + offset).astype(np.float32)


def model(materials: list[dict[str, Any]], g: Painted, sets: int = 2) -> Painted:
    """A node for each material: a wavy sheet with uv sets that are turned and go beyond the unit square."""
    points, faces, normal, uv = sheet()
    meshes, nodes = [], []
    for k in range(len(materials)):
        attributes = {
            "POSITION": g.accessor(points + np.float32([1.3 * k, 0, 0])),
            "NORMAL": g.accessor(normal),
        }
        for number in range(sets):
            layout = turned(uv, 0.4 + k + number, 1.2, 0.3 * number)
            attributes[f"TEXCOORD_{number}"] = g.accessor(layout)
        meshes.append({"primitives": [g.primitive(attributes, faces, material=k)]})
        nodes.append({"mesh": k})
    g.tree |= {"materials": materials, "meshes": meshes}
    g.scene(*nodes)
    return g


def linear(c: FloatArray) -> FloatArray:
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def srgb(c: FloatArray) -> FloatArray:
    c = np.clip(c, 0, 1)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


def look_up(
    document: GltfDocument, info: dict, face: IntArray, bary: FloatArray, colour: bool
) -> FloatArray:
    """(p, 4) what a texture shows, linear."""
    tree = document.tree
    texture = tree.json["textures"][info["index"]]
    entry = tree.json["images"][texture["source"]]
    if "uri" in entry:
        data = (document.source.folder / entry["uri"]).read_bytes()
    else:
        data = bytes(tree.view(entry["bufferView"], "")[0])
    image = np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"), np.float64) / 255
    if colour:
        image = np.concatenate([linear(image[..., :3]), image[..., 3:]], 2)
    moved = info.get("extensions", {}).get("KHR_texture_transform", {})
    layout = document.uv(moved.get("texCoord", info.get("texCoord", 0)))
    uv = (layout.uv[layout.uv_faces[face]] * bary[..., None]).sum(1)
    uv[:, 1] = 1 - uv[:, 1]
    uv = uv * moved.get("scale", [1, 1])
    r = moved.get("rotation", 0.0)
    turn = np.array([[np.cos(r), -np.sin(r)], [np.sin(r), np.cos(r)]])
    uv = uv @ turn + moved.get("offset", [0, 0])
    h, w = image.shape[:2]
    sampler = tree.json["samplers"][texture["sampler"]] if "sampler" in texture else {}
    mode = MODES[sampler.get("wrapS", 10497)]
    at = [uv[:, 1] * h - 0.5, uv[:, 0] * w - 0.5]
    return np.stack([map_coordinates(image[..., k], at, order=1, mode=mode) for k in range(4)], 1)


def seen(document: GltfDocument, face: IntArray, bary: FloatArray) -> dict[str, FloatArray]:
    """Base colour, alpha, metallic-roughness, occlusion and emissive at points, by the rules of glTF 2.0,
    3.9."""
    size = [len(p.triangles) for p in document.primitives]
    meshes = document.tree.json["meshes"]
    entries = [meshes[p.mesh]["primitives"][p.number] for p in document.primitives]
    of = np.repeat([e.get("material", -1) for e in entries], size)[face]
    n = len(face)
    out = {
        "base": np.zeros((n, 3)), "alpha": np.zeros((n, 1)), "mr": np.zeros((n, 2)),
        "occlusion": np.ones((n, 1)), "emissive": np.zeros((n, 3)),
    }  # fmt: skip
    for k in np.unique(of).tolist():
        material = {} if k < 0 else document.tree.json["materials"][k]
        at = np.flatnonzero(of == k)

        def image(info: dict | None, colour: bool, at: IntArray = at) -> FloatArray:
            if info is None:
                return np.ones((len(at), 4))
            return look_up(document, info, face[at], bary[at], colour)

        pbr = material.get("pbrMetallicRoughness", {})
        base = image(pbr.get("baseColorTexture"), True) * pbr.get("baseColorFactor", [1, 1, 1, 1])
        out["base"][at], out["alpha"][at] = srgb(base[:, :3]), base[:, 3:]
        mr = image(pbr.get("metallicRoughnessTexture"), False)[:, 1:3]
        out["mr"][at] = mr * [pbr.get("roughnessFactor", 1), pbr.get("metallicFactor", 1)]
        info = material.get("occlusionTexture")
        strength = (info or {}).get("strength", 1)
        out["occlusion"][at] = 1 + strength * (image(info, False)[:, :1] - 1)
        glow = image(material.get("emissiveTexture"), True)[:, :3]
        out["emissive"][at] = srgb(glow * material.get("emissiveFactor", [0, 0, 0]))
    return out


def surface_points(document: GltfDocument, n: int = 20_000) -> tuple[IntArray, FloatArray]:
    """(face, barycentric coordinates) of points spread evenly over the surface."""
    rng = np.random.default_rng(4)
    area = areas(document.mesh.points[document.mesh.faces])
    return rng.choice(len(area), n, p=area / area.sum()), rng.dirichlet([1, 1, 1], n)


FINE = 8  # look-ups along each side of a texel, whose mean a texel is compared with
COLOURS = ("base", "emissive")  # that ``seen`` gives coded as sRGB; their means are those of light


def texel_levels(
    old: GltfDocument, new: GltfDocument, face_map: IntArray, side: int, n: int
) -> dict[str, float]:
    """PSNR of each map: n texels that lie in one face, beside the mean of FINE × FINE look-ups in each.

    face_map: face of the old document of each face of the new one. side: texels of the page.
    """
    layout = new.uv()
    face, bary = surface_points(new, 40 * n)
    corners = layout.uv[layout.uv_faces[face]] * side
    texel = np.floor((corners * bary[..., None]).sum(1))
    inside = np.min([barycentric(corners, texel + at).min(1) for at in np.ndindex(2, 2)], axis=0)
    chosen = np.flatnonzero(inside >= 0)[:n]
    face, corners, texel = face[chosen], corners[chosen], texel[chosen]
    shown = seen(new, face, barycentric(corners, texel + 0.5))
    sums: dict[str, np.ndarray] = {}
    for at in np.ndindex(FINE, FINE):
        place = barycentric(corners, texel + (np.array(at) + 0.5) / FINE)
        for name, value in seen(old, face_map[face], place).items():
            light = linear(value) if name in COLOURS else value
            sums[name] = sums.get(name, 0) + light / FINE**2
    return {k: psnr(srgb(v) if k in COLOURS else v, shown[k]) for k, v in sums.items()}


def barycentric(corners: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(p, 3) coordinates of places (p, 2) in triangles (p, 3, 2)."""
    a, b, d = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], at - corners[:, 0]
    whole = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    v = (d[:, 0] * b[:, 1] - d[:, 1] * b[:, 0]) / whole
    w = (a[:, 0] * d[:, 1] - a[:, 1] * d[:, 0]) / whole
    return np.stack([1 - v - w, v, w], 1)


def psnr(a: FloatArray, b: FloatArray) -> float:
    """Peak signal to noise of values 0..1, in dB."""
    return float(-10 * np.log10(max(((a - b) ** 2).mean(), 1e-12)))
