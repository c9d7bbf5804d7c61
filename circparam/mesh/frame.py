"""A frame that a shape carries with itself: what is decided there does not depend on the pose of the file."""

import numpy as np

from circparam.core.arrays import doubled_areas, slices, sorted_distinct
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray

# ten times the rounding of float32: nearer moments and reaches are equal
TIE_TOLERANCE_SIZES = 1e-6
ORDER_STEP_UNITS = 1e-9  # roots of the area: a million times the rounding of a turned float64


@dataclass(frozen=True, eq=False)
class Frame:
    """A right-handed frame of a surface, which turns, moves and grows with it.

    centre: (3,) centroid of the surface. axes: (3, 3) unit vectors in columns, by falling second moment.
    unit: the root of the area of the surface, which is 1 in the frame.
    """

    centre: FloatArray
    axes: FloatArray
    unit: float

    def inside(self, points: FloatArray) -> FloatArray:
        """(n, 3) points in coordinates of the frame."""
        out = np.empty_like(points)
        # no product of matrices: its rounding depends on the place of a point among the others
        for k in slices(len(points)):
            moved = (points[k] - self.centre) / self.unit
            for d in range(3):
                x, y, z = self.axes[:, d]
                out[k, d] = moved[:, 0] * x + moved[:, 1] * y + moved[:, 2] * z
        return out

    def order(self, points: FloatArray) -> IntArray:
        """(n,) points by their coordinates in steps of ORDER_STEP_UNITS; ties stay as they are."""
        x, y, z = np.round(self.inside(points) / ORDER_STEP_UNITS).T
        return np.lexsort((z, y, x))


def frame_of(points: FloatArray, faces: IntArray) -> Frame:
    """The frame of a surface: its principal axes.

    points: (n, 3), faces: (m, 3) int64 of some area. The third moment along an axis is positive. Where moments
    do not tell (a turned part, a cube), the point that reaches farthest does.
    """
    used = points[sorted_distinct(faces)]
    origin = (used.min(0) + used.max(0)) / 2
    used -= origin
    size = float(np.sqrt((used**2).sum(1).max()))
    area, first = 0.0, np.zeros(3)
    for k in slices(len(faces)):
        corner = points[faces[k]] - origin
        areas = _areas(corner)
        area += float(areas.sum())
        first += areas @ _middles(corner)
    centre = first / area
    second, third = _moments(points, faces, origin + centre)
    used -= centre
    moment, axes = np.linalg.eigh(second / area)
    moment, axes = moment[::-1], axes[:, ::-1]
    equal = -np.diff(moment) <= TIE_TOLERANCE_SIZES * size**2
    if equal.any():
        alike = np.array([equal[0], equal[0] | equal[1], equal[1]])
        axes = axes.copy()
        axes[:, alike] = _towards_farthest(used, axes[:, alike], size)
    skew = np.einsum("ijk,id,jd,kd->d", third, axes, axes, axes) / (area * size**3)
    reach = np.array([_farthest(used, used @ axis, size) @ axis for axis in axes.T])
    axes = axes * np.sign(
        np.where(np.abs(skew) > TIE_TOLERANCE_SIZES, skew, np.where(reach == 0, 1.0, reach))
    )
    if np.linalg.det(axes) < 0:
        unsure = np.flatnonzero(np.abs(skew) <= TIE_TOLERANCE_SIZES)
        axes[:, unsure[-1] if len(unsure) else np.abs(skew).argmin()] *= -1
    return Frame(origin + centre, axes, float(np.sqrt(area)))


def _moments(
    points: FloatArray, faces: IntArray, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """((3, 3) second, (3, 3, 3) third moments) of a surface about an origin.

    The second is exact; the third is that of the centroids of the faces.
    """
    second, third = np.zeros((3, 3)), np.zeros((3, 3, 3))
    for k in slices(len(faces)):
        corner = points[faces[k]] - origin
        area, middle = _areas(corner), _middles(corner)
        # of a triangle with corners p and centroid q: area (Σ p pᵀ + 9 q qᵀ) / 12
        second += np.einsum("mki,mkj->ij", area[:, None, None] * corner, corner) / 12
        second += np.einsum("mi,mj->ij", area[:, None] * middle, middle) * 0.75
        pairs = middle[:, :, None] * middle[:, None]
        third += np.einsum("mi,mjk->ijk", area[:, None] * middle, pairs)
    return second, third


def _areas(corner: FloatArray) -> FloatArray:
    return doubled_areas(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2


def _middles(corner: FloatArray) -> FloatArray:
    return (corner[:, 0] + corner[:, 1] + corner[:, 2]) / 3


def _farthest(points: FloatArray, reach: FloatArray, size: float) -> FloatArray:
    """(3,) the point of the largest absolute reach; of several the one with the lowest coordinates."""
    most = np.abs(reach).max()
    near = points[np.abs(reach) >= most - TIE_TOLERANCE_SIZES * size]
    return near[np.lexsort(near.T)[0]]


def _towards_farthest(points: FloatArray, space: FloatArray, size: float) -> FloatArray:
    """An orthonormal basis of a space, (3, 2) or (3, 3) in columns: each axis towards what is farthest yet."""
    out = np.empty((3, 0))
    while out.shape[1] < space.shape[1]:
        free = space @ space.T - out @ out.T
        axis = free[:, np.diag(free).argmax()]  # the only one that is left, of a plane too
        if out.shape[1] < space.shape[1] - 1:
            within = points @ free
            axis = free @ _farthest(points, np.sqrt((within**2).sum(1)), size)
        out = np.column_stack([out, axis / np.linalg.norm(axis)])
    return out
