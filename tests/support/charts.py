"""Shapes as cut mesh, and comparisons up to a similarity, for the tests of weights, borders and methods."""

from typing import Any

import numpy as np

from circparam.core.monitor import Monitor
from circparam.geometry.overlap import overlaps
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import shared_edges
from circparam.methods import METHODS
from circparam.methods.base import Layout, MethodOptions
from tests.support.atlases import uncut
from tests.support.shapes import delaunay_disk


def patches_of(shape) -> tuple[CutMesh, np.ndarray]:
    """(cut mesh, (n_vertices, 3) position of each vertex) of an uncut shape."""
    atlas = uncut(*shape)
    return atlas.cut_mesh(), atlas.surface.vertex_points


def flat_of(shape) -> tuple[CutMesh, np.ndarray]:
    """(cut mesh, (n_vertices, 2) places) of an uncut flat shape as it lies."""
    cut_mesh, points = patches_of((np.c_[shape[0][:, :2], np.zeros(len(shape[0]))], shape[1]))
    return cut_mesh, points[:, :2].copy()


def flattened(name: str, cut_mesh: CutMesh, **options: Any) -> Layout:
    """What a method makes of a cut mesh, with these of its options."""
    return METHODS[name].function(cut_mesh, MethodOptions(**options), Monitor())


def too_near(cut_mesh: CutMesh, uv: np.ndarray, margin: float) -> np.ndarray:
    """(n_charts,) bool: overlaps itself, or has two parts of its boundary within that share of its size."""
    found = overlaps(cut_mesh, uv)
    return found.self_overlapping | (found.near(margin, ~found.self_overlapping) > 0)


def charts_of(faces, uv, chart=None) -> tuple[CutMesh, np.ndarray]:
    """Charts in the plane (one, or labels (m,)) as a cut mesh, joined where faces share two vertices."""
    chart = np.zeros(len(faces), np.int64) if chart is None else chart
    return CutMesh(faces, uv[faces], chart, shared_edges(faces)), uv


def complex_of(uv) -> np.ndarray:
    return uv[:, 0] + 1j * uv[:, 1]


def fitted(uv, target) -> np.ndarray:
    """uv moved by the orientation-preserving similarity that brings it nearest to target."""
    a, b = complex_of(uv), complex_of(target)
    da, db = a - a.mean(), b - b.mean()
    z = da * (np.vdot(da, db) / np.vdot(da, da)) + b.mean()
    return np.stack([z.real, z.imag], 1)


def apart(uv, target) -> float:
    """Largest distance after the best similarity, as a share of the target's size."""
    return float(np.abs(fitted(uv, target) - target).max() / np.abs(target - target.mean(0)).max())


def rim(cut_mesh) -> np.ndarray:
    """(n_vertices,) bool: on a border."""
    out = np.zeros(cut_mesh.n_vertices, bool)
    out[cut_mesh.faces.ravel()[cut_mesh.boundary]] = True
    return out


def tangled(n: int = 400, seed: int = 0) -> tuple[CutMesh, np.ndarray]:
    """A flat disk with some inner vertices thrown about."""
    cut_mesh, uv = flat_of(delaunay_disk(n, seed))
    generator = np.random.default_rng(seed)
    inner = np.flatnonzero(~rim(cut_mesh))
    chosen = generator.choice(inner, max(1, len(inner) // 20), replace=False)
    uv[chosen] += generator.normal(0, 0.15, (len(chosen), 2))
    return cut_mesh, uv
