"""Formats without a place for uv (STL, OFF), and meshes that come from memory. The only importer of trimesh."""

from __future__ import annotations

import io
import logging
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from circparam.arrays import IntArray
from circparam.errors import InputError
from circparam.formats.document import Document, Polygons, Source
from circparam.formats.polygons import list_start, triangulate
from circparam.formats.splice import gather, parse_floats, parse_ints, tokenize
from circparam.mesh import Mesh, UVMap

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class PlainDocument(Document):
    """Triangles or polygons, and perhaps a layout, without a file format that could be kept."""

    polys: Polygons | None = None
    layout: UVMap | None = field(default=None)

    def polygons(self) -> Polygons:
        """The polygons of the file, or its triangles."""
        return super().polygons() if self.polys is None else self.polys

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """The layout that came with the arrays."""
        return self.layout if uv_set == 0 else None


def read_stl(data: bytes, source: Source) -> PlainDocument:
    """Read STL through trimesh: three vertices for every face, none merged, in the order of the file."""
    import trimesh

    # what it cannot read it tells its log, tracebacks and all; here that is one line
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    try:
        loaded = trimesh.load(io.BytesIO(data), file_type="stl", process=False)
    except Exception as error:  # trimesh raises whatever its parser meets
        raise source.error(f"it can't be read as STL ({error or type(error).__name__})") from None
    meshes: list[Any] = (
        list(loaded.geometry.values()) if isinstance(loaded, trimesh.Scene) else [loaded]
    )
    meshes = [m for m in meshes if len(getattr(m, "faces", ()))]
    if not meshes:
        raise source.error("it has no faces: there is nothing to unwrap")
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    points = np.concatenate([np.asarray(m.vertices, np.float64) for m in meshes])
    faces = np.concatenate(
        [np.asarray(m.faces, np.int64) + k for m, k in zip(meshes, first, strict=False)]
    )
    groups = np.repeat(np.arange(len(meshes)), [len(m.faces) for m in meshes])
    return PlainDocument(
        source, "stl", Mesh(points, faces, groups=groups if len(meshes) > 1 else None)
    )


def read_off(data: bytes, source: Source) -> PlainDocument:
    """Read OFF (also COFF, NOFF ...), polygons kept. Raises InputError where counts and content disagree.

    Our own scanner: trimesh's reader turns polygons into triangles and forgets which belong together.
    """
    text = re.sub(rb"#[^\r\n]*", b"", data)
    found = re.match(rb"\s*((?:ST)?C?N?4?n?OFF)\b", text)
    if found is None or b"4" in found.group(1) or b"n" in found.group(1) or b"\0" in text:
        raise source.error("this is no text OFF file of three-dimensional points")
    t = tokenize(text[found.end() :])
    try:
        head = parse_ints(gather(t.clean, t.start[:2], t.end[:2]), 2)
    except ValueError:
        raise source.error("the counts of vertices and faces are malformed") from None
    line = t.line[:-1][np.diff(t.line) > 0]
    line = line[line > 1]  # the counts stand on one line, with or without a count of edges
    n, m = head.tolist()
    if n < 0 or m <= 0 or n + m > len(line):
        raise source.error(
            f"the header promises {n} vertices and {m} faces, the file has {len(line)} rows"
        )
    end = np.append(line, len(t.start))[1:]
    column = line[:n, None] + np.arange(3)
    if (end[:n] < line[:n] + 3).any():
        raise source.error("a vertex has fewer than three coordinates")
    try:
        points = parse_floats(
            gather(t.clean, t.start[column.ravel()], t.end[column.ravel()]), 3 * n
        )
        rows = line[n : n + m]
        size = parse_ints(gather(t.clean, t.start[rows], t.end[rows]), m)
        if (size < 0).any() or (rows + 1 + size > end[n : n + m]).any():
            raise ValueError("a face has fewer corners than it says")
        at = (
            np.repeat(rows + 1, size)
            + np.arange(int(size.sum()))
            - np.repeat(np.cumsum(size) - size, size)
        )
        corners = parse_ints(gather(t.clean, t.start[at], t.end[at]), len(at))
    except ValueError as error:
        raise source.error(f"a row is malformed ({error})") from None
    points = points.reshape(-1, 3)
    bad = (corners < 0) | (corners >= n)
    if bad.any():
        raise source.error(
            f"a face names vertex {int(corners[bad][0])}: there are {n} (counted from 0)"
        )
    polys = triangulate(points, corners, list_start(size))
    if len(polys.triangles) == 0:
        raise source.error("it has no faces: there is nothing to unwrap")
    mesh = Mesh(points, corners[polys.triangles], polygons=polys.labels)
    features: tuple[str, ...] = ("polygons",) if polys.labels is not None else ()
    if found.group(1) != b"OFF" or (end[n : n + m] > rows + 1 + size).any():
        features += ("colours or normals",)
    return PlainDocument(source, "off", mesh, features=features, polys=polys)


def from_arrays(
    points: npt.ArrayLike, faces: npt.ArrayLike, uv: npt.ArrayLike | None = None,
    uv_faces: npt.ArrayLike | None = None, *, polygons: IntArray | None = None,
    groups: IntArray | None = None, name: str = "the given arrays",
) -> Document:  # fmt: skip
    """A document from points (n, 3) and faces (m, 3).

    uv: (k, 2), with uv_faces (m, 3) into it, or one row for each vertex where uv_faces is left out.
    Raises InputError where shapes or indices do not fit.
    """
    mesh = Mesh(np.array(points, np.float64), np.array(faces, np.int64), polygons, groups)
    layout = None
    if uv is not None:
        table = np.array(uv, np.float64)
        index = mesh.faces.copy() if uv_faces is None else np.array(uv_faces, np.int64)
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
