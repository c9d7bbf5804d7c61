"""Pairs of surfaces with handles: tori whose places are two angles, and plates with holes in several meshes."""

import numpy as np
from scipy.spatial import cKDTree

from circparam.mesh.mesh import Mesh, UVMap
from tests.support import shapes

# of marks round the torus: four along, three round the tube
ALONG, ROUND = 4, 3


def torus(nu: int, nv: int, bump: float = 0.0, turned: float = 0.0) -> Mesh:
    """A torus, turned: its grid begins elsewhere; bump: how much its tube swells."""
    u, v = (2 * np.pi * np.arange(n) / n + turned for n in (nu, nv))
    u, v = (a.ravel() for a in np.meshgrid(u, v, indexing="ij"))
    r = 0.4 * (1 + bump * np.sin(3 * u + v))
    far = 1 + r * np.cos(v)
    points = np.stack([far * np.cos(u), far * np.sin(u), r * np.sin(v)], 1)
    return Mesh(points, shapes.torus(nu, nv)[1])


def angles(points: np.ndarray) -> np.ndarray:
    """(n, 2) where points lie: along the torus, and round its tube."""
    far = np.hypot(points[:, 0], points[:, 1]) - 1
    return np.stack([np.arctan2(points[:, 1], points[:, 0]), np.arctan2(points[:, 2], far)], 1)


def turns(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m,) signed areas of faces in both angles: of sum 1 where they cover the torus once."""
    corner = angles(points)[faces]
    step = np.diff(np.concatenate([corner, corner[:, :1]], 1), axis=1)
    step = (step + np.pi) % (2 * np.pi) - np.pi
    cross = step[:, 0, 0] * step[:, 1, 1] - step[:, 0, 1] * step[:, 1, 0]
    return cross / (8 * np.pi**2)


def marks(a: Mesh, b: Mesh, along: int = ALONG, around: int = ROUND) -> np.ndarray:
    """(k, 2) vertices of two tori at the same angles."""
    u, v = np.meshgrid(
        2 * np.pi * np.arange(along) / along, 2 * np.pi * np.arange(around) / around, indexing="ij"
    )
    goal = np.stack([np.cos(u), np.sin(u), np.cos(v), np.sin(v)], -1).reshape(-1, 4)
    out = []
    for mesh in (a, b):
        x = angles(mesh.points)
        own = np.stack([np.cos(x[:, 0]), np.sin(x[:, 0]), np.cos(x[:, 1]), np.sin(x[:, 1])], 1)
        out.append(cKDTree(own).query(goal)[1])
    return np.stack(out, 1).astype(np.int64)


def plate(refine: int = 3, fine: bool = False) -> Mesh:
    """A rounded plate with two holes (genus 2); fine: the same surface, every face in four, in another
    order."""
    p, f = shapes.double_torus(refine)
    if not fine:
        return Mesh(p, f)
    p, f = shapes.subdivide(p, f)
    order = np.random.default_rng(0).permutation(len(p))
    return Mesh(p[order], np.argsort(order)[f][::-1])


def spread(mesh: Mesh, k: int) -> np.ndarray:
    """(k,) vertices far from each other."""
    p = mesh.points
    out = [int(np.linalg.norm(p - p.mean(0), axis=1).argmax())]
    far = np.full(len(p), np.inf)
    while len(out) < k:
        far = np.minimum(far, np.linalg.norm(p - p[out[-1]], axis=1))
        out.append(int(far.argmax()))
    return np.array(out)


def patchwork(nu: int, nv: int, along: int, around: int, bump: float = 0.0) -> tuple[Mesh, UVMap]:
    """A torus whose uv are along × around rectangular charts; along and around divide nu and nv."""
    mesh = torus(nu, nv, bump)
    centre = angles(mesh.points[mesh.faces].mean(1))
    index = np.floor(centre % (2 * np.pi) / (2 * np.pi) * [along, around]).astype(int)
    chart = index[:, 0] * around + index[:, 1]
    corner = angles(mesh.points)[mesh.faces] % (2 * np.pi)
    uv = (corner + 10 * chart[:, None, None]).reshape(-1, 2)
    return mesh, UVMap(uv, np.arange(mesh.faces.size).reshape(-1, 3))
