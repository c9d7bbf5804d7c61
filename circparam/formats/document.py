"""What every format has in common: a file as read, and what writing it back gives.

A ``Document`` is a file in memory that can write itself again with another uv layout and everything else
kept. Each format has its own subclass; ``circparam.formats`` is the only door to them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import InputError, NoResultError, OptionError
from circparam.mesh.mesh import Mesh, UVMap


@dataclass(frozen=True)
class Source:
    """Where bytes came from: ``name`` for messages, ``path`` None for standard input or memory."""

    name: str
    path: Path | None = None

    @property
    def folder(self) -> Path | None:
        """The folder that relative names in the file start from; None where there is none."""
        return None if self.path is None else self.path.resolve().parent

    def error(self, cause: object) -> InputError:
        """An InputError that names the file, in one line."""
        return InputError(f"{self.name}: {' '.join(str(cause).split())}")


@dataclass(frozen=True)
class WriteOptions:
    """How uv goes into the file.

    uv_set: the set to write; None replaces the first one. overwrite_uv: allow ``uv_set`` to replace a set
    that is there. ply_uv: 'vertex' or 'face'; None takes 'face' only where a seam would split a vertex.
    copy_assets: copy the files that the output refers to (materials, textures, buffers) beside it.
    """

    uv_set: int | None = None
    overwrite_uv: bool = False
    ply_uv: str | None = None
    copy_assets: bool = False


@dataclass
class Encoded:
    """A document as bytes, before anything touches the disk.

    data: the file. format: its format. extra: further files by their name beside it. assets: relative names
    of files that it refers to. notes: what the user should know. vertex_map: (k,) int64, input vertex of
    every output vertex. face_map: (m,) int64, input face of every output face (triangles, in the order in
    which reading the output gives them).
    """

    data: bytes
    format: str
    vertex_map: IntArray
    face_map: IntArray
    extra: dict[str, bytes] = field(default_factory=dict)
    assets: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Document:
    """A file as read, able to write itself back with uv added and everything else kept.

    mesh: the triangles in world space (points bit-exact, polygons and groups as labels). uv_sets: numbers of
    the uv sets in the file. notes: what reading found worth telling. features: what the file carries beyond
    triangles, as short nouns, for the list of what another format cannot hold.
    group_names: name of each label in ``mesh.groups``.
    """

    source: Source
    format: str
    mesh: Mesh
    uv_sets: tuple[int, ...] = ()
    notes: list[str] = field(default_factory=list)
    features: tuple[str, ...] = ()
    group_names: tuple[str, ...] = ()

    @property
    def path(self) -> Path | None:
        """The file that was read; None for standard input and for arrays."""
        return self.source.path

    @property
    def instances(self) -> int:
        """How often a mesh of the file is shown again by a further node (0 where none is shared)."""
        return 0

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """The layout of one uv set of the file, origin bottom-left; None where the file has no such set."""
        return None

    def labels(self, kind: str) -> IntArray:
        """(m,) int64 label of each face by ``kind``: 'primitive' (or material), 'mesh' or 'scene'."""
        if kind not in ("primitive", "mesh", "scene"):
            raise OptionError(f"unknown grouping {kind!r}: choose one of primitive, mesh, scene")
        groups = self.mesh.groups
        if kind == "primitive" and groups is not None:
            return groups
        return np.zeros(len(self.mesh.faces), np.int64)

    def polygons(self) -> Polygons:
        """The polygons of the file with their triangles, for writing into another format."""
        m = len(self.mesh.faces)
        return Polygons(
            self.mesh.faces.ravel(),
            3 * np.arange(m + 1),
            np.arange(3 * m).reshape(-1, 3),
            np.arange(m),
        )

    def rewrite(
        self, uvmap: UVMap, options: WriteOptions, format: str, stem: str
    ) -> Encoded | None:
        """The file again with uv, in ``format``; None where this document can't write that format itself."""
        return None


def check_layout(document: Document, uvmap: UVMap) -> UVMap:
    """The layout with clean types; raises NoResultError where it does not fit the faces or is not finite."""
    uv = np.ascontiguousarray(uvmap.uv, np.float64).reshape(-1, 2)
    faces = np.ascontiguousarray(uvmap.uv_faces, np.int64)
    m = len(document.mesh.faces)
    if faces.shape != (m, 3):
        raise NoResultError(f"uv_faces have shape {faces.shape}: the mesh has {m} faces")
    if faces.max(initial=-1) >= len(uv):
        raise NoResultError(f"uv_faces name uv {int(faces.max())}: there are {len(uv)}")
    used = uv[faces[faces >= 0]]
    if not np.isfinite(used).all():
        raise NoResultError("the layout holds NaN or infinite uv: nothing was written")
    return UVMap(uv + 0.0, np.maximum(faces, -1))


def check_uv_set(document: Document, options: WriteOptions, *, only_first: bool) -> tuple[int, str]:
    """The uv set to write, and a note where one is replaced.

    Raises OptionError where the format has one set only, or the set exists and may not be replaced.
    """
    number = 0 if options.uv_set is None else options.uv_set
    if number < 0:
        raise OptionError(f"uv set {number}: sets are numbered from 0")
    if only_first and number:
        raise OptionError(
            f"uv set {number}: {document.format.upper()} holds one uv set; leave --uv-set out"
        )
    if number not in document.uv_sets:
        return number, ""
    if options.uv_set is not None and not options.overwrite_uv:
        raise OptionError(
            f"{document.source.name}: uv set {number} exists; replace it with --overwrite-uv"
        )
    return number, f"uv set {number} of the file was replaced"


@dataclass(frozen=True)
class Polygons:
    """Polygons of a file and the triangles made inside them.

    corners: (L,) int64 vertex of every polygon corner. start: (p + 1,) int64 offsets of the polygons.
    triangles: (m, 3) int64 into ``corners``. owner: (m,) int64 polygon of each triangle.
    """

    corners: IntArray
    start: IntArray
    triangles: IntArray
    owner: IntArray

    @property
    def labels(self) -> IntArray | None:
        """Polygon label of each triangle for ``Mesh.polygons``; None where all are triangles."""
        return None if (np.diff(self.start) <= 3).all() else self.owner

    def corner_uv(self, uvmap: UVMap, name: str) -> IntArray:
        """(L,) int64: the uv of every polygon corner, from the first triangle that lists it; −1 for none.

        Raises NoResultError where triangles of one polygon disagree: no seam may run inside a polygon.
        """
        out = np.full(len(self.corners), -1, np.int64)
        out[self.triangles.ravel()[::-1]] = uvmap.uv_faces.ravel()[::-1]
        given, kept = uvmap.uv_faces, out[self.triangles]
        differ = (given != kept).any(1)
        if differ.any():
            f = np.flatnonzero(differ)
            a, b = given[f], kept[f]
            same = (a < 0) == (b < 0)
            if len(uvmap.uv):
                same &= (values(uvmap.uv, a) == values(uvmap.uv, b)).all(2)
            wrong = f[~same.all(1)]
            if len(wrong):
                raise NoResultError(
                    f"{name}: polygon {int(self.owner[wrong[0]])} got two uv at one corner: "
                    "a seam may not run inside a polygon"
                )
        return out


def values(uv: FloatArray, index: IntArray) -> FloatArray:
    """Rows of uv; zeros where the index is −1."""
    out: FloatArray = np.where((index >= 0)[..., None], uv[np.maximum(index, 0)], 0.0)
    return out
