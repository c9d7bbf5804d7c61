"""Maps between meshes that are known without solving anything, and a cube with normals."""

from pathlib import Path

import numpy as np

from circparam.bake.sampling import Closest
from circparam.formats.document import Document
from circparam.formats.io import read
from circparam.maps.surface_map import Places, SurfaceMap, fingerprint, save_map
from circparam.mesh.mesh import Mesh
from tests.support.baking import stored
from tests.support.bumps import belt


def closest_places(a: Mesh, b: Mesh) -> Places:
    """For every vertex of A the closest point of B."""
    face, bary, _ = Closest(b.points, b.faces).find(a.points)
    return Places(face, bary)


def known_map(a: Mesh, b: Mesh) -> SurfaceMap:
    """Of two meshes of one shape: every vertex lies where the other surface is nearest."""
    return SurfaceMap(closest_places(a, b), closest_places(b, a), fingerprint(a), fingerprint(b))


def same_map(mesh: Mesh, other: Mesh | None = None) -> SurfaceMap:
    """Of two meshes with the same faces: every vertex lies on its own number."""
    corner = np.zeros(len(mesh.points), np.int64)
    corner[mesh.faces.ravel()] = np.arange(mesh.faces.size)
    same = Places(corner // 3, np.eye(3)[corner % 3])
    return SurfaceMap(same, same, fingerprint(mesh), fingerprint(other or mesh))


def written_belts(folder: Path, tail: str = "") -> tuple[Path, Path, Path]:
    """Two meshes with uv and the map between both, as files a, b and m of a folder."""
    rows = (("a", belt(6, 12)), ("b", belt(9, 18, 0.05)))
    a, b = (stored(folder, f"{name}{tail}", *made) for name, made in rows)
    save_map(folder / f"m{tail}.npz", known_map(a.mesh, b.mesh))
    return folder / f"a{tail}.obj", folder / f"b{tail}.obj", folder / f"m{tail}.npz"


def cube_obj(folder: Path) -> Document:
    """A cube of six polygons with normals and uv of their own, as modelling programs write it."""
    lines = [f"v {k & 1} {k >> 1 & 1} {k >> 2}" for k in range(8)]
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    lines += ["vn 0 0 -2", "vn 0 0 1", "vn 0 -1 0", "vn 0 1 0", "vn -1 0 0", "vn 1 0 0"]
    corners = ((0.02, 0.02), (0.3, 0.02), (0.3, 0.45), (0.02, 0.45))
    lines += [f"vt {k % 3 / 3 + a} {k // 3 / 2 + b}" for k in range(6) for a, b in corners]
    for k, side in enumerate(sides):
        words = [f"{a + 1}/{4 * k + j + 1}/{k - 6}" for j, a in enumerate(side)]
        lines.append(" ".join(["f", *words]))
    (folder / "cube.obj").write_text("\n".join(lines) + "\n")
    return read(folder / "cube.obj")
