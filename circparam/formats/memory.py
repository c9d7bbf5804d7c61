"""Meshes that come from memory: arrays and trimesh objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.polygons import Polygons
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

if TYPE_CHECKING:
    import trimesh
    from trimesh import Trimesh as Trimesh


@dataclass(frozen=True, eq=False)
class PlainDocument(Document):
    """Triangles or polygons, and perhaps a layout, without a file format that could be kept."""

    polys: Polygons | None = None
    layout: UVMap | None = None

    def polygons(self) -> Polygons:
        """The polygons of the file, or its triangles."""
        return super().polygons() if self.polys is None else self.polys

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """The layout that came with the arrays."""
        return self.layout if uv_set == 0 else None


def from_arrays(
    points: npt.ArrayLike, faces: npt.ArrayLike, uv: npt.ArrayLike | None = None,
    uv_faces: npt.ArrayLike | None = None, *, polygons: IntArray | None = None,
    groups: IntArray | None = None, name: str = "the given arrays",
) -> Document:  # fmt: skip
    """A document from points (n, 3) and faces (m, 3).

    uv: (k, 2), with uv_faces (m, 3) into it, or one row for each vertex where uv_faces is left out.
    Raises InputError where shapes or indices do not fit.
    """
    mesh = Mesh(_numbers(points), whole_numbers(faces, "faces"), polygons, groups)
    layout = None
    if uv is not None:
        table = np.array(uv, np.float64)
        index = mesh.faces.copy() if uv_faces is None else whole_numbers(uv_faces, "uv_faces")
        if table.ndim != 2 or table.shape[1] != 2 or index.shape != mesh.faces.shape:
            raise InputError(
                f"{name}: uv of shape {table.shape} and uv_faces of {index.shape} do not fit"
            )
        if index.max(initial=-1) >= len(table):
            raise InputError(f"{name}: uv_faces name row {int(index.max())} of {len(table)} uv")
        layout = UVMap(table, index)
    return PlainDocument(
        Source(name), "arrays", mesh, (0,) if layout is not None else (), layout=layout
    )


def _numbers(points: npt.ArrayLike) -> FloatArray:
    """Points as float64. Raises InputError for what holds no real numbers."""
    try:
        given = np.asarray(points)
    except ValueError as error:  # rows of several lengths
        raise InputError(f"points are no array of numbers ({error})") from None
    if given.dtype.kind not in "biuf":
        raise InputError(f"points are of type {given.dtype}: real numbers are needed")
    return np.array(given, np.float64)


def whole_numbers(indices: npt.ArrayLike, what: str) -> IntArray:
    """Indices (m, 3) as int64, of any integer type and byte order; ``what`` they are, for messages.

    Raises InputError for floats, which would lose their fractions in silence, for what is no array, for
    quads, and for numbers that int64 does not hold.
    """
    try:
        given = np.asarray(indices)
    except ValueError as error:
        raise InputError(f"{what} are no array of indices ({error})") from None
    if given.size and given.dtype.kind not in "iu":
        raise InputError(
            f"{what} are of type {given.dtype}: indices are integers; convert them, such as with "
            "astype(np.int64)"
        )
    if given.ndim == 2 and given.shape[1] == 4:
        raise InputError(
            f"{what} have shape {given.shape}: these are quads; split each into two triangles"
        )
    if given.dtype.kind == "u" and given.size and given.max() > np.iinfo(np.int64).max:
        raise InputError(f"{what} name vertex {given.max()}: there are not so many")
    return given.astype(np.int64)


def from_trimesh(mesh: trimesh.Trimesh | trimesh.Scene | Any) -> Document:
    """A document from a trimesh.Trimesh, with its uv; a Scene is joined with its node transforms applied.

    Raises InputError for an object without faces, such as a PointCloud.
    """
    if hasattr(mesh, "to_mesh"):  # a Scene
        mesh = mesh.to_mesh()
    if not hasattr(mesh, "faces"):
        raise InputError(
            f"a trimesh {type(mesh).__name__} has no faces: there is nothing to unwrap"
        )
    uv = getattr(getattr(mesh, "visual", None), "uv", None)
    if uv is not None and np.shape(uv) != (len(mesh.vertices), 2):
        uv = None
    return from_arrays(mesh.vertices, mesh.faces, uv, name="the trimesh object")


def to_trimesh(points: FloatArray, faces: IntArray, uv: npt.NDArray[np.float32]) -> Trimesh:
    """Points (k, 3), faces (m, 3) and a uv for each point (k, 2) as a trimesh.Trimesh, in their order."""
    import trimesh

    visual = trimesh.visual.TextureVisuals(uv=uv.astype(np.float64))  # type: ignore[no-untyped-call]
    return trimesh.Trimesh(vertices=points, faces=faces, visual=visual, process=False)
