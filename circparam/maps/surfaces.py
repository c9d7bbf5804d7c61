"""The door to maps between two surfaces: what ``circparam.map_surfaces`` and ``circparam map`` call."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeAlias, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from circparam.core.monitor import Listener, Monitor
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.io import read
from circparam.formats.sidecars import read_landmarks, read_paths
from circparam.maps.map_surfaces import Given, MapResult, map_meshes
from circparam.mesh.mesh import Mesh, UVMap

Surface: TypeAlias = (
    "Mesh | Document | str | os.PathLike[str] | tuple[npt.ArrayLike, npt.ArrayLike]"
)


class Keywords(TypedDict, total=False):
    """Further arguments of ``map_surfaces``, which tells about them."""

    method: str
    mirrored: bool
    relax: bool
    overlay: bool


def map_surfaces(
    a: Surface,
    b: Surface,
    *,
    landmarks: npt.ArrayLike | str | os.PathLike[str] | None = None,
    paths: Sequence[Sequence[int]] | None = None,
    charts: bool = False,
    listener: Listener | None = None,
    **keywords: Unpack[Keywords],
) -> MapResult:
    """A one-to-one map between two connected surfaces with as many handles and boundaries.

    a, b: a file, a Document, a Mesh, or (points, faces). landmarks: (k, 2) pairs of vertices of a and b that
    the map takes to each other exactly, counted from 0, or a file with a pair on each line; None: surfaces that
    lie alike get some from their alignment. paths: sequences of vertices of a that are landmarks; the shortest
    paths between them are the first cuts on both (a file of landmarks may hold lines ``path 1 2 3 1``); handles
    are cut by shortest paths between landmarks where none are given. charts: both files have uv whose charts
    correspond, which are mapped chart on chart. method: the weights of the convex maps, any that are positive
    (circle, mean-value, floater, uniform). mirrored: b is the mirror image of what is meant. relax: False keeps
    the composition of the convex maps. overlay: True adds the common refinement of both (``map.overlay``), of
    closed surfaces.

    Returns a MapResult: ``map`` (a SurfaceMap; ``circparam.save_map`` writes it), distortion both ways,
    inversions. Raises InputError for landmarks that name no vertex or the same one twice, TopologyError where
    the surfaces differ, look mirrored, or the landmarks have no common layout, OptionError for a method whose
    weights can be negative, NoResultError where double precision cannot hold the map.
    """
    pairs, ways = None, [[int(v) for v in path] for path in paths or []]
    if isinstance(landmarks, (str, os.PathLike)):
        pairs = read_landmarks(landmarks)
        ways += read_paths(landmarks)
    elif landmarks is not None:
        given = np.asarray(landmarks)
        if given.ndim != 2 or given.shape[1] != 2 or not np.issubdtype(given.dtype, np.integer):
            raise InputError(
                f"landmarks have shape {given.shape} and type {given.dtype}: (k, 2) whole numbers are needed"
            )
        pairs = given.astype(np.int64)
    if ways and pairs is None:
        raise InputError("paths lead from landmark to landmark, and no landmarks are given")
    meshes = _mesh(a), _mesh(b)
    layouts = (_layout(a, "A"), _layout(b, "B")) if charts else None
    unknown = set(keywords) - set(Keywords.__annotations__)
    if unknown:
        raise TypeError(f"map_surfaces has no argument {sorted(unknown)[0]!r}")
    return map_meshes(*meshes, Given(pairs, ways, layouts, **keywords), Monitor(listener))


def _layout(surface: Surface, name: str) -> UVMap:
    """The first uv set of a document."""
    if isinstance(surface, (str, os.PathLike)):
        surface = read(surface)
    found = surface.uv() if isinstance(surface, Document) else None
    if found is None:
        raise InputError(f"{name}: it has no uv, and --charts needs the charts of both surfaces")
    return found


def _mesh(surface: Surface) -> Mesh:
    if isinstance(surface, Mesh):
        return surface
    if isinstance(surface, Document):
        return surface.mesh
    if isinstance(surface, tuple):
        return Mesh(np.asarray(surface[0], np.float64), np.asarray(surface[1], np.int64))
    return read(surface).mesh
