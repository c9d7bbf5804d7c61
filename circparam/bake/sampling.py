"""Colours of a surface at (face, barycentric) places: from its corners, its textures, or another surface.

A ``Paint`` is a function (face (p,) int64, bary (p, 3)) → (p, c) colours, 0..1.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from circparam.bake.texels import flat_areas
from circparam.core.arrays import interpolated, numbered_rows, slices, unit
from circparam.core.types import FloatArray, IntArray
from circparam.formats.materials import Textures, decode
from circparam.geometry.closest import Nearest, closest_on_triangles, samples_of, walked
from circparam.mesh.halfedge import faces_across, shared_edges
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.texture import bilinear

Paint: TypeAlias = Callable[[IntArray, FloatArray], FloatArray]

# Nearest samples whose faces are tried for the closest point, and steps from the best one to its neighbours.
CANDIDATE_SAMPLES = 6
# nearest samples that must look the same way: half of a thin part are on its back
FACING_SAMPLES = 24
WALK_STEPS = 8

# samples of a surface: enough for a fine sampling of small meshes, within the memory
SAMPLE_BOUNDS = (200_000, 2_000_000)

DISTANCE_SAMPLES = 300  # faces whose middle is used to measure the distance of the source
BLOCK_PLACES = 200_000  # places looked up at once: some hundred bytes each


def corner_paint(corners: FloatArray) -> Paint:
    """Colours of corners (m, 3, c), blended inside every face."""

    def paint(face: IntArray, bary: FloatArray) -> FloatArray:
        return interpolated(bary, corners[face])

    return paint


def texture_paint(textures: Textures, layout: UVMap, shrink: float = 1.0) -> tuple[Paint, int]:
    """The textures of a mesh through their own uv; returns (paint, channels: 4 where an image has alpha).

    shrink: texels of the source for one texel of the target. Above 2 the images are averaged down first, so
    fine detail does not turn into noise. Faces without image or uv take their plain colour.
    """
    pictures = [decode(*pair) for pair in zip(textures.images, textures.names, strict=True)]
    channels = 4 if any(p.mode == "RGBA" for p in pictures) else 3
    arrays = []
    for picture in pictures:
        step = int(np.clip(shrink, 1, max(min(picture.size), 1)))
        small = picture.convert("RGBA" if channels == 4 else "RGB")
        small = small.reduce(step) if step > 1 else small
        arrays.append(np.asarray(small, np.float64) / 255)
    plain = textures.plain
    if channels == 4:
        plain = np.concatenate([plain, np.ones((len(plain), 1))], 1)
    has_uv = layout.laid
    image_of = np.where(has_uv, textures.face, -1)

    def paint(face: IntArray, bary: FloatArray) -> FloatArray:
        out = plain[face]
        uv = interpolated(bary, layout.uv[np.maximum(layout.uv_faces[face], 0)])
        for k, array in enumerate(arrays):
            at = np.flatnonzero(image_of[face] == k)
            out[at] = bilinear(array, np.nan_to_num(uv[at]))
        return out

    return paint, channels


def texel_ratio(old: UVMap, old_size: float, new: UVMap, new_size: float) -> float:
    """Texels of the old layout for one texel of the new one, along a side, by the areas of both."""
    before, after = (float(flat_areas(layout.corners).sum()) for layout in (old, new))
    return float(np.sqrt(before / after) * old_size / new_size) if after > 0 else 1.0


class Closest:
    """Closest points on a surface, for many places at once.

    Every face is sampled, larger ones more often. The exact closest point is sought on the faces of the nearest
    samples. The search continues on the neighbours of the best face while one of them is nearer.
    """

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        self.corners = points[faces]
        a = self.corners[:, 1] - self.corners[:, 0]
        b = self.corners[:, 2] - self.corners[:, 0]
        normal = np.cross(a, b)
        self.normals = unit(normal)
        # sides meet by position
        self.beside = faces_across(len(faces), shared_edges(numbered_rows(points)[1][faces]))
        self.longest = float(np.sqrt(max((s * s).sum(1).max() for s in (a, b, b - a))))
        self.face, r = samples_of(np.linalg.norm(normal, axis=1), SAMPLE_BOUNDS)
        self.tree = cKDTree(
            self.corners[self.face, 0] + r[:, 1:2] * a[self.face] + r[:, 2:] * b[self.face]
        )

    def find(
        self, places: FloatArray, normals: FloatArray | None = None, far: float = np.inf
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """For places (p, 3): ((p,) face, (p, 3) barycentric coordinates, (p,) distance).

        normals: (p, 3). If given, only faces that look the same way count (all do for a normal of length 0).
        The distance is infinite if no near face does. far: beyond this distance any face may be returned, at
        its distance. An exact search from the middle of a distant ball would take hours.
        """
        if len(places) == 0:
            return np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0)
        blocks = [
            self._find(places[k], None if normals is None else normals[k], far)
            for k in slices(len(places), BLOCK_PLACES)
        ]
        face, bary, distance = (np.concatenate(part) for part in zip(*blocks, strict=True))
        return face, bary, distance

    def _find(self, places: FloatArray, normals: FloatArray | None, far: float) -> Nearest:
        """One block: the best face of the nearest samples, then its neighbours while one is nearer."""
        number = CANDIDATE_SAMPLES if normals is None else FACING_SAMPLES
        # a face that is within reach has all its samples within its longest side of that
        bound = far + self.longest
        _, near = self.tree.query(places, k=min(number, len(self.face)), distance_upper_bound=bound)
        found = self.face[np.minimum(near, len(self.face) - 1).reshape(len(places), -1)]

        def best(rows: IntArray, faces: IntArray) -> Nearest:
            return self._best(places[rows], faces, None if normals is None else normals[rows])

        return walked(best(np.arange(len(places)), found), self.beside, best, WALK_STEPS)

    def _best(
        self, places: FloatArray, candidates: IntArray, normals: FloatArray | None
    ) -> Nearest:
        """The closest of candidate faces (p, k) of each place, the point on it, and its distance."""
        bary, d2 = closest_on_triangles(places[:, None], self.corners[candidates])
        if normals is not None:
            same = np.einsum("pkc,pc->pk", self.normals[candidates], normals) > 0
            d2 = np.where(same | (normals == 0).all(1)[:, None], d2, np.inf)
        best = np.argmin(d2, axis=1)
        rows = np.arange(len(places))
        return candidates[rows, best], bary[rows, best], np.sqrt(d2[rows, best])


def apart(mesh: Mesh, closest: Closest) -> float:
    """How far a mesh lies from a surface: the mean over the middles of some faces, in sizes of the mesh."""
    corners = mesh.points[mesh.faces[:: max(1, len(mesh.faces) // DISTANCE_SAMPLES)]]
    size = float(np.linalg.norm(np.ptp(mesh.corners.reshape(-1, 3), axis=0)))
    return float(closest.find(corners.mean(1))[2].mean()) / max(size, 1e-300)


def same_surface(a: Mesh, b: Mesh) -> bool:
    """Whether two meshes are the same triangles in the same order, up to single precision."""
    if a.faces.shape != b.faces.shape:
        return False
    size = float(np.ptp(a.corners.reshape(-1, 3), axis=0).max())
    gap = np.abs(a.corners - b.corners).max()
    return bool(gap <= 1e-5 * size)
