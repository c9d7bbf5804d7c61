"""Out to disk: the mesh with its uv, read back and verified; seams and index map beside it."""

import io
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from circparam.core.arrays import IntArray, next_half_edge
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OptionError
from circparam.formats.document import Document
from circparam.formats.io import Written, read, write
from circparam.formats.sidecars import write_bytes, write_seams
from circparam.mesh.mesh import UVMap
from circparam.pipeline.configure import write_options
from circparam.pipeline.result import Result, as_stored, verify_layout
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
            UVMap(result.uv, result.uv_faces),
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
    # a pipe or a device cannot be read back
    read_back = not piped and os.path.isfile(result.path or "")
    return _verified_file(result, written, monitor) if read_back else result


def _verified_file(result: Result, written: Written, monitor: Monitor) -> Result:
    """The result as its file says."""
    o = result.options
    with monitor.stage("verify"):
        again = read(result.path or "", format=o.format)
        check_loadable(again)
        layout = again.uv(o.target_set or 0)
        uvmap = (
            None
            if layout is None
            else in_input_order(layout, written.face_map, len(result.mesh.faces))
        )
        if uvmap is None:
            raise NoResultError(f"{result.path}: the written file has no uv for its faces")
        # the file holds the verified numbers, so their verification stays valid
        same = same_corners(uvmap, UVMap(result.uv, result.uv_faces))
        verification = (
            result.verification
            if same
            else verify_layout(result.surface, uvmap, o, result.tiles, result.stacks, result.kept)
        )
    stored = as_stored(result, uvmap, verification, monitor.hurried)
    warnings = [*result.document.warnings, *stored.warnings, *written.warnings]
    return replace(stored, warnings=warnings)


def check_loadable(document: Document) -> None:
    """Raise NoResultError if common loaders refuse the file that was read."""
    if flaws := document.flaws():
        raise NoResultError(f"{document.source.name}: common loaders refuse the file: {flaws[0]}")


def same_corners(a: UVMap, b: UVMap) -> bool:
    """Whether all corners of all faces have the same uv, to the last bit, or both none."""
    if a.uv_faces.shape != b.uv_faces.shape or not (len(a.uv) and len(b.uv)):
        return False
    none = np.array_equal(a.uv_faces < 0, b.uv_faces < 0)
    return none and all(np.array_equal(a.uv[a.uv_faces, k], b.uv[b.uv_faces, k]) for k in (0, 1))


def in_input_order(uvmap: UVMap, face_map: IntArray, m: int) -> UVMap | None:
    """A layout as read back, its m faces in the order of the input; None if they do not fit."""
    if len(uvmap.uv_faces) != len(face_map):
        return None
    faces = np.full((m, 3), -1)
    faces[face_map] = uvmap.uv_faces
    return UVMap(uvmap.uv, faces)


def export_seams(result: Result, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write the seams as vertex pairs of the input, one a line. Raises OutputError."""
    write_seams(path, seam_pairs(result), overwrite)


def seam_pairs(result: Result) -> IntArray:
    """(s, 2) the two mesh vertices of every seam edge, each edge once, in ascending order."""
    surface, cut_mesh = result.surface, result.verification.cut_mesh
    glued = np.zeros(surface.faces.size, bool)
    glued[cut_mesh.edges.ravel()] = True
    h = surface.edges[~glued[surface.edges[:, 0]], 0]
    corners, _ = corners_of(surface, UVMap(result.uv, result.uv_faces))
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
    write_bytes(path, buffer.getvalue(), overwrite)
