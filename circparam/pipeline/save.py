"""Out to disk: the mesh with its uv, read back and verified; seams and index map beside it."""

import io
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from circparam.core.arrays import IntArray, mask_of, next_half_edge
from circparam.core.files import write_files
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OptionError
from circparam.formats.io import Written, read, write
from circparam.formats.sidecars import write_seams
from circparam.mesh.mesh import UVMap
from circparam.pipeline.configure import write_options
from circparam.pipeline.options import Options
from circparam.pipeline.result import Result, as_stored
from circparam.pipeline.verify import corners_of


def save(result: Result, output: str | os.PathLike[str], monitor: Monitor | None = None) -> Result:
    """Write a result, read the file back and verify that.

    Returns the result with the numbers of the file. Raises OutputError if the disk refuses, OptionError if the
    file exists, NoResultError if the file cannot be read back.
    """
    monitor = monitor or Monitor()
    o = result.options
    piped, groups = os.fspath(output) == "-", result.groups
    pages = groups.names if groups is not None and groups.pages else ()
    with monitor.stage("write"):
        written = write(
            output,
            result.document,
            result.layout,
            format=result.format if piped else o.format,
            options=replace(write_options(o, result.uv_double, result.group_by), pages=pages),
            overwrite=o.overwrite,
        )
    result = replace(
        result,
        path="-" if written.path is None else os.fspath(written.path),
        files=[os.fspath(f) for f in written.files],
        notes=[*result.notes, *written.notes],
        warnings=[*result.warnings, *written.warnings],
        vertex_map=written.vertex_map,
        face_map=written.face_map,
    )
    if piped or not os.path.isfile(result.path or ""):  # a pipe or a device cannot be read back
        return result
    with monitor.stage("verify"):
        uvmap = read_back(written, len(result.mesh.faces), o, o.format)
        stored = as_stored(result, uvmap, monitor.hurried)
    warnings = [*result.document.warnings, *stored.warnings, *written.warnings]
    return replace(stored, warnings=warnings)


def read_back(written: Written, m: int, options: Options, format: str | None = None) -> UVMap:
    """The layout of a file as it holds it, its m faces in the order of the input.

    Raises NoResultError if common loaders refuse the file, or faces have no uv.
    """
    again = read(str(written.path), format=format)
    if flaws := again.flaws():
        raise NoResultError(f"{again.source.name}: common loaders refuse the file: {flaws[0]}")
    uvmap = again.uv(options.target_set or 0)
    if uvmap is None or len(uvmap.uv_faces) != len(written.face_map):
        raise NoResultError(f"{written.path}: the written file has no uv for its faces")
    faces = np.full((m, 3), -1)
    faces[written.face_map] = uvmap.uv_faces
    return UVMap(uvmap.uv, faces)


def export_seams(result: Result, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write the seams as vertex pairs of the input, one a line. Raises OutputError."""
    write_seams(path, seam_pairs(result), overwrite)


def seam_pairs(result: Result) -> IntArray:
    """(s, 2) the two mesh vertices of every seam edge, each edge once, in ascending order."""
    surface, cut_mesh = result.surface, result.verification.cut_mesh
    glued = mask_of(surface.faces.size, cut_mesh.edges.ravel())
    h = surface.edges[~glued[surface.edges[:, 0]], 0]
    corners, _ = corners_of(surface, result.layout)
    h = np.concatenate([h, surface.torn_seams(corners)])
    vertex = surface.from_file(result.mesh.faces).ravel()
    a, b = vertex[h], vertex[next_half_edge(h)]
    pairs = np.stack([np.minimum(a, b), np.maximum(a, b)], 1)
    return np.unique(pairs, axis=0)


def write_map(result: Result, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write the index map as npz. Raises OutputError.

    vertex: input vertex of every output vertex. face: input face of every output face. chart: of every
    output face, −1 if it was set aside.
    """
    if Path(path).suffix.lower() != ".npz":
        raise OptionError(f"--map {path}: the index map needs a name that ends in .npz")
    vertex, face = result.vertex_map, result.face_map
    if vertex is None or face is None:
        raise OptionError("--map needs a written file: give an output")
    buffer = io.BytesIO()
    np.savez_compressed(buffer, vertex=vertex, face=face, chart=result.charts[face])
    write_files({Path(path): buffer.getvalue()}, overwrite)
