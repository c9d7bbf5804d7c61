"""How far a map between two surfaces is from an isometry."""

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.distortion import (
    LEAST_AREA_RATIO,
    Tail,
    dirichlet_terms,
    energies_at_best_scale,
)
from circparam.mesh.cut_mesh import rest_triangles_of

MOST_ENERGY = 1e12  # of a face: one that becomes a line has none


@dataclass(frozen=True)
class Distortion:
    """Symmetric Dirichlet energy / 4 of every face, both surfaces at the scale that is best: 1 for an isometry.

    mean: by area. p95, p99: upper bounds for these shares of the area. largest.
    """

    mean: float
    p95: float
    p99: float
    largest: float

    def as_dict(self) -> dict[str, float]:
        """Plain numbers."""
        return {"mean": self.mean, "p95": self.p95, "p99": self.p99, "max": self.largest}


def distortion(points: FloatArray, faces: IntArray, images: FloatArray) -> Distortion:
    """Of the map that takes every face to the flat triangle of the images (n, 3) of its corners."""
    energy, area = face_energies(points, faces, images)
    if not (area > 0).any():
        return Distortion(1.0, 1.0, 1.0, 1.0)
    energy, area = energy[area > 0], area[area > 0]
    tail = Tail.of(energy, area)
    mean = float((energy * area).sum() / area.sum())
    return Distortion(mean, tail.percentile(95), tail.percentile(99), float(energy.max()))


def face_energies(
    points: FloatArray, faces: IntArray, images: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(energy (m,) of the same map, 1 if a face has no shape; area (m,), 0 there)."""
    rest, there = rest_triangles_of(points[faces]), rest_triangles_of(images[faces])
    longest = ((rest - np.roll(rest, 1, 1)) ** 2).sum(2).max(1)
    area = rest[:, 1, 0] * rest[:, 2, 1] / 2
    live: BoolArray = area > LEAST_AREA_RATIO * longest
    energies, areas = np.ones(len(faces)), np.where(live, area, 0.0)
    if not live.any():
        return energies, areas
    rest, there, area = rest[live], np.nan_to_num(there[live]), area[live]
    square, inverse = dirichlet_terms(rest, there)
    energies[live] = energies_at_best_scale(square, np.minimum(inverse, MOST_ENERGY), area)
    return energies, areas
