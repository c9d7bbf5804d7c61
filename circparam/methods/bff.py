"""Boundary first flattening (Sawhney, Crane 2017): conformal maps through the curvature of their border.

Holes are closed by virtual faces, which take part in the map and are dropped. Flips are possible where the
mesh is far from Delaunay or the border crosses itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, group_sum
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.errors import OptionError
from circparam.geometry.intrinsic import corner_angles, cotangent_laplacian, vertex_angle_sums
from circparam.mesh.cut_mesh import Patches, close_holes
from circparam.methods.base import Layout, MethodOptions, require_border
from circparam.methods.conformal import scaled
from circparam.methods.untangled import mend
from circparam.solvers.tutte.boundary import Ring, outer_ring

ROUNDS = 40  # of the fixed point iteration for the disk
SHORTEST = (
    1e-3  # a border edge keeps at least this share of its wanted length when the border is closed
)


@dataclass(frozen=True, eq=False)
class _Border:
    """ring: the outer borders; follower (b,) entry after each; length (b,) of each edge on the surface."""

    ring: Ring
    follower: np.ndarray[tuple[int], np.dtype[np.int64]]
    length: FloatArray

    def sums(self, values: FloatArray) -> FloatArray:
        """(n,) sum over each border."""
        return group_sum(values, self.ring.index, len(self.ring.size))

    def running(self, values: FloatArray) -> FloatArray:
        """(b,) running sum along each border, the entry's own value included."""
        total = np.cumsum(values)
        first = self.ring.start
        result: FloatArray = total - (total[first] - values[first])[self.ring.index]
        return result


def bff(patches: Patches, options: MethodOptions, monitor: Monitor) -> Layout:
    """Flatten with a free border: automatic (least area change at the border), onto a disk, or with the border
    lengths of the options. All charts in one system. Raises OptionError for lengths that do not fit.
    """
    require_border(patches)
    with monitor.stage("solve"):
        closed, _ = close_holes(patches)
        border = _border(closed)
        flattening = _Flattening(closed, border)
        target = options.bff_border
        if target is None:
            uv = flattening.automatic(np.zeros(len(border.length)), conjugate=True)
        elif isinstance(target, str):
            if target != "disk":
                raise OptionError(f"unknown border of bff {target!r}: 'disk', or lengths")
            uv = flattening.disk()
        else:
            factors = _log_factors(patches, border, np.asarray(target, np.float64))
            uv = flattening.automatic(factors, conjugate=False)
        uv = uv[: patches.n_vertices]
        own_size = np.full(patches.n_charts, target is None or isinstance(target, str))
        uv = scaled(patches, uv, own_size)
    uv, notes = mend(patches, uv, "bff", options, monitor)
    steps = np.ones(patches.n_charts, np.int64)
    return Layout(uv, steps, ["solved"] * patches.n_charts, notes)


def _border(patches: Patches) -> _Border:
    """The outer borders of all charts."""
    ring = outer_ring(patches)
    index = ring.index
    local = np.arange(len(index)) - ring.start[index]
    follower = ring.start[index] + (local + 1) % ring.size[index]
    return _Border(ring, follower, patches.edge_lengths.ravel()[ring.half_edge])


def _log_factors(patches: Patches, border: _Border, lengths: FloatArray) -> FloatArray:
    """(b,) scale factor u at each border vertex for target lengths given in order of half-edge number."""
    h = border.ring.half_edge
    if lengths.shape != h.shape:
        raise OptionError(
            f"bff has {len(h)} outer border edges and got lengths of shape {lengths.shape}"
        )
    if not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise OptionError("the border lengths for bff must be finite and above 0")
    wanted = np.empty(len(h))
    wanted[np.argsort(h, kind="stable")] = lengths
    ratio = np.log(wanted / border.length)
    # each vertex takes the mean of its two edges, weighted by their lengths on the surface
    after, total = border.length * ratio, border.length.copy()
    sums = after.copy()
    sums[border.follower] += after
    total[border.follower] += border.length
    result: FloatArray = sums / total
    return result


class _Flattening:
    """The linear algebra that every kind of border shares."""

    def __init__(self, patches: Patches, border: _Border) -> None:
        self.patches, self.border = patches, border
        self.rim = border.ring.vertices
        self.inner = np.ones(patches.n_vertices, bool)
        self.inner[self.rim] = False
        self.L = sps.csr_matrix(cotangent_laplacian(patches))
        sums = vertex_angle_sums(patches, corner_angles(patches))
        self.defect = 2 * np.pi - sums[self.inner]
        self.turning = np.pi - sums[self.rim]

    def automatic(self, u: FloatArray, conjugate: bool) -> FloatArray:
        """The flattening whose log scale factor on the border is u (b,): its curvature, curve and inside."""
        inside = self.L[self.inner]
        factor = Factor(sps.csc_matrix(inside[:, self.inner]))
        to_rim = inside[:, self.rim]
        a = factor.solve(-self.defect - to_rim @ u)
        flux = -(to_rim.T @ a + self.L[self.rim][:, self.rim] @ u)
        border = self.border
        lengths = border.length * np.exp((u + u[border.follower]) / 2)
        curve = _closed_curve(border, lengths, self.turning - flux)
        uv = np.empty((self.patches.n_vertices, 2))
        uv[self.rim] = curve
        uv[self.inner] = factor.solve(-(to_rim @ curve))
        if conjugate:
            uv[:, 1] = self._conjugate(uv[:, 0])
        return uv

    def disk(self) -> FloatArray:
        """The flattening onto a disk: border curvature in proportion to the lengths that come out."""
        border = self.border
        pinned, keep = self._pinned()
        b = np.zeros(self.patches.n_vertices)
        b[self.inner] = -self.defect
        lengths = border.length
        for _ in range(ROUNDS):
            share = lengths / border.sums(lengths)[border.ring.index]
            curvature = share.copy()
            curvature[border.follower] += share
            b[self.rim] = np.pi * curvature - self.turning
            v = np.zeros(self.patches.n_vertices)
            v[keep] = pinned.solve(b[keep])
            u = v[self.rim]
            u = u - (border.sums(u) / border.ring.size)[border.ring.index]
            new = border.length * np.exp((u + u[border.follower]) / 2)
            change = np.abs(np.log(new / lengths)).max()
            lengths = np.sqrt(new * lengths) if change > 0.1 else new
            if change < 1e-10:
                break
        share = lengths / border.sums(lengths)[border.ring.index]
        angle = 2 * np.pi * (border.running(share) - share)
        radius = np.sqrt(self.patches.chart_areas / np.pi)[border.ring.chart]
        curve = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
        inside = self.L[self.inner]
        uv = np.empty((self.patches.n_vertices, 2))
        uv[self.rim] = curve
        uv[self.inner] = Factor(sps.csc_matrix(inside[:, self.inner])).solve(
            -(inside[:, self.rim] @ curve)
        )
        return uv

    def _pinned(self) -> tuple[Factor, BoolArray]:
        """Factor of the Laplacian with the first border vertex of every chart held at 0."""
        keep = np.ones(self.patches.n_vertices, bool)
        keep[self.rim[self.border.ring.start]] = False
        return Factor(sps.csc_matrix(self.L[keep][:, keep])), keep

    def _conjugate(self, x: FloatArray) -> FloatArray:
        """The y with the least conformal energy for this x: L y = (x_before − x_after)/2 on the border."""
        follower = self.border.follower
        rim_x = x[self.rim]
        b = np.zeros(self.patches.n_vertices)
        right = np.empty(len(rim_x))
        right[follower] = rim_x  # x of the entry before
        b[self.rim] = (right - rim_x[follower]) / 2
        factor, keep = self._pinned()
        y = np.zeros(len(x))
        y[keep] = factor.solve(b[keep])
        return y


def _closed_curve(border: _Border, lengths: FloatArray, turning: FloatArray) -> FloatArray:
    """(b, 2) the polygon with these turning angles at its vertices and edge lengths changed as little as closes
    it (Sawhney, Crane 2017, section 4.4)."""
    ring = border.ring
    index = ring.index
    # angles that add up to 2π on every border, whatever the rounding
    turning = turning + ((2 * np.pi - border.sums(turning)) / ring.size)[index]
    direction = border.running(turning)
    T = np.stack([np.cos(direction), np.sin(direction)], 1)
    floor = SHORTEST * lengths
    for _ in range(20):
        gap = np.stack([border.sums(lengths * t) for t in T.T], 1)
        G = np.empty((len(ring.size), 2, 2))
        for i in range(2):
            for j in range(2):
                G[:, i, j] = border.sums(border.length * T[:, i] * T[:, j])
        pull = np.linalg.solve(G, gap[:, :, None])[:, :, 0]
        lengths = lengths - border.length * (T * pull[index]).sum(1)
        if (lengths >= floor).all():
            break
        lengths = np.maximum(lengths, floor)
    step = lengths[:, None] * T
    result: FloatArray = np.stack([border.running(s) - s for s in step.T], 1)
    return result
