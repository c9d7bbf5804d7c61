"""Move the vertices of a sheet over the sphere until its map onto a target is as near to an isometry as it
gets.

The energy is the symmetric Dirichlet energy of every face onto the triangle of its three places on the target.
Steps are Newton's, projected (Smith, Goes and Kim 2019), in the tangent planes of the target. No face of
the sheet may turn over on the sphere, so the map stays one to one, and fixed vertices stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, first_of_runs, group_sum
from circparam.core.clock import tick
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.maps.base import Geometry
from circparam.maps.cones import counter_clockwise
from circparam.maps.cover import Development
from circparam.maps.targets import Spot, Target
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet

ARMIJO = 1e-4
HALVINGS = 12
RIDGE = 1e-8
WORSE = 1.5
LOCAL = 8
STILL = 12  # further times that such vertices stay where they are, and those of the faces that turn over then
HOLDS = 3
PATIENCE = 3
SHORT = 0.1  # times that the steps of single vertices are halved where faces would turn over


@dataclass(frozen=True, eq=False)
class Moved:
    """spot: where the vertices came to lie; energy: mean over the area, 1 for an isometry; steps made."""

    spot: Spot
    energy: float
    steps: int


class Relaxation:
    """One sheet on its way. rest (m, 3, 2): its faces laid flat. fixed: (n,) bool. weight: (m,) of each face,
    of sum 1; 0 where a face does not count."""

    def __init__(
        self,
        faces: IntArray,
        rest: FloatArray,
        target: Target,
        fixed: BoolArray,
        weight: FloatArray,
        development: Development | None = None,
        geometry: Geometry | None = None,
    ) -> None:
        """development: of a sheet over a surface with handles; geometry: where it is relaxed in that itself."""
        self.target, self.fixed, self.faces, self.n = target, fixed, faces, len(fixed)
        self.development, self.geometry = development, geometry
        self.counts = np.flatnonzero(weight > 0)
        self.corners = faces[self.counts].T.copy()
        part = CutMesh(faces[self.counts], rest[self.counts], faces[self.counts, 0], faces[:0, :2])
        gradients = part.gradients
        self.gradients = np.ascontiguousarray(gradients.transpose(1, 2, 0))
        self.weight = weight[self.counts]
        self.guard, self.worse = True, WORSE
        self._pattern()

    def _pattern(self) -> None:
        """Where the block of each pair of corners of each face stands, in an order that fills little."""
        n = self.n
        i, j = self.faces.ravel(), self.faces[:, [1, 2, 0]].ravel()
        graph = sps.csc_matrix((np.full(len(i), -1.0), (i, j)), shape=(n, n))
        degree = -np.asarray(graph.sum(0)).ravel()
        order = np.argsort(Factor(graph + sps.diags(degree + 1.0)).position, kind="stable")
        rank = np.empty(n, np.int64)
        rank[order] = np.arange(n)
        self.order = order
        r = rank[self.corners]
        rows = np.concatenate([r[a] for a in range(3) for b in range(3)] + [np.arange(n)])
        cols = np.concatenate([r[b] for a in range(3) for b in range(3)] + [np.arange(n)])
        key = cols * n + rows
        by = np.argsort(key, kind="stable")
        head = first_of_runs(key[by])
        self.slot = np.empty(len(key), np.int64)
        self.slot[by] = np.repeat(np.arange(len(head)), np.diff(np.r_[head, len(key)]))
        self.row = (key[by[head]] % n).astype(np.int32)
        self.start = np.searchsorted(key[by[head]], np.arange(n + 1) * n).astype(np.int32)

    def jacobians(self, spot: Spot) -> tuple[FloatArray, FloatArray]:
        """((2, 2, m) of each face that counts onto its triangle on the target, (m, 2, d) the axes there)."""
        p = self._points(spot)
        d, e = p[1] - p[0], p[2] - p[0]
        long = np.linalg.norm(d, axis=1)
        x = d / np.maximum(long, 1e-300)[:, None]
        along = (e * x).sum(1)
        rest = e - along[:, None] * x
        high = np.linalg.norm(rest, axis=1)
        y = rest / np.maximum(high, 1e-300)[:, None]
        g = self.gradients
        jacobian = np.empty((2, 2, len(long)))
        jacobian[0] = long * g[:, 1] + along * g[:, 2]
        jacobian[1] = high * g[:, 2]
        return jacobian, np.stack([x, y], 1)

    def _points(self, spot: Spot) -> FloatArray:
        """(3, m, d) the corners of each face that counts: on the target, or flat round the middle of the
        face."""
        if self.geometry is None:
            result: FloatArray = spot.points[self.corners]
            return result
        scale = spot.points[0, 2] / spot.sphere[0, 2]
        return self._flat(spot)[0].transpose(1, 0, 2) * float(scale)

    def _frames(self, spot: Spot) -> FloatArray:
        """(3, m, d, 2) how the corners move with the steps of their vertices."""
        if self.geometry is None:
            result: FloatArray = spot.frame[self.corners]
            return result
        return self._flat(spot)[1].transpose(1, 0, 2, 3)

    def _flat(self, spot: Spot) -> tuple[FloatArray, FloatArray]:
        if self.development is None or self.geometry is None:
            raise TypeError("only a sheet over a surface with handles is laid flat")
        corners, frames = (
            self.development.corners(x)[self.counts] for x in (spot.sphere, spot.frame)
        )
        return self.geometry.flat(corners, frames)

    def cones(self, spot: Spot) -> FloatArray:
        """(m, 3, 3) the faces in the domain."""
        if self.development is None:
            result: FloatArray = spot.sphere[self.faces]
            return result
        return self.development.corners(spot.sphere)

    def face_energy(self, spot: Spot) -> FloatArray:
        """(m,) the energy of each face that counts."""
        return dirichlet.energy(self.jacobians(spot)[0])

    def energy(self, spot: Spot) -> float:
        """The mean energy."""
        return float((self.face_energy(spot) * self.weight).sum())

    def direction(self, spot: Spot, held: BoolArray) -> tuple[FloatArray, float]:
        """((n, 2) Newton's step in the frames, its slope); held (n,): vertices that stay beside the fixed
        ones.
        """
        jacobian, axes = self.jacobians(spot)
        n = self.n
        # a corner's frame in the axes of its face; fixed vertices do not move
        into = np.einsum("mad,cmdb->cabm", axes, self._frames(spot))
        into *= ~(self.fixed | held)[self.corners][:, None, None]
        p = dirichlet.gradient(jacobian) * self.weight
        q = p[:, 0, None] * self.gradients[0] + p[:, 1, None] * self.gradients[1]  # (2, 3, m)
        local = np.einsum("acm,cabm->cbm", q, into)
        flat = self.corners.ravel()
        g = np.stack([group_sum(local[:, b].ravel(), flat, n) for b in range(2)], 1)
        values, modes = dirichlet.newton_modes(jacobian)
        m = np.einsum("kadm,dcm->kacm", modes, self.gradients)  # of each mode and corner
        m = np.einsum("kacm,cabm->kcbm", m, into)
        scaled = m * (values * self.weight)[:, None, None]
        blocks = np.empty((2, 2, 9 * m.shape[-1] + n))
        width = m.shape[-1]
        for a in range(3):
            for b in range(3):
                at = slice((3 * a + b) * width, (3 * a + b + 1) * width)
                blocks[:, :, at] = np.einsum("kim,kjm->ijm", scaled[:, a], m[:, b])
        blocks[:, :, 9 * width :] = 0.0
        d = self._solved(blocks, g)
        return d, float((d * g).sum())

    def _solved(self, blocks: FloatArray, g: FloatArray) -> FloatArray:
        n, count = self.n, len(self.row)
        data = np.empty((count, 2, 2))
        for a in range(2):
            for b in range(2):
                data[:, b, a] = group_sum(blocks[a, b], self.slot, count)
        column = np.repeat(np.arange(n), np.diff(self.start))
        diagonal = np.flatnonzero(self.row == column)
        trace = data[diagonal, 0, 0] + data[diagonal, 1, 1]
        free = trace > 0
        mean = trace[free].sum() / max(
            np.count_nonzero(free), 1
        )  # all vertices of a triangle are fixed
        ridge = np.where(free, RIDGE * trace + 1e-3 * RIDGE * mean, 1.0)
        data[diagonal, 0, 0] += ridge
        data[diagonal, 1, 1] += ridge
        # rows of this are columns of the symmetric matrix
        matrix = sps.bsr_matrix((data, self.row, self.start), shape=(2 * n, 2 * n)).tocsr()
        x = Factor(sps.csc_matrix(matrix.T), ordered=True).solve(-g[self.order].ravel())
        out = np.empty((n, 2))
        out[self.order] = x.reshape(-1, 2)
        return out

    def upright(self, spot: Spot) -> BoolArray:
        """(m,) bool: the face is not turned over, on the sphere where it is guarded, else on the target."""
        if self.guard:
            return counter_clockwise(self.cones(spot))
        p, normal = spot.points[self.corners], spot.normals()[self.corners].sum(0)
        out = np.ones(len(self.faces), bool)
        out[self.counts] = (np.cross(p[1] - p[0], p[2] - p[0]) * normal).sum(1) > 0
        return out

    def run(self, q: FloatArray, steps: int, tolerance: float, monitor: Monitor) -> Moved:
        """Newton's steps from directions q (n, 3), with every face counter-clockwise, until they gain
        little.
        """
        return self.run_from(self.target.at(q), steps, tolerance, monitor)

    def run_from(self, spot: Spot, steps: int, tolerance: float, monitor: Monitor) -> Moved:
        """As ``run``, from places that are known."""
        energy = self.energy(spot)
        done = small = 0
        for _ in range(steps):
            tick()
            if monitor.expired:
                break
            found = self.step(spot, energy)
            if found is None:
                break
            spot, after, promised = found
            done += 1
            gain, energy = energy - after, after
            small = small + 1 if gain < tolerance * energy else 0
            if promised < tolerance * energy or small == PATIENCE:
                break
        return Moved(spot, energy, done)

    def step(self, spot: Spot, energy: float) -> tuple[Spot, float, float] | None:
        """One step: (where it leads, energy there, what Newton's model promised to gain), None where none is
        found.

        Where faces turn over whatever the length of the step, their vertices stay, and the others are asked
        again.
        """
        held = np.zeros(self.n, bool)
        for _ in range(HOLDS):
            d, slope = self.direction(spot, held)
            found = self._line_search(spot, d, energy)
            if found is not None:
                return (*found, -slope / 2)
            trial = self.target.moved(spot, SHORT * d)
            bad = ~counter_clockwise(self.cones(trial))
            if not bad.any():
                break
            held[self.faces[bad]] = True
        return None

    def _line_search(self, spot: Spot, d: FloatArray, energy: float) -> tuple[Spot, float] | None:
        """The step d, of single vertices shortened where faces turn over or get much worse, then without
        these, then as a whole."""
        whole, d = d, d.copy()
        before, good = self.face_energy(spot), self.upright(spot)
        for k in range(LOCAL + STILL + HALVINGS):
            if k == LOCAL + STILL:
                d = whole
            there = self.target.moved(spot, d)
            bad = ~self.upright(there) & good
            value = self.face_energy(there)
            after = float((value * self.weight).sum())
            if not bad.any() and after < energy:
                return there, after
            if k < LOCAL + STILL:
                bad[self.counts[value > self.worse * before + 1]] = True
            if bad.any() and k < LOCAL + STILL:
                d[np.unique(self.faces[bad])] *= 0.5 if k < LOCAL else 0.0
            else:
                d = d / 2
        return None
