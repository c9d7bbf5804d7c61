"""The map between two surfaces as data: places on faces, both ways, and the file that keeps them (.npz)."""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.files import write_files
from circparam.errors import InputError
from circparam.mesh.mesh import Mesh

FORMAT = "circparam-map-1"


@dataclass(frozen=True, eq=False)
class Places:
    """Places on the faces of a mesh: face (k,) int64, weights (k, 3) float64 barycentric, ≥ 0, of sum 1."""

    face: IntArray
    weights: FloatArray

    def of(self, values: FloatArray, faces: IntArray) -> FloatArray:
        """(k, d) values ((n, d) a vertex) interpolated at the places; faces: (m, 3) of that mesh."""
        out: FloatArray = np.einsum("kc,kcd->kd", self.weights, values[faces[self.face]])
        return out


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """Where every vertex of A lies on B and every vertex of B on A; vertices and faces as the files have them.

    to_b: (n_A) places on B. to_a: (n_B) places on A. a, b: fingerprints of the meshes it was made for.
    """

    to_b: Places
    to_a: Places
    a: str
    b: str

    def check(self, a: Mesh, b: Mesh) -> None:
        """Raises InputError where the map was made for other meshes, or holds places that they do not have."""
        for mesh, mark, name in ((a, self.a, "first"), (b, self.b, "second")):
            if fingerprint(mesh) != mark:
                raise InputError(
                    f"the map was made for another {name} mesh: make it again with circparam map"
                )

        for places, at, on in ((self.to_b, a, b), (self.to_a, b, a)):
            face = places.face
            if len(face) != len(at.points) or face.max(initial=-1) >= len(on.faces):
                raise InputError(
                    "the map is damaged (it tells places that its meshes do not have): make it again with "
                    "circparam map"
                )

    def turned(self) -> SurfaceMap:
        """The map from B to A."""
        return SurfaceMap(self.to_a, self.to_b, self.b, self.a)


def fingerprint(mesh: Mesh) -> str:
    """What tells a mesh from others: a hash of its triangles' vertex numbers and the number of vertices.

    Positions are left out: a pose or another unit keeps the map.
    """
    return hashlib.sha256(
        np.array([len(mesh.points), len(mesh.faces)]).tobytes() + mesh.faces.tobytes()
    ).hexdigest()


def save_map(path: str | os.PathLike[str], found: SurfaceMap, overwrite: bool = False) -> None:
    """Write a map as .npz. Raises OptionError where the file exists, OutputError where the disk refuses."""
    out = io.BytesIO()
    np.savez_compressed(
        out,
        format=np.array(FORMAT),
        a=np.array(found.a),
        b=np.array(found.b),
        a_face=found.to_b.face,
        a_weights=found.to_b.weights,
        b_face=found.to_a.face,
        b_weights=found.to_a.weights,
    )
    write_files({Path(path): out.getvalue()}, overwrite)


def load_map(path: str | os.PathLike[str]) -> SurfaceMap:
    """Read what ``save_map`` wrote. Raises InputError where the file holds something else."""
    try:
        with open(path, "rb") as file:
            if not zipfile.is_zipfile(file):
                raise ValueError("it is no .npz")
        with np.load(path, allow_pickle=False) as data:
            if str(data["format"]) != FORMAT:
                raise ValueError(f"its format is {data['format']}")
            to_b, to_a = (_places(data[f"{k}_face"], data[f"{k}_weights"]) for k in "ab")
            a, b = str(data["a"]), str(data["b"])
    except OSError as error:
        raise InputError(f"{path}: it can't be read ({error.strerror or error})") from None
    except (KeyError, ValueError, zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise InputError(
            f"{path}: no map between surfaces ({error}); circparam map makes one"
        ) from None
    return SurfaceMap(to_b, to_a, a, b)


def _places(face: np.ndarray, weights: np.ndarray) -> Places:
    """Places as a file has them. Raises ValueError where they can't be any."""
    if face.dtype.kind not in "iu" or weights.dtype.kind != "f" or face.ndim != 1:
        raise ValueError("its arrays are of another kind")
    if weights.shape != (len(face), 3):
        raise ValueError("its arrays are of different lengths")
    if face.min(initial=0) < 0 or not np.isfinite(weights).all():
        raise ValueError("its places are none")
    return Places(face.astype(np.int64), weights.astype(np.float64))
