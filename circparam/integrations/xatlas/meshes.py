"""Meshes as they are added to an atlas, checked as xatlas checks them, and put side by side in space."""

import numpy as np
import numpy.typing as npt

from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.joined import join
from circparam.formats.memory import PlainDocument, from_arrays, whole_numbers
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh


class ArrayError(InputError, ValueError):
    """An array has a wrong shape: a ValueError, as xatlas raises it."""


class MeshError(InputError, RuntimeError):
    """A mesh cannot be added: a RuntimeError, as xatlas raises it."""


@dataclass(frozen=True, eq=False)
class AddedMesh:
    """One mesh of an atlas.

    mesh: its triangles. uvs: (n, 2) of its vertices, None where none were given. vertex: (n,) the vertex of the
    caller that each is. materials: (m,) of its faces, None for an ordinary mesh. laid_out: the charts are made
    already (``add_uv_mesh``): its points are (u, v, number of the chart).
    """

    mesh: Mesh
    uvs: FloatArray | None
    vertex: IntArray
    materials: IntArray | None = None
    laid_out: bool = False


def added_mesh(
    positions: npt.ArrayLike,
    indices: npt.ArrayLike,
    normals: npt.ArrayLike | None,
    uvs: npt.ArrayLike | None,
) -> AddedMesh:
    """A mesh out of arrays: positions (n, 3), indices (m, 3), normals (n, 3) and uvs (n, 2) or None.

    Normals are checked and not needed: the surface itself is measured. Raises ArrayError, MeshError,
    InputError.
    """
    points = table(positions, 3, "Position")
    n = len(points)
    faces = triangles(indices, n)
    if normals is not None:
        table(normals, 3, "Normal", rows=n)
    layout = None if uvs is None else table(uvs, 2, "Texture coordinate", rows=n)
    return AddedMesh(Mesh(points, faces), layout, np.arange(n))


def added_uv_mesh(
    uvs: npt.ArrayLike, indices: npt.ArrayLike, face_materials: npt.ArrayLike | None
) -> AddedMesh:
    """A mesh of uv alone: uvs (n, 2), indices (m, 3), face_materials (m,) or None; to be packed again.

    Charts are the faces of one material that hang together through vertices. Each lies on a level of its own in
    space, so that charts that are stacked in uv stay charts of their own. Raises ArrayError, MeshError,
    InputError.
    """
    plane = table(uvs, 2, "Texture coordinate")
    faces = triangles(indices, len(plane))
    m = len(faces)
    materials = np.zeros(m, np.int64)
    if face_materials is not None:
        materials = whole_numbers(face_materials, "face_materials")
        if materials.shape != (m,):
            raise ArrayError(
                f"Face material array expected to be Nx1 with {m} rows, one a face: its shape is "
                f"{materials.shape}"
            )
    # a vertex between two materials is two: charts end there
    key = faces * (int(materials.max()) + 1) + materials[:, None]
    distinct, corner = np.unique(key, return_inverse=True)
    corner = corner.reshape(-1, 3)
    vertex = distinct // (int(materials.max()) + 1)
    _, level = components(
        len(vertex), np.repeat(corner[:, 0], 2), np.ascontiguousarray(corner[:, 1:]).ravel()
    )
    uv = plane[vertex]
    # levels as far apart as the layout is wide
    height = level * max(float(np.ptp(uv, axis=0).max()), 1.0)
    return AddedMesh(Mesh(np.c_[uv, height], corner), uv, vertex, materials, laid_out=True)


def table(values: npt.ArrayLike, columns: int, what: str, rows: int | None = None) -> FloatArray:
    """Real numbers (n, columns) as float64. Raises ArrayError where the shape is another."""
    given = np.asarray(values)
    if given.ndim != 2 or given.shape[1] != columns:
        raise ArrayError(
            f"{what} array expected to be Nx{columns}: its shape is {given.shape}, reshape it"
        )
    if given.dtype.kind not in "biuf":
        raise ArrayError(
            f"{what} array is of type {given.dtype}: real numbers are expected, convert it"
        )
    if rows is not None and len(given) != rows:
        raise ArrayError(
            f"{what} array has invalid number of elements in the first dimension "
            f"(expected {rows}, got {len(given)}): give one for each vertex"
        )
    return given.astype(np.float64)


def triangles(indices: npt.ArrayLike, n: int) -> IntArray:
    """Faces (m, 3) over n vertices as int64; floats that are whole numbers too, as xatlas takes them.

    Raises ArrayError for another shape or for fractions, MeshError where a face names a vertex that is not
    there.
    """
    given = np.asarray(indices)
    if given.ndim != 2 or given.shape[1] != 3:
        raise ArrayError(
            f"Index array expected to be Nx3: its shape is {given.shape}, give three vertices a face"
        )
    if given.dtype.kind == "f" and np.array_equal(given, np.rint(given)):
        given = given.astype(np.int64)
    faces = whole_numbers(given, "indices")
    if faces.size and (faces.min() < 0 or faces.max() >= n):
        bad = int(faces[(faces < 0) | (faces >= n)][0])
        raise MeshError(
            f"Adding mesh failed: Index out of range: {bad}, the vertices are 0 to {n - 1}"
        )
    return faces


def joined_document(meshes: list[AddedMesh]) -> Document:
    """All meshes as one document: faces and vertices of the first, of the second, and so on.

    Each gets a cell of its own in space, so that no vertices of two meshes coincide and are welded.
    """
    name = "the mesh" if len(meshes) == 1 else f"the {len(meshes)} meshes of the atlas"
    whole = join([PlainDocument(Source(name), "arrays", added.mesh) for added in meshes]).mesh
    tables = [added.uvs for added in meshes if added.uvs is not None]
    uv = np.concatenate(tables) if len(tables) == len(meshes) else None
    return from_arrays(whole.points, whole.faces, uv, name=name)
