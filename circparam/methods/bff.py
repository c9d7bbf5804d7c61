"""Boundary first flattening (Sawhney, Crane 2017): conformal maps through the curvature of their boundary.

A hole stays a hole: the scale round it is one number, chosen so that its boundary turns by −2π. Cuts from hole
to hole open the chart to a disk, whose one boundary is walked as that of any disk. Both sides of a cut get the
same lengths and opposite turns. The Jacobians therefore fit together across it up to the error of closing the
holes, and the layout is that of the uncut chart. Flips are possible where the mesh is far from Delaunay or a
boundary crosses itself.
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import ends_of, group_count, group_sum, mask_of, positions_in
from circparam.core.linalg import Factor, HeldFactor
from circparam.core.monitor import Monitor
from circparam.core.registry import Row
from circparam.core.types import FloatArray
from circparam.errors import OptionError
from circparam.geometry.intrinsic import (
    corner_angles,
    cotangent_laplacian,
    jacobians,
    vertex_angle_sums,
)
from circparam.mesh.cut_mesh import CutMesh, close_holes
from circparam.methods.base import CHECKED, FREE, Layout, MethodOptions, MethodRow, direct
from circparam.methods.conformal import at_surface_area
from circparam.methods.untangled import untangle_layout
from circparam.solvers.holes import hole_vertices, open_holes
from circparam.solvers.poisson import from_jacobians
from circparam.solvers.tutte.embed import require_boundary
from circparam.solvers.tutte.outer import OuterBoundary, outer_boundary

DISK_ROUNDS = 40  # of the fixed point iteration for the disk
# of its target length, that a boundary edge keeps when the boundary is closed
LEAST_EDGE_SHARE = 1e-3


def bff(cut_mesh: CutMesh, options: MethodOptions, monitor: Monitor) -> Layout:
    """Flatten with a free boundary: automatic (least area change at the boundary), onto a disk, or with the
    boundary lengths of the options. All charts in one system. Raises OptionError for lengths that do not fit.
    """
    require_boundary(cut_mesh)
    with monitor.stage("solve"):
        target = options.bff_boundary
        if target is None:
            uv = _flatten(cut_mesh, np.zeros(cut_mesh.n_vertices), conjugate=True)
        elif isinstance(target, str):
            if target != "disk":
                raise OptionError(f"unknown boundary of bff {target!r}: 'disk', or lengths")
            # a circle takes the shape of the boundary anyway: closed holes are good enough
            uv = _Flattening(close_holes(cut_mesh)).disk()
        else:
            factors = _log_factors(cut_mesh, np.asarray(target, np.float64))
            uv = _flatten(cut_mesh, factors, conjugate=False)
        uv = uv[: cut_mesh.n_vertices]
        own_size = np.full(cut_mesh.n_charts, target is None or isinstance(target, str))
        uv = at_surface_area(cut_mesh, uv, own_size)
    uv, notes = untangle_layout(cut_mesh, uv, "bff", options, monitor)
    return direct(cut_mesh, uv, notes)


def _flatten(cut_mesh: CutMesh, u: FloatArray, conjugate: bool) -> FloatArray:
    """(n_vertices, 2) the flattening whose log scale factor on the outer boundaries is u (n_vertices,)."""
    holed = group_count(cut_mesh.loops.chart, cut_mesh.n_charts) > 1
    uv = np.empty((cut_mesh.n_vertices, 2))
    for charts, flatten in ((~holed, _Flattening.automatic), (holed, _Flattening.holed)):
        if charts.any():
            part, vertices, _ = cut_mesh.subset(charts)
            uv[vertices] = flatten(_Flattening(part), u[vertices], conjugate)
    return uv


def _log_factors(cut_mesh: CutMesh, lengths: FloatArray) -> FloatArray:
    """(n_vertices,) log scale factor on the outer boundaries for target lengths, by half-edge number."""
    boundary = outer_boundary(cut_mesh)
    h = boundary.half_edge
    if lengths.shape != h.shape:
        raise OptionError(
            f"bff has {len(h)} outer boundary edges and got lengths of shape {lengths.shape}"
        )
    if not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise OptionError("the boundary lengths for bff must be finite and above 0")
    target = np.empty(len(h))
    target[np.argsort(h, kind="stable")] = lengths
    ratio = np.log(target / boundary.length)
    # each vertex takes the mean of its two edges, weighted by their lengths on the surface
    after, total = boundary.length * ratio, boundary.length.copy()
    sums = after.copy()
    sums[boundary.follower] += after
    total[boundary.follower] += boundary.length
    result = np.zeros(cut_mesh.n_vertices)
    result[boundary.vertices] = sums / total
    return result


class _Flattening:
    """What every kind of boundary needs: the Laplacian L, the outer boundaries, and the sum of the corner
    angles at each vertex, ``angles`` (n,)."""

    def __init__(self, cut_mesh: CutMesh) -> None:
        self.cut_mesh, self.boundary = cut_mesh, outer_boundary(cut_mesh)
        self.on_outer = self.boundary.vertices
        self.inner = ~cut_mesh.on_boundary
        self.L = sps.csr_matrix(cotangent_laplacian(cut_mesh))
        self.angles = vertex_angle_sums(cut_mesh, corner_angles(cut_mesh))

    @cached_property
    def pinned(self) -> HeldFactor:
        """Solutions that are zero at the first boundary vertex of every chart."""
        return HeldFactor(self.L, self.on_outer[self.boundary.start])

    def automatic(self, u: FloatArray, conjugate: bool) -> FloatArray:
        """The flattening with log scale factor u (n_vertices,) on the boundary: curvature, curve, inside."""
        u, boundary = u[self.on_outer], self.boundary
        inside = HeldFactor(self.L, self.on_outer)
        scale = inside.solve(self.angles - 2 * np.pi, u)
        lengths = boundary.length * np.exp((u + u[boundary.follower]) / 2)
        turning = np.pi - self.angles[self.on_outer] + (self.L @ scale)[self.on_outer]
        uv = inside.solve(np.zeros((len(scale), 2)), _closed_curve(boundary, lengths, turning))
        if conjugate:
            uv[:, 1] = self._conjugate(uv[:, 0])
        return uv

    def disk(self) -> FloatArray:
        """The flattening onto a disk: boundary curvature in proportion to the resulting lengths."""
        boundary = self.boundary
        b = self.angles - 2 * np.pi
        lengths = boundary.length
        for _ in range(DISK_ROUNDS):
            share = lengths / boundary.sums(lengths)[boundary.index]
            curvature = share.copy()
            curvature[boundary.follower] += share
            b[self.on_outer] = np.pi * curvature - (np.pi - self.angles[self.on_outer])
            u = self.pinned.solve(b)[self.on_outer]
            u = u - (boundary.sums(u) / boundary.size)[boundary.index]
            new = boundary.length * np.exp((u + u[boundary.follower]) / 2)
            change = np.abs(np.log(new / lengths)).max()
            lengths = np.sqrt(new * lengths) if change > 0.1 else new
            if change < 1e-10:
                break
        share = lengths / boundary.sums(lengths)[boundary.index]
        angle = 2 * np.pi * (boundary.running(share) - share)
        radius = np.sqrt(self.cut_mesh.chart_areas / np.pi)[boundary.chart]
        curve = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
        return HeldFactor(self.L, self.on_outer).solve(np.zeros((len(b), 2)), curve)

    def holed(self, u: FloatArray, conjugate: bool) -> FloatArray:
        """The same as ``automatic`` for charts with holes, opened along cuts from boundary to boundary.

        If the holes of a curved chart do not quite close, the Poisson layout distributes the error. Its
        conjugate, taken back and forth, then has the angles of a conformal map of the whole chart.
        """
        cut_mesh, opened = self.cut_mesh, open_holes(self.cut_mesh)
        scale = self._scale(u)[opened.origin]
        disk = _Flattening(opened.cut_mesh)
        walk, at = disk.boundary, disk.on_outer
        turning = np.pi - disk.angles[at] + (disk.L @ scale)[at]
        lengths = walk.length * np.exp((scale[at] + scale[at[walk.follower]]) / 2)
        curve = _closed_curve(walk, lengths, turning)
        uv = HeldFactor(disk.L, at).solve(np.zeros((len(scale), 2)), curve)
        targets = np.ascontiguousarray(jacobians(opened.cut_mesh, uv).transpose(1, 2, 0))
        if conjugate:
            uv, _ = from_jacobians(cut_mesh, targets)
            uv[:, 1] = self._conjugate(uv[:, 0])
            uv[:, 0] = -self._conjugate(uv[:, 1])
            uv[:, 1] = self._conjugate(uv[:, 0])
            return uv
        outer = mask_of(cut_mesh.faces.size, self.boundary.half_edge)
        held = outer[walk.half_edge]
        curve = _closed_curve(walk, np.where(held, lengths, 0.0), turning)
        return from_jacobians(cut_mesh, targets, held=(opened.origin[at[held]], curve[held]))[0]

    def _scale(self, u: FloatArray) -> FloatArray:
        """(n_vertices,) log scale factor of a flat metric: u on the outer boundary, one number a hole."""
        n = self.cut_mesh.n_vertices
        vertices, hole, size = hole_vertices(self.cut_mesh)
        inner = int(self.inner.sum())
        unknown = positions_in(n, np.flatnonzero(self.inner))
        unknown[vertices] = inner + hole
        used = np.flatnonzero(unknown >= 0)
        tie = sps.csr_matrix(
            (np.ones(len(used)), (used, unknown[used])), shape=(n, inner + len(size))
        )
        turning = group_sum(np.pi - self.angles[vertices], hole, len(size))
        excess = np.concatenate([2 * np.pi - self.angles[self.inner], turning + 2 * np.pi])
        given = np.zeros(n)
        given[self.on_outer] = u[self.on_outer]
        matrix = sps.csc_matrix(tie.T @ self.L @ tie)
        return given + tie @ Factor(matrix).solve(-excess - tie.T @ (self.L @ given))

    def _conjugate(self, x: FloatArray) -> FloatArray:
        """The y with the least conformal energy for this x: L y = (x_before − x_after)/2 on the boundary."""
        i, j = ends_of(self.cut_mesh.faces, self.cut_mesh.boundary)
        n = self.cut_mesh.n_vertices
        b = (group_sum(x[i], j, n) - group_sum(x[j], i, n)) / 2
        return self.pinned.solve(b)


def _closed_curve(boundary: OuterBoundary, lengths: FloatArray, turning: FloatArray) -> FloatArray:
    """(b, 2) the polygon with these turning angles at its vertices and edge lengths changed as little as closes
    it (Sawhney, Crane 2017, section 4.4). Edges of length 0 keep it."""
    index, size = boundary.index, boundary.size
    # angles that add up to 2π on every boundary, whatever the rounding
    turning = turning + ((2 * np.pi - boundary.sums(turning)) / size)[index]
    direction = boundary.running(turning)
    T = np.stack([np.cos(direction), np.sin(direction)], 1)
    floor = LEAST_EDGE_SHARE * lengths
    weight = np.where(lengths > 0, boundary.length, 0.0)
    for _ in range(20):
        gap = np.stack([boundary.sums(lengths * t) for t in T.T], 1)
        G = np.empty((len(size), 2, 2))
        for i in range(2):
            for j in range(2):
                G[:, i, j] = boundary.sums(weight * T[:, i] * T[:, j])
        pull = np.linalg.solve(G, gap[:, :, None])[:, :, 0]
        lengths = lengths - weight * (T * pull[index]).sum(1)
        if (lengths >= floor).all():
            break
        lengths = np.maximum(lengths, floor)
    step = lengths[:, None] * T
    return np.stack([boundary.running(s) - s for s in step.T], 1)


ROW: MethodRow = Row(
    "bff",
    bff,
    "boundary first flattening: angles, with least area change or a boundary of your own",
    "Sawhney and Crane 2017",
    FREE,
    CHECKED,
    frozenset({"bff_boundary"}),
)
