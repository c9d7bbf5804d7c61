"""Flats stay congruent in the atlas, and bolt holes round, at the bound of 1.05."""

from __future__ import annotations

import numpy as np
import pytest

import circparam
from circparam.core.arrays import FloatArray, IntArray
from tests.support.machined import flange, shaft
from tests.support.parts import Part, circle
from tests.support.shapes import areas


def corners_of(
    part: Part, uv: FloatArray, uv_faces: IntArray, flat: int
) -> tuple[FloatArray, FloatArray]:
    """(k, 3) points of the corners of a flat, and (k, 2) their places."""
    faces = part.surface == flat
    key, first = np.unique(uv_faces[faces].ravel(), return_index=True)
    return part.points[part.faces[faces].ravel()[first]], uv[key]


def flat_bend(points: FloatArray, places: FloatArray) -> float:
    """The largest change of a distance between two corners of a flat, over the longest such distance.

    Distances in uv are scaled to fit those of the part as well as can be. A flat in pieces counts as a whole.
    """
    a, b = np.triu_indices(len(points), 1)
    true = np.linalg.norm(points[a] - points[b], axis=1)
    seen = np.linalg.norm(places[a] - places[b], axis=1)
    scale = (true * seen).sum() / (seen * seen).sum()
    return float(np.abs(scale * seen - true).max() / true.max())


def ovality(points: FloatArray, places: FloatArray, middle: FloatArray) -> float:
    """Longest over shortest radius, less 1, of the hole of a flat round a point, a circle in the part."""
    off = np.linalg.norm(points[:, :2] - middle, axis=1)
    ring = places[off < off.min() * (1 + 1e-6)]
    radius = np.linalg.norm(ring - ring.mean(0), axis=1)
    return float(radius.max() / radius.min() - 1)


BENT = 0.01  # of the size of a flat: what an eye sees beside a straight edge
OVAL = 0.02  # of the radius of a hole: a texel where it is 100 texels wide


@pytest.mark.parametrize("make", [flange, shaft])
def test_flats_stay_congruent_and_holes_round(make):
    part = make()
    quick = {"pack_splits": 0, "resolution": 512}  # the page is no part of the promise
    result = circparam.unwrap((part.points, part.faces), max_distortion=1.05, **quick)
    assert result.status == "ok"
    area = areas(part.points[part.faces])
    share = np.bincount(part.surface, area, len(part.flat)) / area.sum()
    for flat in np.flatnonzero(part.flat & (share >= 0.05)).tolist():
        points, places = corners_of(part, result.uv, result.uv_faces, flat)
        assert flat_bend(points, places) < BENT, flat
        for bolt in circle(6, 0.77) if make is flange and flat < 2 else ():
            assert ovality(points, places, bolt) < OVAL, flat
