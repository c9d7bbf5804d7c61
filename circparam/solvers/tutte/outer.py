"""The options of an embedding, and the outer boundary of every chart in order."""

from functools import cached_property

import numpy as np

from circparam.core.arrays import group_sum, mask_of
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import OptionError
from circparam.geometry.intrinsic import corner_angles
from circparam.mesh.cut_mesh import CutMesh

SPACINGS = ("arc-length", "uniform")

# Least length in the spacing of boundary edges, as a share of their mean. On a circle the triangle of an arc
# δ has area δ³/16, which must stay far above the rounding of the coordinates.
SHORTEST_SHARE = 1e-3


@dataclass(frozen=True)
class TutteOptions:
    """How a chart is embedded: its boundary, and the treatment of negative weights and flips.

    boundary: row of BOUNDARIES. spacing: ``arc-length`` (as far apart as on the surface) or ``uniform``.
    polygon: (k, 2) corners of a convex polygon, in either orientation, for the boundary ``polygon``. clamp:
    raise negative weights to small positive ones. repair: untangle faces that double precision flips (see
    ``embed``).
    """

    boundary: str = "circle"
    spacing: str = "arc-length"
    polygon: FloatArray | None = None
    clamp: bool = False
    repair: bool = True


@dataclass(frozen=True, eq=False)
class OuterBoundary:
    """Outer boundaries of all charts, in order: vertices (b,), their chart (b,), the half-edge (b,) from each.
    place (b,): its parameter along the boundary, from 0 at the start of the loop to below 1. length (b,): of
    the half-edge on the surface.

    size: (n,) number of vertices of each boundary.
    """

    vertices: IntArray
    chart: IntArray
    half_edge: IntArray
    place: FloatArray
    length: FloatArray
    size: IntArray

    @cached_property
    def start(self) -> IntArray:
        """(n,) first entry of each chart."""
        return np.cumsum(self.size) - self.size

    @cached_property
    def index(self) -> IntArray:
        """(b,) chart of each entry, counted among the charts that have one."""
        return np.repeat(np.arange(len(self.size)), self.size)

    @cached_property
    def follower(self) -> IntArray:
        """(b,) the entry after each along the same boundary."""
        after = np.arange(1, len(self.index) + 1)
        after[self.start + self.size - 1] = self.start
        return after

    def sums(self, values: FloatArray) -> FloatArray:
        """(n,) sum of values (b,) over each boundary."""
        return group_sum(values, self.index, len(self.size))

    def running(self, values: FloatArray) -> FloatArray:
        """(b,) running sum along each boundary, the entry's own value included."""
        total = np.cumsum(values)
        return total - (total[self.start] - values[self.start])[self.index]


@dataclass(frozen=True, eq=False)
class FixedBoundary:
    """cut_mesh: the charts to solve, real faces and vertices first. vertices (b,): the fixed ones, in order
    along each chart's boundary. uv (b, 2): their places, in units of the mesh.
    """

    cut_mesh: CutMesh
    vertices: IntArray
    uv: FloatArray


def outer_boundary(cut_mesh: CutMesh, spacing: str = "arc-length") -> OuterBoundary:
    """The outer boundary of every chart, charts in ascending order, begun at its sharpest corner.

    Raises OptionError for an unknown spacing. Every chart must have a boundary.
    """
    if spacing not in SPACINGS:
        raise OptionError(f"unknown spacing {spacing!r}: choose one of {', '.join(SPACINGS)}")
    loops = cut_mesh.loops
    outer = np.flatnonzero(loops.outer)
    outer = outer[np.argsort(loops.chart[outer], kind="stable")]
    size = np.diff(loops.start)[outer]
    chart = np.repeat(np.arange(len(outer)), size)
    first = np.cumsum(size) - size
    local = np.arange(len(chart)) - first[chart]
    h = loops.half_edges[loops.start[outer][chart] + local]
    # begin where the surface's corner is sharpest: a choice that no renumbering changes
    vertices = cut_mesh.faces.ravel()[h]
    near = np.flatnonzero(mask_of(cut_mesh.n_vertices, vertices)[cut_mesh.faces].any(1))
    faces, rest = cut_mesh.faces[near], cut_mesh.rest_triangles[near]
    angles = corner_angles(CutMesh(faces, rest, cut_mesh.chart[near], cut_mesh.edges[:0]))
    sharp = group_sum(angles.ravel(), faces.ravel(), cut_mesh.n_vertices)[vertices]
    order = np.lexsort((local, np.round(sharp, 9), chart))
    begin = local[order[first]]
    h = h[first[chart] + (local + begin[chart]) % size[chart]]
    length = cut_mesh.edge_lengths.ravel()[h]
    apart = np.ones(len(h))
    if spacing == "arc-length":
        mean = group_sum(length, chart, len(size)) / size
        apart = np.maximum(length, SHORTEST_SHARE * mean[chart])
    share = apart / group_sum(apart, chart, len(size))[chart]
    run = np.cumsum(share) - share
    place = np.clip(run - run[first[chart]], 0, 1)
    labels = loops.chart[outer][chart]
    return OuterBoundary(cut_mesh.faces.ravel()[h], labels, h, place, length, size)
