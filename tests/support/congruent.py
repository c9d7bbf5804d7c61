"""How far an atlas bends the flats of a part, seen with the eye of somebody who paints them."""

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from tests.support.parts import Part
from tests.support.shapes import areas


def flat_bend(part: Part, uv: FloatArray, uv_faces: IntArray, flat: int) -> float:
    """The largest change of a distance between two corners of a flat, over the longest such distance.

    Distances in uv are scaled to fit those of the part as well as can be. A flat in pieces counts as a whole.
    """
    faces = part.surface == flat
    key, first = np.unique(uv_faces[faces].ravel(), return_index=True)
    points, places = part.points[part.faces[faces].ravel()[first]], uv[key]
    a, b = np.triu_indices(len(key), 1)
    true = np.linalg.norm(points[a] - points[b], axis=1)
    seen = np.linalg.norm(places[a] - places[b], axis=1)
    scale = (true * seen).sum() / (seen * seen).sum()
    return float(np.abs(scale * seen - true).max() / true.max())


def ovality(part: Part, uv: FloatArray, uv_faces: IntArray, flat: int, x: float, y: float) -> float:
    """Longest over shortest radius, less 1, of the hole of a flat round (x, y), a circle in the part."""
    faces = part.surface == flat
    key, first = np.unique(uv_faces[faces].ravel(), return_index=True)
    off = np.linalg.norm(part.points[part.faces[faces].ravel()[first]][:, :2] - [x, y], axis=1)
    ring = uv[key[off < off.min() * (1 + 1e-6)]]
    radius = np.linalg.norm(ring - ring.mean(0), axis=1)
    return float(radius.max() / radius.min() - 1)


def large_flats(part: Part, least: float = 0.05) -> IntArray:
    """Numbers of the flats with at least that share of the area of the part."""
    area = areas(part.points[part.faces])
    share = np.bincount(part.surface, area, len(part.flat)) / area.sum()
    return np.flatnonzero(part.flat & (share >= least))
