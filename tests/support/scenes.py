"""Small meshes with uv, as scenes to draw."""

import numpy as np

from circparam.render.scene import make_scene
from tests.support.shapes import annulus

QUAD = np.array([[0, 1, 2], [0, 2, 3]])


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
IN_SPACE = np.c_[SQUARE, np.zeros(4)]


def cube():
    """A cube of side 2 about the origin; every side a chart of its own in a 3 × 2 grid."""
    points, faces, uv, uv_faces = [], [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            centre = np.zeros(3)
            centre[axis] = sign
            a = np.roll([0.0, 1.0, 0.0], axis)
            b = np.cross(centre, a)
            first, k = len(points), len(points) // 4
            for s, t in SQUARE:
                points.append(centre + (2 * s - 1) * a + (2 * t - 1) * b)
                uv.append([(k % 3 + 0.1 + 0.8 * s) / 3, (k // 3 + 0.1 + 0.8 * t) / 2])
            faces += (QUAD + first).tolist()
            uv_faces += (QUAD + first).tolist()
    return np.array(points), np.array(faces), np.array(uv), np.array(uv_faces)


def squares(n: int, flip: float = 1.0):
    """n × n flat squares, each a chart in its cell of the page; flip −1 turns the page."""
    cell = np.stack(np.meshgrid(np.arange(n), np.arange(n)), 2).reshape(-1, 1, 2)
    uv = ((cell + 0.1 + 0.8 * SQUARE) / n).reshape(-1, 2)
    faces = (QUAD + 4 * np.arange(n * n)[:, None, None]).reshape(-1, 3)
    points = np.c_[uv, np.zeros(len(uv))]
    return make_scene(points, faces, flip * uv + (flip < 0), faces)


def flat_quad():
    """The unit square in the plane z = 0 with itself as uv."""
    return make_scene(IN_SPACE, QUAD, SQUARE, QUAD)


def bowl():
    """A bowl that opens upwards, wound upwards."""
    points, faces = annulus(24, 7, 0.02)
    return np.stack([points[:, 1], 0.4 * (points**2).sum(1), points[:, 0]], 1), faces
