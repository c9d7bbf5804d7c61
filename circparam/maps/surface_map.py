"""The map between two surfaces as data: places on faces, both ways, and the file that keeps them (.npz)."""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.files import write_files
from circparam.errors import InputError
from circparam.mesh.mesh import Mesh

FORMAT = "circparam-map-1"
OVERLAY = ("o_faces", "o_parents", "o_a_face", "o_a_weights", "o_b_face", "o_b_weights")
FIELDS = ("a_face", "a_weights", "b_face", "b_weights")


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
class Refinement:
    """The overlay of both meshes: what the map takes straight from one to the other.

    faces (m, 3): triangles of k vertices. parents (m, 2): the face of A and the face of B that each is a part
    of. on_a, on_b: (k) places of the vertices on both.
    """

    faces: IntArray
    parents: IntArray
    on_a: Places
    on_b: Places

    def turned(self) -> Refinement:
        """B first."""
        return Refinement(self.faces, self.parents[:, ::-1], self.on_b, self.on_a)


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """Where every vertex of A lies on B and every vertex of B on A; vertices and faces as the files have them.

    to_b: (n_A) places on B. to_a: (n_B) places on A. a, b: fingerprints of the meshes it was made for.
    overlay: the common refinement, None where none was asked for.
    """

    to_b: Places
    to_a: Places
    a: str
    b: str
    overlay: Refinement | None = None

    def check(self, a: Mesh, b: Mesh) -> None:
        """Raises InputError where the map was made for other meshes."""
        for mesh, mark, name in ((a, self.a, "first"), (b, self.b, "second")):
            if fingerprint(mesh) != mark:
                raise InputError(
                    f"the map was made for another {name} mesh: make it again with circparam map"
                )

    def turned(self) -> SurfaceMap:
        """The map from B to A."""
        overlay = None if self.overlay is None else self.overlay.turned()
        return SurfaceMap(self.to_a, self.to_b, self.b, self.a, overlay)


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
    more: dict[str, Any] = {}
    if found.overlay is not None:
        o = found.overlay
        rows = (o.faces, o.parents, o.on_a.face, o.on_a.weights, o.on_b.face, o.on_b.weights)
        more = dict(zip(OVERLAY, rows, strict=True))
    np.savez_compressed(
        out,
        format=np.array(FORMAT),
        a=np.array(found.a),
        b=np.array(found.b),
        a_face=found.to_b.face,
        a_weights=found.to_b.weights,
        b_face=found.to_a.face,
        b_weights=found.to_a.weights,
        **more,
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
            rows = {name: data[name] for name in FIELDS}
            a, b = str(data["a"]), str(data["b"])
            more = [data[name] for name in OVERLAY] if OVERLAY[0] in data else None
    except OSError as error:
        raise InputError(f"{path}: it can't be read ({error.strerror or error})") from None
    except (KeyError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise InputError(
            f"{path}: no map between surfaces ({error}); circparam map makes one"
        ) from None
    to_b = Places(rows["a_face"].astype(np.int64), rows["a_weights"].astype(np.float64))
    to_a = Places(rows["b_face"].astype(np.int64), rows["b_weights"].astype(np.float64))
    overlay = None
    if more is not None:
        faces, parents, a_face, a_weights, b_face, b_weights = more
        overlay = Refinement(faces, parents, Places(a_face, a_weights), Places(b_face, b_weights))
    return SurfaceMap(to_b, to_a, a, b, overlay)
