"""The map between two surfaces as data: places on faces, both ways, and the file that keeps them (.npz).

It also tells which way round a map fits two documents, and moves one mesh onto the other.
"""

import hashlib
import io
import os
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from circparam.core.arrays import interpolated, normals_of, unit
from circparam.core.files import write_files
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.mesh.mesh import Mesh

FORMAT = "circparam-map-1"
MIRRORED_SHARE = 0.5  # share of faces turned over from which a surface looks mirrored


@dataclass(frozen=True, eq=False)
class Places:
    """Places on the faces of a mesh: face (k,) int64, weights (k, 3) float64 barycentric, ≥ 0, of sum 1."""

    face: IntArray
    weights: FloatArray

    def take(self, rows: Any) -> Self:
        """Some of the places."""
        return type(self)(*(values[rows] for values in vars(self).values()))

    def put(self, rows: IntArray, other: Self) -> Self:
        """Other places in some rows, in place; returns these places."""
        for name, values in vars(self).items():
            values[rows] = getattr(other, name)
        return self

    @classmethod
    def joined(cls, *parts: Self) -> Self:
        """The places of several, one after the other."""
        return cls(*map(np.concatenate, zip(*(vars(part).values() for part in parts), strict=True)))

    @staticmethod
    def along(half_edge: IntArray, share: FloatArray) -> "Places":
        """Places (k) so far along half-edges 3f + corner."""
        k, t = half_edge % 3, share[:, None]
        return Places(half_edge // 3, (1 - t) * np.eye(3)[k] + t * np.eye(3)[(k + 1) % 3])

    def of(self, values: FloatArray, faces: IntArray) -> FloatArray:
        """(k, d) values ((n, d) a vertex) interpolated at the places; faces: (m, 3) of that mesh."""
        return interpolated(self.weights, values[faces[self.face]])


@dataclass(frozen=True, eq=False)
class Refinement:
    """The overlay of both meshes, which takes places straight from one mesh to the other.

    faces (m, 3): triangles of k vertices. parents (m, 2): the face of A and the face of B that each is a part
    of. on_a, on_b: (k) places of the vertices on both.
    """

    faces: IntArray
    parents: IntArray
    on_a: Places
    on_b: Places

    def turned(self) -> "Refinement":
        """B first."""
        return Refinement(self.faces, self.parents[:, ::-1], self.on_b, self.on_a)


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """Where every vertex of A lies on B and every vertex of B on A; vertices and faces as the files have them.

    to_b: (n_A) places on B. to_a: (n_B) places on A. a, b: fingerprints of the meshes it was made for.
    overlay: the common refinement, None if none was asked for.
    """

    to_b: Places
    to_a: Places
    a: str
    b: str
    overlay: Refinement | None = None

    def check(self, a: Mesh, b: Mesh) -> None:
        """Raises InputError if the map was made for other meshes, or holds places that they do not have."""
        for mesh, mark, name in ((a, self.a, "first"), (b, self.b, "second")):
            if fingerprint(mesh) != mark:
                raise InputError(
                    f"the map was made for another {name} mesh: make it again with circparam map"
                )

        for places, at, on in ((self.to_b, a, b), (self.to_a, b, a)):
            face = places.face
            if len(face) != len(at.points) or face.max(initial=-1) >= len(on.faces):
                raise InputError(
                    "the map is damaged (it names places that its meshes do not have): make it again with "
                    "circparam map"
                )

    def turned(self) -> "SurfaceMap":
        """The map from B to A."""
        overlay = None if self.overlay is None else self.overlay.turned()
        return SurfaceMap(self.to_a, self.to_b, self.b, self.a, overlay)


def fingerprint(mesh: Mesh) -> str:
    """Identity of a mesh: a hash of its triangles' vertex numbers and the number of vertices.

    Positions are left out: a pose or another unit keeps the map.
    """
    return hashlib.sha256(
        np.array([len(mesh.points), len(mesh.faces)]).tobytes() + mesh.faces.tobytes()
    ).hexdigest()


def oriented(mapped: SurfaceMap, target: Document, source: Document) -> SurfaceMap:
    """The map from target to source, whichever way round it was made.

    Raises InputError if it was made for other meshes, or is damaged.
    """
    marks = fingerprint(target.mesh), fingerprint(source.mesh)
    for found in (mapped, mapped.turned()):
        if marks == (found.a, found.b):
            found.check(target.mesh, source.mesh)
            return found
    lone = target if marks[0] not in (mapped.a, mapped.b) else source
    raise InputError(
        f"{lone.source.name}: the map was made for another mesh (other faces or vertex numbers): make it again "
        f"with circparam map {target.source.name} {source.source.name}"
    )


def moved(mapped: SurfaceMap, target: Mesh, source: Mesh) -> FloatArray:
    """(n, 3) the points of the target at their places on the source; unused points stay."""
    out = target.points.copy()
    used = np.unique(target.faces)
    out[used] = mapped.to_b.take(used).of(source.points, source.faces)
    return out


def turned_over(mapped: SurfaceMap, target: Mesh, source: Mesh) -> BoolArray:
    """(m,) faces of the target that look against the source once they are moved onto it."""
    normal = normals_of(moved(mapped, target, source)[target.faces])
    there = mapped.to_b.face[target.faces]
    own = unit(normals_of(source.corners))
    return (normal * own[there].sum(1)).sum(1) < 0


def save_map(path: str | os.PathLike[str], found: SurfaceMap, overwrite: bool = False) -> None:
    """Write a map as .npz. Raises OptionError if the file exists, OutputError if the disk refuses."""
    out = io.BytesIO()
    arrays: dict[str, Any] = {"format": FORMAT, "a": found.a, "b": found.b}
    arrays |= _stored("a", found.to_b) | _stored("b", found.to_a)
    if (o := found.overlay) is not None:
        arrays |= {"o_faces": o.faces, "o_parents": o.parents}
        arrays |= _stored("o_a", o.on_a) | _stored("o_b", o.on_b)
    np.savez_compressed(out, **arrays)
    write_files({Path(path): out.getvalue()}, overwrite)


def _stored(name: str, places: Places) -> dict[str, np.ndarray]:
    return {f"{name}_face": places.face, f"{name}_weights": places.weights}


def load_map(path: str | os.PathLike[str]) -> SurfaceMap:
    """Read a file of ``save_map``. Raises InputError if the file holds something else."""
    try:
        with open(path, "rb") as file:
            if not zipfile.is_zipfile(file):
                raise ValueError("it is not an .npz file")
        with np.load(path, allow_pickle=False) as data:
            if str(data["format"]) != FORMAT:
                raise ValueError(f"its format is {data['format']}")
            to_b, to_a = (_places(data, k) for k in "ab")
            a, b = str(data["a"]), str(data["b"])
            overlay = _refinement(data)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (KeyError, ValueError, zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise InputError(
            f"{path}: not a map between surfaces ({error}); make one with circparam map"
        ) from None
    return SurfaceMap(to_b, to_a, a, b, overlay)


def _refinement(data: Mapping[str, np.ndarray]) -> Refinement | None:
    """The overlay as a file has it. Raises ValueError if it is none."""
    if "o_faces" not in data:
        return None
    faces, parents = data["o_faces"], data["o_parents"]
    on_a, on_b = (_places(data, k) for k in ("o_a", "o_b"))
    if faces.dtype.kind not in "iu" or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError("its overlay has no triangles")
    if parents.dtype.kind not in "iu" or parents.shape != (len(faces), 2):
        raise ValueError("the triangles of its overlay lie in no faces")
    if faces.min(initial=0) < 0 or faces.max(initial=-1) >= min(len(on_a.face), len(on_b.face)):
        raise ValueError("its overlay names vertices that it does not have")
    return Refinement(faces.astype(np.int64), parents.astype(np.int64), on_a, on_b)


def _places(data: Mapping[str, np.ndarray], name: str) -> Places:
    """Places as a file has them. Raises ValueError if they cannot be any."""
    face, weights = data[f"{name}_face"], data[f"{name}_weights"]
    if face.dtype.kind not in "iu" or weights.dtype.kind != "f" or face.ndim != 1:
        raise ValueError("its arrays are of another kind")
    if weights.shape != (len(face), 3):
        raise ValueError("its arrays are of different lengths")
    if face.min(initial=0) < 0 or not np.isfinite(weights).all():
        raise ValueError("its places are invalid")
    return Places(face.astype(np.int64), weights.astype(np.float64))
