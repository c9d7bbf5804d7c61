"""Move the vertices of a mesh over its domain until its map onto a target is as near to an isometry as it gets.

The energy is the symmetric Dirichlet energy of every face onto the triangle of its three places on the target.
Steps are Newton's, projected (Smith, Goes and Kim 2019), in the tangent planes of the target. No face of the
mesh may turn over in the domain, so the map stays one to one, and fixed vertices stay where they are.
"""

from typing import TypeAlias

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import group_sum, interpolated
from circparam.core.clock import tick
from circparam.core.linalg import Factor
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.maps.cover import Cover, CoverPoints, Development
from circparam.maps.geometries import Geometry, tangents
from circparam.solvers import dirichlet
from circparam.solvers.pattern import ranks_of

RIDGE_TRACE_SHARE = 1e-8  # added to the diagonal of the Hessian, of its trace
MOST_HALVINGS = 12  # of a step
DIRECTION_TRIALS = 3  # directions that are tried in one step, each with more vertices at rest
PATIENCE_STEPS = 3  # steps without a gain after which the relaxation ends
SHORT_STEP_SHARE = 0.1  # share of a step by which faces turn over whatever its length

MOST_CROSSINGS = 60  # edges that one step crosses at most
LONGEST_STEP_RADII = 0.5  # radii of curvature that a vertex moves in one step at most


NOWHERE = CoverPoints(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


@dataclass(frozen=True, eq=False)
class TargetPoint:
    """Where vertices are. vectors (n, 3): in their frames over the domain; points (n, 3) on the target; frame
    (n, 3, 2): two orthonormal tangents there; on: the places on a mesh, none on a geometry."""

    vectors: FloatArray
    points: FloatArray
    frame: FloatArray
    on: CoverPoints = NOWHERE


class GeometryTarget:
    """The geometry of the domain, at a given scale; development: of the mesh that lies on it."""

    def __init__(self, geometry: Geometry, scale: float, development: Development) -> None:
        self.geometry, self.scale, self.development = geometry, scale, development

    def at(self, q: FloatArray) -> TargetPoint:
        """The place itself."""
        return TargetPoint(q, q * self.scale, self.geometry.tangents(q))

    def moved(self, at: TargetPoint, d: FloatArray) -> TargetPoint:
        """Ends of steps d (n, 2) in the frames: along the tangent, back onto the geometry. Unmoved vertices
        keep their places, bit for bit."""
        long = np.linalg.norm(d, axis=1) / (LONGEST_STEP_RADII * self.scale)
        step = np.einsum("nab,nb->na", at.frame, d / np.maximum(long, 1.0)[:, None]) / self.scale
        still = (d == 0).all(1)[:, None]
        return self.at(np.where(still, at.vectors, self.geometry.normal(at.vectors + step)))

    def triangles(
        self, at: TargetPoint, corners: IntArray, faces: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """(3, m, d) corners of some flat faces, and (3, m, d, 2) their derivatives by the steps of the
        vertices; corners (3, m): the vertices of faces (m,). Chords of the sphere, else seen from the middle of
        every face."""
        own = (self.development.corners(x)[faces] for x in (at.vectors, at.frame))
        places, moves = self.geometry.flat(*own)
        return places.transpose(1, 0, 2) * self.scale, moves.transpose(1, 0, 2, 3)


class MeshTarget:
    """Another mesh over the domain. scale: factor of its points."""

    def __init__(self, cover: Cover, scale: float) -> None:
        self.cover, self.mesh = cover, cover.mesh
        self.wall = self.mesh.parent < 0  # faces that close a boundary: nothing moves onto them
        self.corners = p = self.mesh.points[self.mesh.faces] * scale
        d, e = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        normal = np.cross(d, e)
        square = np.maximum((normal * normal).sum(1), 1e-300)
        one = np.cross(e, normal) / square[:, None]
        two = np.cross(normal, d) / square[:, None]
        self.gradients = np.stack([-one - two, one, two], 1)  # (m, 3, 3) of the weights
        self.normals = normal / np.sqrt(square)[:, None]
        self.frames = tangents(self.normals)

    def at(self, on: CoverPoints, q: FloatArray | None = None) -> TargetPoint:
        """Places on the mesh; q (n, 3): their vectors where these are known."""
        q = self.cover.vectors_of(on) if q is None else q
        points = interpolated(on.weights, self.corners[on.face])
        return TargetPoint(q, points, self.frames[on.face], on)

    def triangles(
        self, at: TargetPoint, corners: IntArray, faces: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """The same, as they lie in space."""
        return at.points[corners], at.frame[corners]

    def moved(self, at: TargetPoint, d: FloatArray) -> TargetPoint:
        """Ends of steps as above. The path is straight: at every edge it continues as if the two faces were one
        plane."""
        on = at.on
        face, w, turn = on.face.copy(), on.weights.copy(), on.turn.copy()
        way = np.einsum("nab,nb->na", at.frame, d)
        going = moves = np.flatnonzero((d != 0).any(1))
        for _ in range(MOST_CROSSINGS):
            f = face[going]
            rate = np.einsum("ncd,nd->nc", self.gradients[f], way[going])
            with np.errstate(divide="ignore", invalid="ignore"):
                until = np.where(rate < 0, -w[going] / rate, np.inf)
            k = until.argmin(1)
            first = until[np.arange(len(k)), k]
            share = np.clip(first, 0, 1)
            w[going] = np.maximum(w[going] + share[:, None] * rate, 0)
            half_edge = 3 * f + (k + 1) % 3  # opposite to the corner whose weight ends
            free = ~self.wall[self.mesh.twin[half_edge] // 3] | self.wall[f]
            on_ = (first < 1) & free
            going, half_edge = going[on_], half_edge[on_]
            if len(going) == 0:
                break
            way[going] *= (1 - share[on_])[:, None]
            rows, across = self.cover.development.across(half_edge)
            turn[going[rows]] = turn[going[rows]] @ np.linalg.inv(across)
            way[going] = self._turned(way[going], half_edge)
            other = self.mesh.twin[half_edge]
            new, rows = np.zeros((len(going), 3)), np.arange(len(going))
            new[rows, other % 3] = w[going, (half_edge + 1) % 3]
            new[rows, (other + 1) % 3] = w[going, half_edge % 3]
            w[going], face[going] = new, other // 3
        w /= w.sum(1, keepdims=True)
        there = CoverPoints(face, w, turn)
        q = at.vectors.copy()
        q[moves] = self.cover.vectors_of(CoverPoints(face[moves], w[moves], turn[moves]))
        return self.at(there, q)

    def _turned(self, way: FloatArray, half_edge: IntArray) -> FloatArray:
        """(k, 3) ways in the planes of faces, turned into those across their half-edges."""
        f, k, g = half_edge // 3, half_edge % 3, self.mesh.twin[half_edge] // 3
        edge = self.corners[f, (k + 1) % 3] - self.corners[f, k]
        edge /= np.linalg.norm(edge, axis=1)[:, None]
        out_of, into = np.cross(edge, self.normals[f]), np.cross(edge, self.normals[g])
        along = (way * edge).sum(1)[:, None] * edge
        return np.asarray(along + (way * out_of).sum(1)[:, None] * into, np.float64)


Target: TypeAlias = GeometryTarget | MeshTarget


class Relaxation:
    """One mesh on its way onto a target.

    development: of the mesh over the domain. size: length that is the unit of its faces. fixed: (n,) bool.
    weight: (m,) of each face, of sum 1; 0 if a face does not count. guard: faces stay unflipped in the domain,
    else on the target.
    """

    def __init__(
        self,
        development: Development,
        size: float,
        target: Target,
        fixed: BoolArray,
        weight: FloatArray,
        guard: bool = True,
    ) -> None:
        self.development, self.target, self.fixed, self.guard = development, target, fixed, guard
        self.faces, self.n = development.mesh.faces, len(fixed)
        self.counts = np.flatnonzero(weight > 0)
        self.corners = self.faces[self.counts].T.copy()
        gradients = development.mesh.cut_mesh.in_units_of(size).gradients[self.counts]
        self.gradients = np.ascontiguousarray(gradients.transpose(1, 2, 0))
        self.weight = weight[self.counts]
        self.order = np.argsort(ranks_of(self.development.mesh.cut_mesh), kind="stable")
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

    def energy(self, at: TargetPoint) -> float:
        """The mean energy of the faces that count."""
        jacobian, _ = self.jacobians(self.target.triangles(at, self.corners, self.counts)[0])
        return float((dirichlet.energy(jacobian) * self.weight).sum())

    def direction(self, at: TargetPoint, resting: BoolArray) -> tuple[FloatArray, float]:
        """((n, 2) Newton's step in the frames, its slope); resting (n,): vertices that stay beside the fixed
        ones.
        """
        places, frames = self.target.triangles(at, self.corners, self.counts)
        jacobian, axes = self.jacobians(places)
        n = self.n
        # a corner's frame in the axes of its face; fixed vertices do not move
        into = np.einsum("mad,cmdb->cabm", axes, frames)
        into *= ~(self.fixed | resting)[self.corners][:, None, None]
        p = dirichlet.gradient(jacobian) * self.weight
        q = p[:, 0, None] * self.gradients[0] + p[:, 1, None] * self.gradients[1]  # (2, 3, m)
        local = np.einsum("acm,cabm->cbm", q, into)
        flat = self.corners.ravel()
        g = group_sum(local.transpose(1, 0, 2).reshape(2, -1).T, flat, n)
        values, modes = dirichlet.newton_modes(jacobian)
        m = np.einsum("kadm,dcm->kacm", modes, self.gradients)  # of each mode and corner
        m = np.einsum("kacm,cabm->kcbm", m, into)
        hessian = np.einsum("kaim,kbjm->aibjm", m * (values * self.weight)[:, None, None], m)
        entries = (hessian.ravel(), (self.rows, self.columns))
        matrix = sps.csc_matrix(entries, shape=(2 * n, 2 * n))
        trace = matrix.diagonal().reshape(-1, 2).sum(1)
        free = trace > 0
        mean = trace[free].sum() / max(np.count_nonzero(free), 1)  # none where all are fixed
        ridge = np.where(free, RIDGE_TRACE_SHARE * trace + 1e-3 * RIDGE_TRACE_SHARE * mean, 1.0)
        matrix = sps.csc_matrix(matrix + sps.diags(np.repeat(ridge, 2)))
        d = np.empty((n, 2))
        d[self.order] = Factor(matrix, ordered=True).solve(-g[self.order].ravel()).reshape(-1, 2)
        return d, float((d * g).sum())

    def unflipped(self, at: TargetPoint) -> BoolArray:
        """(m,) bool: the face is not turned over, in the domain where it is guarded, else on the target."""
        if self.guard:
            return ~self.development.turned(at.vectors)
        p, frames = self.target.triangles(at, self.corners, self.counts)
        normal = np.cross(frames[..., 0], frames[..., 1]).sum(0)
        out = np.ones(len(self.faces), bool)
        out[self.counts] = (np.cross(p[1] - p[0], p[2] - p[0]) * normal).sum(1) > 0
        return out

    def run(
        self, at: TargetPoint, steps: int, tolerance: float, monitor: Monitor
    ) -> tuple[TargetPoint, float]:
        """Newton's steps from known places until they gain less than ``tolerance`` of the energy: (where the
        vertices come to lie, the energy)."""
        energy, small = self.energy(at), 0
        for _ in range(steps):
            tick()
            if monitor.expired:
                break
            better = self.step(at, energy)
            if better is None:
                break
            at, after, promised = better
            gain, energy = energy - after, after
            small = small + 1 if gain < tolerance * energy else 0
            if promised < tolerance * energy or small == PATIENCE_STEPS:
                break
        return at, energy

    def step(self, at: TargetPoint, energy: float) -> tuple[TargetPoint, float, float] | None:
        """One step: (its end, the energy there, the gain that Newton's model promised), None if no step is
        better. A step is halved until it lowers the energy and turns no face over.

        Where faces turn over whatever the length of the step, their vertices stay, and the others are asked
        again.
        """
        good, resting = self.unflipped(at), np.zeros(self.n, bool)
        for _ in range(DIRECTION_TRIALS):
            d, slope = self.direction(at, resting)
            for halving in range(MOST_HALVINGS):
                there = self.target.moved(at, d / 2**halving)
                after = self.energy(there)
                if after < energy and not (good & ~self.unflipped(there)).any():
                    return there, after, -slope / 2
            trial = self.target.moved(at, SHORT_STEP_SHARE * d)
            bad = self.development.turned(trial.vectors)
            if not bad.any():
                break
            resting[self.faces[bad]] = True
        return None
