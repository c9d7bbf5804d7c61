"""The data: a mesh as read (never edited) and a uv layout over its faces."""

from functools import cached_property

import numpy as np

from circparam.core.arrays import mask_of, numbered_rows
from circparam.core.graph import components
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import InputError


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles as the file has them: never reordered, never merged, positions bit-exact.

    points: (n, 3) float64, in the units of the file. faces: (m, 3) int64 into points.
    polygons: (m,) int64, the polygon of the file each triangle belongs to (no seam runs inside a polygon);
    None if every polygon is a triangle. groups: (m,) int64, a label per material or group; None where
    there is only one. counted_from: number of the first vertex and face in the file (1 in OBJ), for messages.

    Raises InputError if shapes or indices do not fit, or a used point is not finite.
    """

    points: FloatArray
    faces: IntArray
    polygons: IntArray | None = None
    groups: IntArray | None = None
    counted_from: int = 0

    def __post_init__(self) -> None:
        points = np.ascontiguousarray(self.points, dtype=np.float64)
        faces = np.ascontiguousarray(self.faces, dtype=np.int64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"points have shape {points.shape}: (n, 3) is needed")
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise InputError(f"faces have shape {faces.shape}: (m, 3) is needed")
        if len(faces) == 0:
            raise InputError("the mesh has no faces: there is nothing to unwrap")
        if faces.min() < 0 or faces.max() >= len(points):
            bad = int(np.flatnonzero((faces < 0).any(1) | (faces >= len(points)).any(1))[0])
            raise InputError(
                f"face {bad} names a vertex outside 0..{len(points) - 1}: {faces[bad].tolist()}"
            )
        used = mask_of(len(points), faces)
        broken = used & ~np.isfinite(points).all(1)
        if broken.any():
            raise InputError(
                f"{counted(int(broken.sum()), 'used vertex')} with NaN or infinite coordinates, the first is "
                f"vertex {self.vertex_number(int(np.flatnonzero(broken)[0]))}: repair the file first"
            )
        for name in ("polygons", "groups"):
            value = getattr(self, name)
            if value is not None:
                value = np.ascontiguousarray(value, dtype=np.int64)
                if value.shape != (len(faces),):
                    raise InputError(f"{name} have shape {value.shape}: one label a face is needed")
                object.__setattr__(self, name, value)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "faces", faces)

    def vertex_number(self, vertex: int) -> int:
        """The number of a vertex in the file."""
        return int(vertex) + self.counted_from

    def face_number(self, face: int) -> int:
        """The number in the file of the face (or polygon) that contains a triangle."""
        own = face if self.polygons is None else self.polygons[face]
        return int(own) + self.counted_from

    @cached_property
    def weld(self) -> IntArray:
        """(n,) int64: every vertex → the lowest vertex at exactly the same position (−0 equals 0)."""
        first, rank = self._positions
        return first[rank]

    @property
    def corners(self) -> FloatArray:
        """(m, 3, 3) position of the corners of each face."""
        return self.points[self.faces]

    @property
    def rank(self) -> IntArray:
        """(n,) int64: the number of every vertex's position among all, by x, then y, then z."""
        return self._positions[1]

    @cached_property
    def _positions(self) -> tuple[IntArray, IntArray]:
        """The lowest vertex at each position, positions in ascending order; and the position of each vertex."""
        return numbered_rows(self.points)


@dataclass(frozen=True, eq=False)
class UVMap:
    """A layout over the faces of a mesh: uv (k, 2) float64, uv_faces (m, 3) int64 into uv.

    The origin is bottom-left. −1 in uv_faces: that corner has no uv. Charts are the components of uv_faces.
    """

    uv: FloatArray
    uv_faces: IntArray

    @property
    def corners(self) -> FloatArray:
        """(m, 3, 2) uv of the corners of each face; that of another one where a corner has none."""
        return self.uv[np.maximum(self.uv_faces, 0)]

    @property
    def laid(self) -> BoolArray:
        """(m,) bool: faces with uv at all corners."""
        return np.asarray((self.uv_faces >= 0).all(1))

    @cached_property
    def charts(self) -> IntArray:
        """(m,) int64: chart of each face (components of uv_faces through shared uv vertices)."""
        m = len(self.uv_faces)
        rows = np.repeat(np.arange(m), 3)
        columns = self.uv_faces.ravel()
        ok = columns >= 0
        _, labels = components(m + len(self.uv), rows[ok], columns[ok] + m)
        return labels[:m]  # a face is the lowest node of every chart, so no label is left out
