"""Pairs of surfaces of every topology with landmarks, and their maps, each made once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

import circparam
from circparam.maps.map_surfaces import MapResult
from circparam.mesh.mesh import Mesh
from tests.support import pairs, shapes, tori


@dataclass(frozen=True, eq=False)
class Pair:
    """Two surfaces of one topology; marks (k, 2): vertices that correspond."""

    a: Mesh
    b: Mesh
    marks: np.ndarray

    @property
    def turned(self) -> Pair:
        """B first."""
        return Pair(self.b, self.a, self.marks[:, ::-1])


def blobs() -> Pair:
    a, b = pairs.blob(2, 1), pairs.blob(3, 4, turned=5)
    return Pair(a, b, pairs.marks(a, b))


def toruses() -> Pair:
    a, b = tori.torus(18, 9), tori.torus(20, 12, 0.2)
    return Pair(a, b, tori.marks(a, b))


def plates() -> Pair:
    a, b = tori.plate(2), tori.plate(2, fine=True)
    own = tori.spread(a, 16)
    return Pair(a, b, np.stack([own, pairs.nearest(b, a.points[own])], 1))


def disks() -> Pair:
    a, b = Mesh(*shapes.bumped_disk(300, seed=0)), Mesh(*shapes.bumped_disk(400, seed=3))
    places = np.array([[1.0, 0, 0], [-1, 0, 0], [-0.4, -0.3, 0.3]])
    return Pair(a, b, np.stack([pairs.nearest(m, places) for m in (a, b)], 1))


def rings() -> Pair:
    a, b = Mesh(*shapes.annulus(40, 8)), Mesh(*shapes.annulus(32, 6))
    return Pair(a, b, np.array([[int(m.points[:, 0].argmax()) for m in (a, b)]]))


def holed_toruses() -> Pair:
    meshes = []
    for mesh in (tori.torus(24, 12), tori.torus(30, 15)):
        at = tori.angles(mesh.points[mesh.faces].mean(1))
        keep = np.linalg.norm(at - [0.8, 0.8], axis=1) > 0.65
        used, faces = np.unique(mesh.faces[keep], return_inverse=True)
        meshes.append(Mesh(mesh.points[used], faces.reshape(-1, 3)))
    return Pair(*meshes, tori.marks(*meshes))


CLOSED = {"sphere": blobs, "torus": toruses, "genus 2": plates}
OPEN = {"disk": disks, "ring": rings, "holed torus": holed_toruses}
KINDS = [*CLOSED, *OPEN]


@cache
def pair(kind: str) -> Pair:
    """The surfaces of a kind."""
    return (CLOSED | OPEN)[kind]()


@cache
def mapped(kind: str, relax: bool = True) -> MapResult:
    """Their map, with the overlay where they are closed."""
    case = pair(kind)
    return circparam.map_surfaces(
        case.a, case.b, landmarks=case.marks, relax=relax, overlay=kind in CLOSED
    )


def boundary(mesh: Mesh) -> np.ndarray:
    """(k,) vertices on the boundary."""
    return shapes.boundary(mesh.faces)
