"""The door to maps between two surfaces: what ``circparam.map_surfaces`` and ``circparam map`` call."""

from __future__ import annotations

import os
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.monitor import Listener, Monitor
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.io import read
from circparam.formats.sidecars import read_landmarks
from circparam.maps.map_surfaces import MapResult, map_meshes
from circparam.mesh.mesh import Mesh

Surface: TypeAlias = (
    "Mesh | Document | str | os.PathLike[str] | tuple[npt.ArrayLike, npt.ArrayLike]"
)


def map_surfaces(
    a: Surface,
    b: Surface,
    *,
    landmarks: npt.ArrayLike | str | os.PathLike[str] | None = None,
    method: str = "mean-value",
    mirrored: bool = False,
    relax: bool = True,
    listener: Listener | None = None,
) -> MapResult:
    """A one-to-one map between two surfaces of genus 0 with as many boundaries: spheres and disks, with or
    without holes.

    a, b: a file, a Document, a Mesh, or (points, faces). landmarks: (k, 2) pairs of vertices of a and b that
    the map
    takes to each other exactly, counted from 0, or a file with a pair on each line; None: surfaces that lie
    alike get
    some from their alignment. method: the weights of the convex maps, any that are positive (circle,
    mean-value, floater,
    uniform). mirrored: b is the mirror image of what is meant. relax: False keeps the composition of the
    convex maps.

    Returns a MapResult: ``map`` (a SurfaceMap; ``circparam.save_map`` writes it), distortion both ways,
    inversions.
    Raises InputError for landmarks that name no vertex or the same one twice, TopologyError where the
    surfaces differ, look
    mirrored, or the landmarks have no common layout, OptionError for a method whose weights can be negative,
    NoResultError
    where double precision cannot hold the map.
    """
    pairs = None
    if isinstance(landmarks, (str, os.PathLike)):
        pairs = read_landmarks(landmarks)
    elif landmarks is not None:
        given = np.asarray(landmarks)
        if given.ndim != 2 or given.shape[1] != 2 or not np.issubdtype(given.dtype, np.integer):
            raise InputError(
                f"landmarks have shape {given.shape} and type {given.dtype}: (k, 2) whole numbers are needed"
            )
        pairs = given.astype(np.int64)
    return map_meshes(
        _mesh(a),
        _mesh(b),
        pairs,
        method=method,
        mirrored=mirrored,
        relax=relax,
        monitor=Monitor(listener),
    )


def _mesh(surface: Surface) -> Mesh:
    if isinstance(surface, Mesh):
        return surface
    if isinstance(surface, Document):
        return surface.mesh
    if isinstance(surface, tuple):
        return Mesh(np.asarray(surface[0], np.float64), np.asarray(surface[1], np.int64))
    return read(surface).mesh
