"""A run that is stopped goes on after its seams, which are most of the work: they are kept in a folder.

The name of the file is a hash of all that the seams depend on: the version, the mesh with its uv, the options.
A folder may therefore serve many meshes. Files of another mesh, version or option are not read. The file goes
when its run has ended well.
"""

import hashlib
import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from circparam._version import __version__
from circparam.core.fields import specs
from circparam.core.files import write_files
from circparam.core.monitor import Monitor
from circparam.errors import OutputError
from circparam.pipeline.job import Job
from circparam.pipeline.options import Options
from circparam.seams.options import Seams

# options that change no seam, or the checkpoint itself
_NO_MATTER = ("jobs", "timeout", "overwrite", "format", "checkpoint")


def seams_of(job: Job, monitor: Monitor, find: Callable[[Job, Monitor], Seams]) -> Seams:
    """The seams of an earlier run, else new ones, which are kept.

    Seams that were found in a hurry are not kept: they depend on the clock. Raises OutputError if the folder
    cannot be written to.
    """
    path = checkpoint_path(job)
    if path is None:
        return find(job, monitor)
    kept, damaged = _read(path, job)
    if kept is not None:
        return kept
    seams = find(job, monitor)
    if not monitor.hurried:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"{path.parent}: cannot keep checkpoints here ({error.strerror or error})"
            ) from None
        layout: dict[str, Any] = {} if seams.uv is None else {"uv": seams.uv}
        packed = io.BytesIO()
        np.savez(packed, cut=seams.cut, notes=np.array(seams.notes, dtype=np.str_), **layout)
        write_files({path: packed.getvalue()}, overwrite=True)
    note = f"{path}: the checkpoint is damaged; the seams were computed again"
    return replace(seams, notes=[*seams.notes, note]) if damaged else seams


def forget(job: Job) -> None:
    """Delete the kept files after the run has ended well."""
    path = checkpoint_path(job)
    if path is not None:
        path.unlink(missing_ok=True)


def checkpoint_path(job: Job) -> Path | None:
    """Where the seams of this mesh with these options are kept; None without --checkpoint."""
    if job.options.checkpoint is None:
        return None
    # the name is a hash of all that the seams depend on
    document, mesh = job.document, job.document.mesh
    parts: list[object] = [f"circparam {__version__} {job.format}"]
    for name in specs(Options):
        if name not in _NO_MATTER:
            parts += [name, getattr(job.options, name)]
    parts += [mesh.points, mesh.faces, mesh.polygons, mesh.groups, job.surface.density]
    if isinstance(job.options.seam_weights, str):  # painted in the file
        parts.append(document.colours())
    for number in document.uv_sets:
        uvmap = document.uv(number)
        parts += [] if uvmap is None else [uvmap.uv, uvmap.uv_faces]
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype} {part.shape}".encode())
            digest.update(part.tobytes())
        else:
            digest.update(repr(part).encode())
    return Path(job.options.checkpoint) / f"{digest.hexdigest()[:32]}.circparam.npz"


def _read(path: Path, job: Job) -> tuple[Seams | None, bool]:
    """(the seams of a file, None if there are none; whether there was a file that made no sense)."""
    try:
        with np.load(path, allow_pickle=False) as file:
            cut, notes = file["cut"], [str(note) for note in file["notes"]]
            uv = file["uv"] if "uv" in file.files else None
    except FileNotFoundError:
        return None, False
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None, True
    surface = job.surface
    fits = cut.shape == (len(surface.edges),) and cut.dtype == bool
    if not fits or (uv is not None and uv.shape != (len(surface.faces), 3, 2)):
        return None, True
    return Seams(cut, uv, notes), False
