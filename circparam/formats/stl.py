"""STL: read through trimesh, no place for uv."""

from __future__ import annotations

import io
import logging
from typing import Any

import numpy as np

from circparam.formats.memory import PlainDocument
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh


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
