"""Gradients of a layout in space: what they say of the layout, and how they turn from face to face."""

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.geometry.gradient_transfer import spread
from tests.support import shapes
from tests.support.atlases import middles, uncut


def bent(points: FloatArray, angle: float) -> FloatArray:
    """A flat sheet over 0..1 bent up by an angle along the line x = ½."""
    out = points.copy()
    beyond = np.maximum(points[:, 0] - 0.5, 0)
    out[:, 0] = np.minimum(points[:, 0], 0.5) + beyond * np.cos(angle)
    out[:, 2] = beyond * np.sin(angle)
    return out


def test_spread_unrolls_a_bent_sheet_from_what_is_known() -> None:
    points, faces = shapes.grid(9, 5)
    angle = 0.8
    atlas = uncut(bent(points, angle), faces)
    middle = middles(atlas.surface)
    known = middle[:, 0] < 0.2
    gradients = np.zeros((len(known), 2, 3))
    gradients[known] = [[1, 0, 0], [0, 1, 0]]
    found, have = spread(atlas, gradients, known)
    assert have.all()
    beyond = middle[:, 2] > 0
    assert beyond.any()
    across = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0]])
    wanted = np.where(beyond[:, None, None], across, np.eye(3)[:2])
    np.testing.assert_allclose(found, wanted, atol=1e-9)
