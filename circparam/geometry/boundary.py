"""The boundaries of charts in the plane, as segments."""

from functools import cached_property

import numpy as np

from circparam.core.arrays import (
    cross2,
    ends_of,
    first_of_each,
    first_of_groups,
    group_sum,
    mask_of,
    norms2,
)
from circparam.core.graph import along_cycles
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh


@dataclass(frozen=True, eq=False)
class BoundarySegments:
    """Boundary segments of all charts, each with its chart on its left.

    half_edge: (b,) number of each. chart: (b,). start, end: (b, 2) places. following, before: (b,) the next and
    the previous segment along the boundary. size: (n,) root of each chart's area in the plane.
    """

    half_edge: IntArray
    chart: IntArray
    start: FloatArray
    end: FloatArray
    following: IntArray
    before: IntArray
    size: FloatArray

    @cached_property
    def along(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """(loop, distance along it, its length) of each segment."""
        return along_cycles(self.following, norms2(self.end - self.start))


def boundary_in(cut_mesh: CutMesh, uv: FloatArray) -> BoundarySegments:
    """The boundary segments of a cut mesh in a layout (nv, 2).

    Mirrored charts are walked the other way, so their inside is left.
    """
    faces, chart, h = cut_mesh.faces, cut_mesh.chart, cut_mesh.boundary
    following, before = cut_mesh.rim
    a, b, c = uv[faces[:, 0]], uv[faces[:, 1]], uv[faces[:, 2]]
    area = group_sum(cross2(b - a, c - a), chart, cut_mesh.n_charts) / 2
    own = chart[h // 3]
    start, end = (uv[vertices] for vertices in ends_of(faces, h))
    back = area[own] < 0
    return BoundarySegments(
        h,
        own,
        np.where(back[:, None], end, start),
        np.where(back[:, None], start, end),
        np.where(back, before, following),
        np.where(back, following, before),
        np.sqrt(np.abs(area)),
    )


def turned_loops(boundary: BoundarySegments) -> BoolArray:
    """(b,) segments of loops that run counter-clockwise beside a larger one of the same chart that does too.

    A point inside a chart has as many originals as loops wind round it. If loops do not cross, exactly one of
    them is counter-clockwise in a one-to-one map. A second one is a flap at an inner hole, folded out over the
    chart without any crossing.
    """
    loop, _, total = boundary.along
    count = int(loop.max(initial=-1)) + 1
    first = first_of_each(loop, count)
    origin = boundary.start[first][loop]
    area = group_sum(cross2(boundary.start - origin, boundary.end - origin), loop, count)
    outward = area > 1e-13 * total[first] ** 2  # a slit in the plane has no area but for rounding
    chart = boundary.chart[first]
    largest = mask_of(count, first_of_groups(chart, -area))
    return (outward & ~largest)[loop]
