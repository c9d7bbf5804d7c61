"""Sheets with colours and textures, and what a renderer shows of a baked layout."""

from pathlib import Path

import numpy as np
from PIL import Image

from circparam.bake.bake import Baked, tiles_of
from circparam.core.arrays import FloatArray, IntArray
from circparam.formats.document import Document
from circparam.formats.io import read
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.texture import bilinear
from tests.support.shapes import sheet_faces
from tests.support.writers import obj


def sheet(n: int) -> tuple[FloatArray, np.ndarray]:
    """The unit square as an n × n grid of squares, in space."""
    g = np.linspace(0, 1, n + 1)
    x, y = np.meshgrid(g, g)
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1), sheet_faces(n, n)


def smooth(p: FloatArray) -> FloatArray:
    """A colour for every point of the sheet."""
    return np.stack([p[:, 0], p[:, 1], 0.5 + 0.5 * np.sin(3 * p[:, 0]) * np.cos(2 * p[:, 1])], 1)


def charts(points: FloatArray, faces: np.ndarray) -> UVMap:
    """The sheet as two charts, cut at x = 1/2, turned and set apart."""
    left = points[faces].mean(1)[:, 0] < 0.5
    a = points[:, :2] * [0.8, 0.8] + [0.05, 0.1]
    b = points[:, [1, 0]] * [0.8, -0.8] + [0.05, 0.0]
    b[:, 1] += 0.98 - b[:, 1].max()
    scale = np.array([0.5, 1.0])
    uv = np.concatenate([a * scale, b * scale + [0.5, 0.0]])
    return UVMap(uv, np.where(left[:, None], faces, faces + len(points)))


def some_places(m: int, n: int = 4000) -> tuple[np.ndarray, FloatArray]:
    rng = np.random.default_rng(5)
    bary = rng.dirichlet([1, 1, 1], n)
    return rng.integers(0, m, n), bary


def write_obj(
    path: Path, points: FloatArray, layout: UVMap, faces: np.ndarray, colours=None, mtl=""
):
    """An OBJ with uv, perhaps with colours, perhaps with the material m of a library."""
    rows = points if colours is None else np.concatenate([points, colours], 1)
    given = {"materials": {"m": np.ones(len(faces), bool)}, "library": mtl} if mtl else {}
    path.write_bytes(obj(rows, faces, layout.uv, layout.uv_faces, **given))


def stored(folder: Path, name: str, mesh: Mesh, layout: UVMap, mtl: str = "") -> Document:
    """The document of an OBJ with a layout."""
    write_obj(folder / f"{name}.obj", mesh.points, layout, mesh.faces, mtl=mtl)
    return read(folder / f"{name}.obj")


def noise(path: Path, size: int = 256) -> FloatArray:
    """A picture with detail of eight texels, and its values."""
    grid = np.random.default_rng(3).random((size // 8, size // 8, 3)) * 255
    image = Image.fromarray(grid.astype(np.uint8)).resize((size, size), Image.Resampling.BICUBIC)
    image.save(path)
    return np.asarray(image, float) / 255


def picture(path: Path, n: int = 128) -> None:
    """A smooth image, bright where u and v are large."""
    x, y = np.meshgrid((np.arange(n) + 0.5) / n, 1 - (np.arange(n) + 0.5) / n)
    rgb = np.stack([x, y, 0.5 + 0.4 * np.sin(4 * x + 3 * y)], 2)
    Image.fromarray(np.round(rgb * 255).astype(np.uint8)).save(path)


def sample_back(baked: Baked, layout: UVMap, face: IntArray, bary: FloatArray) -> FloatArray:
    """(p, c) colours of a baked layout at places of the surface, 0..1."""
    tile = tiles_of(layout)[face]
    uv = np.einsum("pk,pkc->pc", bary, layout.uv[layout.uv_faces[face]]) - tile
    first = next(iter(baked.tiles.values()))
    out = np.zeros((len(face), first.shape[2]))
    for (u, v), image in baked.tiles.items():
        at = np.flatnonzero((tile == (u, v)).all(1))
        out[at] = bilinear(image.astype(np.float64) / 255, uv[at])
    return out


def back(baked: Baked, folder: Path) -> float:
    """Mean error of the baked layout against the old texture, over the surface."""
    new, old = read(folder / "new.obj"), read(folder / "old.obj")
    face, bary = some_places(len(new.mesh.faces))
    layout, before = new.uv(), old.uv()
    image = np.asarray(Image.open(folder / "skin.png").convert("RGB"), float) / 255
    there = np.einsum("pk,pkc->pc", bary, before.uv[before.uv_faces[face]])
    # away from the texture's own edge, where repeating mixes both sides
    inner = ((there > 0.02) & (there < 0.98)).all(1)
    error = np.abs(sample_back(baked, layout, face, bary) - bilinear(image, there))[inner]
    return float(error.mean())


def old_and_new(folder: Path, n: int, side: int = 128) -> tuple[FloatArray, np.ndarray]:
    """old.obj, a sheet with a texture, and new.obj, the same faces in another layout; its points and faces."""
    points, faces = sheet(n)
    picture(folder / "skin.png", side)
    (folder / "m.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd .\\skin.png\n")
    write_obj(folder / "old.obj", points, UVMap(points[:, :2].copy(), faces), faces, mtl="m.mtl")
    write_obj(folder / "new.obj", points, charts(points, faces), faces)
    return points, faces
