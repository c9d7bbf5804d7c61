"""A lantern of two textured materials, for what carries textures into a new layout."""

from __future__ import annotations

import numpy as np
from samplekit import Sample, gltf, png, rounded, tuples, turned


def lantern() -> Sample:
    """A lantern: metal with normal and roughness textures that repeat, and a globe that shines."""
    metal = np.array(
        [[0.02, 1.5], [0.1, 1.45], [0.12, 1.3], [0.5, 1.15], [0.52, 1.05], [0.4, 1.0], [0.4, 0.95]]
    )
    foot = np.array([[0.4, 0.2], [0.42, 0.15], [0.6, 0.1], [0.62, 0.02], [0.55, 0.0], [0.02, 0.0]])
    t = np.linspace(0, 1, 9)
    globe = np.stack([0.34 + 0.12 * np.sin(np.pi * t), 0.97 - 0.8 * t], 1)
    roof, base, light = (turned(profile, 24) for profile in (metal, foot, globe))
    frame = (*(np.concatenate([roof[k], base[k]]) for k in (0, 1)), joined(roof, base))
    normals = [
        np.concatenate([around(profile, 24) for profile in (metal, foot)]), around(globe, 24),
    ]  # fmt: skip
    parts = [("frame", *frame, {}), ("globe", *light, {})]
    repeat = {"KHR_texture_transform": {"scale": [6.0, 1.5], "rotation": 0.3}}
    iron = {
        "name": "iron",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicRoughnessTexture": {"index": 1, "extensions": repeat},
        },
        "normalTexture": {"index": 2, "extensions": repeat, "scale": 0.7},
    }
    glass = {
        "name": "glass",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 3}, "metallicFactor": 0.0, "roughnessFactor": 0.2,
        },
        "emissiveTexture": {"index": 4},
        "emissiveFactor": [1.0, 0.8, 0.5],
    }  # fmt: skip
    pictures = [png(picture) for picture in paint(48)]
    points, faces = np.concatenate([frame[0], light[0]]), joined(frame, light)
    s = Sample("lantern", "a textured GLB: two materials with five textures", points, tuples(faces))
    s.files["lantern.glb"] = gltf(parts, pictures, [iron, glass], normals)
    return s


def joined(a: tuple[np.ndarray, ...], b: tuple[np.ndarray, ...]) -> np.ndarray:
    """The faces of two bodies (points, uv, faces) over the points of both."""
    return np.concatenate([a[2], b[2] + len(a[0])])


def around(profile: np.ndarray, count: int) -> np.ndarray:
    """The normals of a body of revolution, point for point as ``turned`` makes it."""
    slope = np.gradient(profile, axis=0)
    out = np.stack([-slope[:, 1], slope[:, 0]], 1)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    a = np.repeat(2 * np.pi * np.arange(count + 1) / count, len(profile))
    r, y = np.tile(out, (count + 1, 1)).T
    normal = np.stack([r * np.cos(a), y, -r * np.sin(a)], 1)
    normal[-len(profile) :] = normal[: len(profile)]
    return rounded(normal)


def paint(side: int) -> list[np.ndarray]:
    """Rust, roughness with metal, hammered normals, glass with bars, and the light behind them."""
    y, x = np.mgrid[:side, :side] / side * 2 * np.pi
    rust = 0.5 + 0.25 * np.sin(3 * x + np.sin(2 * y)) + 0.25 * np.sin(5 * y + np.cos(3 * x))
    iron = np.stack([70 + 110 * rust, 66 + 40 * rust, 64 + 6 * rust], 2)
    rough = np.stack([0 * x, 255 * (0.35 + 0.5 * rust), 255 * (1 - 0.6 * rust)], 2)
    dx, dy = np.cos(4 * x) * np.sin(4 * y), np.sin(4 * x) * np.cos(4 * y)
    bump = np.stack([-0.5 * dx, 0.5 * dy, np.ones_like(x)], 2)
    bump /= np.linalg.norm(bump, axis=2, keepdims=True)
    bars = (np.abs(np.sin(4 * x)) < 0.2)[..., None]
    glass = np.where(bars, [40, 36, 34], [250, 226, 170])
    light = np.where(bars, 0, 255 * np.exp(-((y / np.pi - 1) ** 2) * 3)[..., None]) * [1, 0.9, 0.6]
    pictures = (iron, rough, 127.5 + 127.5 * bump, glass, light)
    return [np.clip(np.round(p), 0, 255).astype(np.uint8) for p in pictures]
