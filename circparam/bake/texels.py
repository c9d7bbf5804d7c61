"""The surface point of each texel of a layout, and the distance of neighbouring texels in an old layout.

A texel whose centre a face covers shows the point under its centre. The ring of texels round a chart shows the
nearest point of the chart. A bilinear sample at the very edge therefore has the colour of that edge.
"""

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation, distance_transform_edt

from circparam.core.arrays import cross_areas
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.geometry.raster import fragments
from circparam.mesh.mesh import UVMap

Places: TypeAlias = Iterator[npt.NDArray[np.float32]]
FLAT_AREA_TEXELS2 = 1e-12  # texels²: below that a triangle has no inside to find places in
# of the texels: more of them in several faces are overlaps, not shared borders
DOUBLED_SHARE = 1e-3
NO_TEXEL = "no texel lies in a face: the layout is too small, pack it first"


@dataclass(frozen=True, eq=False)
class Texels:
    """The texels of a page.

    pixel: (p,) those with a surface point, row · size + column from the top. face: (p,) the face of each.
    nearest: (size²,) the texel that gives the colour of every texel: the texel itself if it has a point. twice:
    number of texels under several faces. covered: number with their centre in a face.
    """

    size: int
    pixel: IntArray
    face: IntArray
    nearest: IntArray
    twice: int
    covered: int


def corners_in_texels(layout: UVMap, size: int) -> FloatArray:
    """(m, 3, 2) corners of faces in texels, y down; NaN for faces without uv."""
    uv = layout.corners
    xy = np.stack([uv[..., 0], 1 - uv[..., 1]], 2) * size
    xy[~layout.laid] = np.nan
    return xy


def doubled_notes(twice: int, covered: int) -> list[str]:
    """The note on a layout with too many of its covered texels in several faces."""
    if twice <= DOUBLED_SHARE * covered:
        return []
    share = 100 * twice / covered
    return [f"{share:.1f} % of the texels lie in several faces: unwrap or pack again"]


def find_texels(layout: UVMap, size: int) -> Texels:
    """The texels of a layout on one page. Raises InputError if no texel lies in a face."""
    xy = corners_in_texels(layout, size)
    owner = np.full(size * size, -1, np.int32)
    tried = 0
    for part in fragments(xy, size, size):
        owner[part.pixel] = part.face
        tried += len(part.pixel)
    middle = xy.mean(1)
    at = np.flatnonzero(np.isfinite(middle).all(1) & ((middle >= 0) & (middle < size)).all(1))
    texel = middle[at, 1].astype(np.int64) * size + middle[at, 0].astype(np.int64)
    bare = owner[texel] < 0  # a chart between the centres of texels has a texel all the same
    owner[texel[bare]] = at[bare]
    inside = (owner >= 0).reshape(size, size)
    covered = int(np.count_nonzero(inside))
    if covered == 0:
        raise InputError(NO_TEXEL)
    places: npt.NDArray[np.int32] = distance_transform_edt(
        ~inside, return_distances=False, return_indices=True
    )
    nearest = (places[0] * np.int64(size) + places[1]).ravel()
    ring = np.flatnonzero((binary_dilation(inside, np.ones((3, 3), bool)) & ~inside).ravel())
    owner[ring] = owner[nearest[ring]]
    nearest[ring] = ring
    pixel = np.flatnonzero(owner >= 0)
    return Texels(size, pixel, owner[pixel].astype(np.int64), nearest, tried - covered, covered)


def places_in(xy: FloatArray, face: IntArray, pixel: IntArray, size: int, samples: int) -> Places:
    """Barycentric coordinates of samples of texels, moved into their faces: samples² arrays (3, p).

    Samples lie at the middles of a samples × samples grid in each texel. float32 is 1e-7 of a face, far below a
    texel.
    """
    a = xy[:, 1] - xy[:, 0]
    b = xy[:, 2] - xy[:, 0]
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    scale = np.where(np.abs(det) > FLAT_AREA_TEXELS2, 1 / np.where(det == 0, 1.0, det), 0.0)
    # v = ∇v · (p − corner 0), w alike
    gradient = np.stack([b[:, 1], -b[:, 0], -a[:, 1], a[:, 0]]) * scale
    vx, vy, wx, wy = gradient[:, face]
    dx, dy = pixel % size - xy[face, 0, 0], pixel // size - xy[face, 0, 1]
    v0, w0 = dx * vx + dy * vy, dx * wx + dy * wy
    step = (np.arange(samples) + 0.5) / samples
    for sy in step.tolist():
        for sx in step.tolist():
            out = np.empty((3, len(face)), np.float32)
            out[1], out[2] = v0 + sx * vx + sy * vy, w0 + sx * wx + sy * wy
            np.subtract(1 - out[1], out[2], out=out[0])
            np.maximum(out, 0, out=out)
            out /= out[0] + out[1] + out[2]
            yield out


def flat_areas(corners: FloatArray) -> FloatArray:
    """(m,) areas of triangles (m, 3, 2)."""
    return np.abs(cross_areas(corners)) / 2


def density(old: FloatArray, new: FloatArray) -> FloatArray:
    """(m,) number of texels of an old image along one texel of a new one: √ of the ratio of areas.

    old, new: (m, 3, 2) corners in texels. NaN if a face has no area in either.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.sqrt(flat_areas(old) / flat_areas(new))
    return np.where(np.isfinite(out), out, np.nan)
