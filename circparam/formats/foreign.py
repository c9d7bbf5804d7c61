"""What trimesh reads and no lossless reader here does: 3MF, COLLADA, XAML, STEP; when asked, all that it reads.

Triangles, uv and node transforms come through; materials, names and whatever else the file holds do not, and
the document says so. Nothing of these formats is written back: GLB by default.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import logging
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.gltf.document import features_of
from circparam.formats.gltf.reading import DECODE, DRACO
from circparam.formats.memory import PlainDocument
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

EXTRA = "pip install 'circparam[formats]'"
# what trimesh needs for a format: module → what it is called for pip
NEEDS = {
    "3mf": {"lxml": "lxml", "networkx": "networkx"},
    "dae": {"collada": "pycollada"},
    "zae": {"collada": "pycollada"},
    "xaml": {"lxml": "lxml"},
    "3dxml": {"lxml": "lxml", "networkx": "networkx"},
    "step": {"cascadio": "cascadio"},
}
LOST = ("materials", "names", "the tree of nodes")


@dataclass(frozen=True, eq=False)
class ForeignDocument(PlainDocument):
    """Triangles and uv that came through trimesh; ``features``: what did not."""


def read_as(kind: str) -> Callable[[bytes, Source], ForeignDocument]:
    """The function that reads one kind of file through trimesh, as a row of the table of formats wants it."""

    def read(data: bytes, source: Source) -> ForeignDocument:
        return read_through_trimesh(data, source, kind)

    read.__doc__ = f"Read {kind.upper()} through trimesh; see ``read_through_trimesh``."
    return read


def read_through_trimesh(data: bytes, source: Source, kind: str) -> ForeignDocument:
    """The scene of a file as trimesh reads it, its node transforms applied, in the order of the scene.

    kind: the format as trimesh calls it. Raises InputError where a package that trimesh needs is missing,
    where it cannot read the file, and where there are no triangles in it.
    """
    missing = [
        pip
        for module, pip in NEEDS.get(kind, {}).items()
        if importlib.util.find_spec(module) is None
    ]
    if missing:
        raise source.error(f"{kind.upper()} is read with {' and '.join(missing)}: {EXTRA}")
    lost = _lost_of_gltf(data, source) if kind in ("gltf", "glb") else LOST
    import trimesh

    # what it cannot read it tells its log, tracebacks and all; here that is one line
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    resolver = None
    if source.path is not None:
        resolver = trimesh.resolvers.FilePathResolver(str(source.path))
    try:
        with _silent(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(
                io.BytesIO(data),
                file_type=kind,
                resolver=resolver,
                process=False,
                maintain_order=True,
            )
        return _document(scene, source, kind, lost)
    except InputError:
        raise
    except Exception as error:  # trimesh raises whatever its parsers meet
        raise source.error(f"trimesh can't read it as {kind.upper()}{_said(error)}") from None


def _said(error: Exception) -> str:
    """What a parser says in brackets; none of it where it misses a file of its own, or says nothing."""
    if isinstance(error, OSError) or not str(error).strip():
        return ": it is damaged, or holds no shape"
    return f" ({' '.join(str(error).split())[:120]})"


def _lost_of_gltf(data: bytes, source: Source) -> tuple[str, ...]:
    """What trimesh loses of a glTF file. Raises InputError where it needs a package to decode it."""
    features = features_of(data, source)
    if DRACO.encode() in data and importlib.util.find_spec("DracoPy") is None:
        raise source.error(f"trimesh decodes Draco with DracoPy: pip install DracoPy; {DECODE}")
    kept = ("extensions", "nodes", "normals")  # said in other words, or made anew
    return tuple(dict.fromkeys([*LOST, *(f for f in features if f not in kept)]))


def _document(scene: Any, source: Source, kind: str, lost: tuple[str, ...]) -> ForeignDocument:
    """All triangles of a scene as one mesh, a group for each geometry."""
    points: list[FloatArray] = []
    faces: list[IntArray] = []
    tables: list[FloatArray | None] = []
    names: list[str] = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        if not len(getattr(part, "faces", ())):
            continue
        p = np.asarray(part.vertices, np.float64)
        if not np.array_equal(transform, np.eye(4)):
            p = p @ transform[:3, :3].T + transform[:3, 3]
        points.append(p)
        faces.append(np.asarray(part.faces, np.int64))
        uv = getattr(getattr(part, "visual", None), "uv", None)
        table = None if uv is None else np.asarray(uv, np.float64)
        tables.append(None if table is None or table.shape != (len(p), 2) else table)
        names.append(str(name))
    if not faces:
        raise source.error("trimesh finds no triangles in it: there is nothing to unwrap")
    first = np.cumsum([0, *map(len, points)])
    whole = np.concatenate([f + k for f, k in zip(faces, first, strict=False)])
    group = np.repeat(np.arange(len(faces)), [len(f) for f in faces])
    layout = None
    if all(t is not None for t in tables):
        layout = UVMap(np.concatenate([t for t in tables if t is not None]), whole)
    return ForeignDocument(
        source,
        kind,
        Mesh(np.concatenate(points), whole, groups=group if len(faces) > 1 else None),
        (0,) if layout is not None else (),
        group_names=tuple(names),
        warnings=(f"read through trimesh: {', '.join(lost)} are not kept",),
        layout=layout,
    )


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Nothing on the streams: the reader of STEP prints from compiled code."""
    try:
        sys.stdout.flush()
        sys.stderr.flush()
        kept = os.dup(1), os.dup(2)
    except (OSError, ValueError, AttributeError):  # closed or replaced streams
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        for number, old in zip((1, 2), kept, strict=True):
            os.dup2(old, number)
            os.close(old)
        os.close(nowhere)
