"""What a sheet is relaxed onto: the unit sphere itself, or another sheet through its places on the sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.maps.base import Geometry
from circparam.maps.cones import Locator
from circparam.maps.sheet import Sheet

CROSSINGS = 60  # edges that one step crosses at most
FARTHEST = 0.5  # step in the hyperbolic plane, in radii of curvature


@dataclass(frozen=True, eq=False)
class Spot:
    """Where vertices are. sphere (n, 3): their directions; points (n, 3) on the target; frame (n, 3, 2): two
    tangents there, orthonormal; face (n,) and weights (n, 3): the place, None on the sphere itself; turn
    (n, 3, 3): where the target has handles, from the frame of the face to that of the vertex."""

    sphere: FloatArray
    points: FloatArray
    frame: FloatArray
    face: IntArray | None = None
    weights: FloatArray | None = None
    turn: FloatArray | None = None

    @property
    def place(self) -> tuple[IntArray, FloatArray]:
        """(face, weights) on a sheet."""
        if self.face is None or self.weights is None:
            raise TypeError("a place on the sphere itself has no face")
        return self.face, self.weights

    def normals(self) -> FloatArray:
        """(n, 3) unit normals of the target."""
        return np.cross(self.frame[:, :, 0], self.frame[:, :, 1])


class Target(Protocol):
    """A surface over the sphere."""

    def at(self, q: FloatArray) -> Spot:
        """What lies at directions q (n, 3)."""

    def moved(self, spot: Spot, d: FloatArray) -> Spot:
        """Where steps d (n, 2) in the frames lead; what does not move keeps its place, bit for bit."""


def tangents(normal: FloatArray) -> FloatArray:
    """(n, 3, 2) two unit vectors at right angles to each other and to unit vectors (n, 3)."""
    axis = np.eye(3)[np.abs(normal).argmin(1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normal, first)], 2)


class Sphere:
    """The sphere of a given radius."""

    def __init__(self, radius: float) -> None:
        self.radius = radius

    def at(self, q: FloatArray) -> Spot:
        """The place itself."""
        return Spot(q, q * self.radius, tangents(q))

    def moved(self, spot: Spot, d: FloatArray) -> Spot:
        """Along the tangent, back onto the sphere."""
        q = spot.sphere + np.einsum("nab,nb->na", spot.frame, d) / self.radius
        q /= np.linalg.norm(q, axis=1)[:, None]
        still = (d == 0).all(1)
        q[still] = spot.sphere[still]
        return self.at(q)


class Plane:
    """The geometry of a surface with handles itself, at a given scale."""

    def __init__(self, geometry: Geometry, scale: float) -> None:
        self.geometry, self.scale = geometry, scale

    def at(self, q: FloatArray) -> Spot:
        """The place itself."""
        return Spot(q, q * self.scale, self.geometry.tangents(q))

    def moved(self, spot: Spot, d: FloatArray) -> Spot:
        """Along the tangent, back onto the hyperboloid."""
        long = np.linalg.norm(d, axis=1) / (FARTHEST * self.scale)
        step = np.einsum("nab,nb->na", spot.frame, d / np.maximum(long, 1.0)[:, None]) / self.scale
        still = (d == 0).all(1)[:, None]
        return self.at(np.where(still, spot.sphere, self.geometry.normal(spot.sphere + step)))


class Domain(Protocol):
    """A sheet over its domain: the sphere, or the geometry of a surface with handles."""

    @property
    def sheet(self) -> Sheet:
        """The sheet."""

    def direction(self, face: IntArray, w: FloatArray) -> FloatArray:
        """(k, 3) vectors of places with weights (k, 3) in faces."""

    def crossed(self, turn: FloatArray, who: IntArray, half_edge: IntArray) -> None:
        """Places ``who`` go across half-edges: their turns go on, in place."""


class SheetTarget:
    """Another sheet over the domain. scale: by what its points are multiplied."""

    def __init__(self, locator: Domain, scale: float) -> None:
        self.locator = locator
        self.faces = locator.sheet.faces
        self.twin = locator.sheet.twin
        self.wall = locator.sheet.parent < 0  # what closes a boundary: nothing moves onto it
        p = locator.sheet.points[self.faces] * scale
        d, e = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        normal = np.cross(d, e)
        square = np.maximum((normal * normal).sum(1), 1e-300)
        one = np.cross(e, normal) / square[:, None]
        two = np.cross(normal, d) / square[:, None]
        self.gradients = np.stack([-one - two, one, two], 1)  # (m, 3, 3) of the weights
        self.corners = p
        self.normals = normal / np.sqrt(square)[:, None]
        self.frames = tangents(self.normals)

    def at(self, q: FloatArray) -> Spot:
        """The point of the sheet in each direction, with the plane of its face."""
        if not isinstance(self.locator, Locator):
            raise TypeError("a place over a surface with handles is found from a face near it")
        face, w = self.locator.find(q)
        return self.spot(q, face, w)

    def spot(
        self, q: FloatArray, face: IntArray, w: FloatArray, turn: FloatArray | None = None
    ) -> Spot:
        """The points with weights in faces."""
        points = np.einsum("nc,ncd->nd", w, self.corners[face])
        return Spot(q, points, self.frames[face], face, w, turn)

    def moved(self, spot: Spot, d: FloatArray) -> Spot:
        """Straight over the sheet: at every edge the way goes on as if the two faces were one plane."""
        face, w = spot.place
        face, w = face.copy(), w.copy()
        turn = None if spot.turn is None else spot.turn.copy()
        way = np.einsum("nab,nb->na", spot.frame, d)
        going = np.flatnonzero((d != 0).any(1))
        moves = going
        for _ in range(CROSSINGS):
            f = face[going]
            rate = np.einsum("ncd,nd->nc", self.gradients[f], way[going])
            with np.errstate(divide="ignore", invalid="ignore"):
                until = np.where(rate < 0, -w[going] / rate, np.inf)
            k = until.argmin(1)
            share = np.clip(until[np.arange(len(k)), k], 0, 1)
            w[going] = np.maximum(w[going] + share[:, None] * rate, 0)
            on = until[np.arange(len(k)), k] < 1
            going, k, share = going[on], k[on], share[on]
            into = self.twin[3 * face[going] + (k + 1) % 3] // 3
            free = ~self.wall[into] | self.wall[face[going]]
            going, k, share = going[free], k[free], share[free]
            if len(going) == 0:
                break
            way[going] *= (1 - share)[:, None]
            if turn is not None:
                self.locator.crossed(turn, going, 3 * face[going] + (k + 1) % 3)
            self._cross(going, k, face, w, way)
        w /= w.sum(1, keepdims=True)
        q = spot.sphere.copy()
        there = self.locator.direction(face[moves], w[moves])
        q[moves] = there if turn is None else np.einsum("nij,nj->ni", turn[moves], there)
        return self.spot(q, face, w, turn)

    def _cross(
        self, going: IntArray, k: IntArray, face: IntArray, w: FloatArray, way: FloatArray
    ) -> None:
        """Into the face across the edge opposite to corner k, in place; ``way`` turns with the faces."""
        f = face[going]
        h = 3 * f + (k + 1) % 3
        other = self.twin[h]
        g = other // 3
        edge = self.corners[f, (k + 2) % 3] - self.corners[f, (k + 1) % 3]
        edge /= np.linalg.norm(edge, axis=1)[:, None]
        along = (way[going] * edge).sum(1)[:, None]
        out_of, into = np.cross(edge, self.normals[f]), np.cross(edge, self.normals[g])
        across = (way[going] * out_of).sum(1)[:, None]
        way[going] = along * edge + across * into
        new = np.zeros((len(g), 3))
        rows, c = np.arange(len(g)), other % 3
        new[rows, c] = w[going, (k + 2) % 3]
        new[rows, (c + 1) % 3] = w[going, (k + 1) % 3]
        w[going], face[going] = new, g
