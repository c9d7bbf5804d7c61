"""What a mesh is relaxed onto: the geometry of its domain itself, or another mesh over that domain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.maps.cover import Cover, CoverPoints, Development
from circparam.maps.geometries import Geometry, tangents

MOST_CROSSINGS = 60  # edges that one step crosses at most
LONGEST_STEP = 0.5  # radii of curvature that a vertex moves in one step at most


@dataclass(frozen=True, eq=False)
class TargetPoint:
    """Where vertices are. vectors (n, 3): in their frames over the domain; points (n, 3) on the target; frame
    (n, 3, 2): two tangents there, orthonormal; on: the places on a mesh, None on a geometry."""

    vectors: FloatArray
    points: FloatArray
    frame: FloatArray
    on: CoverPoints | None = None

    @property
    def cover_points(self) -> CoverPoints:
        """The places on a mesh."""
        if self.on is None:
            raise TypeError("a place in a geometry lies on no face")
        return self.on


class Target(Protocol):
    """A surface over the domain."""

    def moved(self, at: TargetPoint, d: FloatArray) -> TargetPoint:
        """Where steps d (n, 2) in the frames lead; what does not move keeps its place, bit for bit."""

    def triangles(
        self, at: TargetPoint, corners: IntArray, faces: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """(3, m, d) corners of some flat faces, and (3, m, d, 2) how they move with the steps of the vertices;
        corners (3, m): the vertices of faces (m,)."""


class GeometryTarget:
    """The geometry of the domain, at a given scale; development: of the mesh that lies on it."""

    def __init__(self, geometry: Geometry, scale: float, development: Development) -> None:
        self.geometry, self.scale, self.development = geometry, scale, development

    def at(self, q: FloatArray) -> TargetPoint:
        """The place itself."""
        return TargetPoint(q, q * self.scale, self.geometry.tangents(q))

    def moved(self, at: TargetPoint, d: FloatArray) -> TargetPoint:
        """Along the tangent, back onto the geometry."""
        long = np.linalg.norm(d, axis=1) / (LONGEST_STEP * self.scale)
        step = np.einsum("nab,nb->na", at.frame, d / np.maximum(long, 1.0)[:, None]) / self.scale
        still = (d == 0).all(1)[:, None]
        return self.at(np.where(still, at.vectors, self.geometry.normal(at.vectors + step)))

    def triangles(
        self, at: TargetPoint, corners: IntArray, faces: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Chords of the sphere, else seen from the middle of every face."""
        own = (self.development.corners(x)[faces] for x in (at.vectors, at.frame))
        places, moves = self.geometry.flat(*own)
        return places.transpose(1, 0, 2) * self.scale, moves.transpose(1, 0, 2, 3)


class MeshTarget:
    """Another mesh over the domain. scale: by what its points are multiplied."""

    def __init__(self, cover: Cover, scale: float) -> None:
        self.cover, self.mesh = cover, cover.mesh
        self.wall = self.mesh.parent < 0  # what closes a boundary: nothing moves onto it
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
        points = np.einsum("nc,ncd->nd", on.weights, self.corners[on.face])
        return TargetPoint(q, points, self.frames[on.face], on)

    def triangles(
        self, at: TargetPoint, corners: IntArray, faces: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """As they lie in space."""
        return at.points[corners], at.frame[corners]

    def moved(self, at: TargetPoint, d: FloatArray) -> TargetPoint:
        """Straight over the mesh: at every edge the way goes on as if the two faces were one plane."""
        on = at.cover_points
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
            self.cover.crossed(turn, going, half_edge)
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
