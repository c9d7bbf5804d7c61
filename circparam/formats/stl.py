"""STL: no place for uv. Binary files are one array, text is read through trimesh."""

from __future__ import annotations

import io
import logging
import re
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import doubles
from circparam.formats.memory import PlainDocument
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh

HEADER = 84  # bytes before the first facet: a title, and the number of facets
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes, source: Source) -> PlainDocument:
    """Read STL: three vertices for every face, none merged, in the order of the file.

    Raises InputError where the file has no faces, or cannot be read as STL.
    """
    facets = _binary(data)
    if facets is None:
        return _through_trimesh(data, source)
    if len(facets) == 0:
        raise source.error("it has no faces: there is nothing to unwrap")
    points = doubles(facets["corners"].reshape(-1, 3))
    return PlainDocument(source, "stl", Mesh(points, np.arange(len(points)).reshape(-1, 3)))


def _binary(data: bytes) -> npt.NDArray[np.void] | None:
    """(m,) facets of a binary file that is as long as it says; None for text, and for what is cut short."""
    if len(data) < HEADER:
        return None
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    if len(data) != HEADER + count * FACET.itemsize:
        return None
    return np.frombuffer(data, FACET, count, HEADER)


def _why_empty(data: bytes) -> str:
    """What is wrong with a file in which no facet was found."""
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        begun, ended = (
            len(re.findall(word, data, re.I)) for word in (rb"\bfacet\s+normal", rb"\bendfacet\b")
        )
        if begun != ended:
            return f"{begun} facets begin and {ended} end: it is cut short"
    elif len(data) >= HEADER:
        count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
        there = (len(data) - HEADER) // FACET.itemsize
        return (
            f"its header promises {count} facets, its length is that of {there}: it is cut short, or whatever "
            "wrote it did not fill in the number; export it again"
        )
    return "it has no faces: there is nothing to unwrap"


def _through_trimesh(data: bytes, source: Source) -> PlainDocument:
    """Text, one solid or several, which takes 0.3 s to import what reads it; and whatever else it takes."""
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
        raise source.error(_why_empty(data))
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    points = np.concatenate([np.asarray(m.vertices, np.float64) for m in meshes])
    faces = np.concatenate(
        [np.asarray(m.faces, np.int64) + k for m, k in zip(meshes, first, strict=False)]
    )
    groups = np.repeat(np.arange(len(meshes)), [len(m.faces) for m in meshes])
    return PlainDocument(
        source, "stl", Mesh(points, faces, groups=groups if len(meshes) > 1 else None)
    )
