"""Move the vertices of a mesh over its domain until its map onto a target is as near to an isometry as it gets.

The energy is the symmetric Dirichlet energy of every face onto the triangle of its three places on the target.
Steps are Newton's, projected (Smith, Goes and Kim 2019), in the tangent planes of the target. No face of the
mesh may turn over in the domain, so the map stays one to one, and fixed vertices stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, group_sum
from circparam.core.clock import tick
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.maps.cones import counter_clockwise
from circparam.maps.cover import Development
from circparam.maps.targets import Target, TargetPoint
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers import dirichlet

RIDGE = 1e-8  # added to the diagonal of the Hessian, of its trace
WORST_RISE = 1.5  # growth of the energy of a face in one step beyond which its corners slow down
LOCAL_HALVINGS = 8  # times that the steps of such vertices are halved,
LOCAL_STOPS = 12  # times that they stay then, with those of the faces that turn over,
HALVINGS = 12  # and times that the whole step is halved in the end
HOLDS = 3  # directions that are tried in one step, each with more vertices at rest
PATIENCE = 3  # steps without a gain after which the relaxation ends
SHORT_STEP = 0.1  # share of a step by which faces turn over whatever its length


@dataclass(frozen=True, eq=False)
class Moved:
    """at: where the vertices came to lie; energy: mean over the area, 1 for an isometry; steps made."""

    at: TargetPoint
    energy: float
    steps: int


class Relaxation:
    """One mesh on its way onto a target.

    development: of the mesh over the domain. rest (m, 3, 2): its faces laid flat. fixed: (n,) bool. weight:
    (m,) of each face, of sum 1; 0 where a face does not count. guard: faces stay unflipped in the domain, else
    on the target.
    """

    def __init__(
        self,
        development: Development,
        rest: FloatArray,
        target: Target,
        fixed: BoolArray,
        weight: FloatArray,
        guard: bool = True,
    ) -> None:
        self.development, self.target, self.fixed, self.guard = development, target, fixed, guard
        self.faces, self.n = development.mesh.faces, len(fixed)
        self.counts = np.flatnonzero(weight > 0)
        faces = self.faces[self.counts]
        self.corners = faces.T.copy()
        part = CutMesh(faces, rest[self.counts], faces[:, 0], self.faces[:0, :2])
        self.gradients = np.ascontiguousarray(part.gradients.transpose(1, 2, 0))
        self.weight = weight[self.counts]
        self._order()

    def _order(self) -> None:
        """An order of the vertices in which the Hessian fills little, and where its entries stand in it."""
        i, j = self.faces.ravel(), self.faces[:, [1, 2, 0]].ravel()
        graph = sps.csc_matrix((np.full(len(i), -1.0), (i, j)), shape=(self.n, self.n))
        degree = -np.asarray(graph.sum(0)).ravel()
        position = Factor(graph + sps.diags(degree + 1.0)).position
        self.order = np.argsort(position, kind="stable")
        rank = np.argsort(self.order)
        index = (2 * rank[self.corners][:, None] + np.arange(2)[:, None]).astype(np.int32)
        whole = (3, 2, 3, 2, index.shape[-1])
        self.rows = np.broadcast_to(index[:, :, None, None], whole).ravel()
        self.columns = np.broadcast_to(index[None, None], whole).ravel()

    def jacobians(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """((2, 2, m) of each face that counts onto its triangle (3, m, d), (m, 2, d) the axes there)."""
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

    def triangles(self, at: TargetPoint) -> tuple[FloatArray, FloatArray]:
        """Corners of the faces that count, and how they move: see ``Target.triangles``."""
        return self.target.triangles(at, self.corners, self.counts)

    def face_energy(self, at: TargetPoint) -> FloatArray:
        """(m,) the energy of each face that counts."""
        return dirichlet.energy(self.jacobians(self.triangles(at)[0])[0])

    def energy(self, at: TargetPoint) -> float:
        """The mean energy."""
        return float((self.face_energy(at) * self.weight).sum())

    def direction(self, at: TargetPoint, resting: BoolArray) -> tuple[FloatArray, float]:
        """((n, 2) Newton's step in the frames, its slope); resting (n,): vertices that stay beside the fixed
        ones.
        """
        places, frames = self.triangles(at)
        jacobian, axes = self.jacobians(places)
        n = self.n
        # a corner's frame in the axes of its face; fixed vertices do not move
        into = np.einsum("mad,cmdb->cabm", axes, frames)
        into *= ~(self.fixed | resting)[self.corners][:, None, None]
        p = dirichlet.gradient(jacobian) * self.weight
        q = p[:, 0, None] * self.gradients[0] + p[:, 1, None] * self.gradients[1]  # (2, 3, m)
        local = np.einsum("acm,cabm->cbm", q, into)
        flat = self.corners.ravel()
        g = np.stack([group_sum(local[:, b].ravel(), flat, n) for b in range(2)], 1)
        values, modes = dirichlet.newton_modes(jacobian)
        m = np.einsum("kadm,dcm->kacm", modes, self.gradients)  # of each mode and corner
        m = np.einsum("kacm,cabm->kcbm", m, into)
        hessian = np.einsum("kaim,kbjm->aibjm", m * (values * self.weight)[:, None, None], m)
        d = self._solved(hessian, g)
        return d, float((d * g).sum())

    def _solved(self, hessian: FloatArray, g: FloatArray) -> FloatArray:
        """(n, 2) Newton's step. hessian (3, 2, 3, 2, m): of each face by corners and directions."""
        size = 2 * self.n
        entries = (hessian.ravel(), (self.rows, self.columns))
        matrix = sps.csc_matrix(entries, shape=(size, size))
        trace = matrix.diagonal().reshape(-1, 2).sum(1)
        free = trace > 0
        mean = trace[free].sum() / max(np.count_nonzero(free), 1)  # none where all are fixed
        ridge = np.where(free, RIDGE * trace + 1e-3 * RIDGE * mean, 1.0)
        matrix = sps.csc_matrix(matrix + sps.diags(np.repeat(ridge, 2)))
        out = np.empty((self.n, 2))
        solved = Factor(matrix, ordered=True).solve(-g[self.order].ravel())
        out[self.order] = solved.reshape(-1, 2)
        return out

    def unflipped(self, at: TargetPoint) -> BoolArray:
        """(m,) bool: the face is not turned over, in the domain where it is guarded, else on the target."""
        if self.guard:
            return counter_clockwise(self.development.corners(at.vectors))
        p, frames = self.triangles(at)
        normal = np.cross(frames[..., 0], frames[..., 1]).sum(0)
        out = np.ones(len(self.faces), bool)
        out[self.counts] = (np.cross(p[1] - p[0], p[2] - p[0]) * normal).sum(1) > 0
        return out

    def run(self, at: TargetPoint, steps: int, tolerance: float, monitor: Monitor) -> Moved:
        """Newton's steps from known places until they gain less than ``tolerance`` of the energy."""
        energy = self.energy(at)
        done = small = 0
        for _ in range(steps):
            tick()
            if monitor.expired:
                break
            better = self.step(at, energy)
            if better is None:
                break
            at, after, promised = better
            done += 1
            gain, energy = energy - after, after
            small = small + 1 if gain < tolerance * energy else 0
            if promised < tolerance * energy or small == PATIENCE:
                break
        return Moved(at, energy, done)

    def step(self, at: TargetPoint, energy: float) -> tuple[TargetPoint, float, float] | None:
        """One step: (where it leads, energy there, what Newton's model promised to gain), None where none is
        better.

        Where faces turn over whatever the length of the step, their vertices stay, and the others are asked
        again.
        """
        resting = np.zeros(self.n, bool)
        for _ in range(HOLDS):
            d, slope = self.direction(at, resting)
            better = self._line_search(at, d, energy)
            if better is not None:
                return (*better, -slope / 2)
            trial = self.target.moved(at, SHORT_STEP * d)
            bad = ~counter_clockwise(self.development.corners(trial.vectors))
            if not bad.any():
                break
            resting[self.faces[bad]] = True
        return None

    def _line_search(
        self, at: TargetPoint, d: FloatArray, energy: float
    ) -> tuple[TargetPoint, float] | None:
        """The step d, of single vertices shortened where faces turn over or get much worse, then without
        these, then as a whole."""
        whole, d = d, d.copy()
        before, good = self.face_energy(at), self.unflipped(at)
        for k in range(LOCAL_HALVINGS + LOCAL_STOPS + HALVINGS):
            if k == LOCAL_HALVINGS + LOCAL_STOPS:
                d = whole
            there = self.target.moved(at, d)
            bad = ~self.unflipped(there) & good
            value = self.face_energy(there)
            after = float((value * self.weight).sum())
            if not bad.any() and after < energy:
                return there, after
            if k < LOCAL_HALVINGS + LOCAL_STOPS:
                bad[self.counts[value > WORST_RISE * before + 1]] = True
            if bad.any() and k < LOCAL_HALVINGS + LOCAL_STOPS:
                d[np.unique(self.faces[bad])] *= 0.5 if k < LOCAL_HALVINGS else 0.0
            else:
                d = d / 2
        return None
