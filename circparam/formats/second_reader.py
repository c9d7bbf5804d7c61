"""trimesh in a process of its own, with bounds on its time and memory: files that nobody has checked go in.

The parsers behind trimesh may unpack a small file to a huge one, and compiled parsers may crash. A process of
their own protects the caller.
"""

import io
import logging
import os
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.own_process import Arrays, run
from circparam.core.pool import ONE_THREAD
from circparam.core.types import FloatArray, IntArray
from circparam.errors import NoResultError, OutOfTimeError
from circparam.formats.source import Source, bytes_beside

# Processor seconds and bytes of address space for any file, and more for each byte of the file: STEP takes most
# time, text most memory. The libraries alone take 370 MB.
PROCESSOR_SECONDS, SECONDS_PER_BYTE = 12.0, 30e-6
ADDRESS_BYTES, ADDRESS_BYTES_PER_BYTE = 750_000_000, 60
# seconds on the clock for each processor second: the machine may be busy
CLOCK_SECONDS_PER_SECOND = 5.0


def read_apart(data: bytes, source: Source, kind: str) -> tuple[Arrays, list[str]]:
    """As ``triangles_of``, by another process. Raises InputError with the cause."""
    seconds = PROCESSOR_SECONDS + SECONDS_PER_BYTE * len(data)
    size = ADDRESS_BYTES + ADDRESS_BYTES_PER_BYTE * len(data)
    bounds = {"CPU": int(seconds), "AS": size, "CORE": 0}
    task = {"data": data, "kind": kind, "folder": source.folder}
    # the reader of STEP wants a file
    with tempfile.TemporaryDirectory(prefix="circparam-") as scratch:
        variables = {**ONE_THREAD, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), scratch)}
        try:
            done = run(
                "circparam.formats.second_reader:read_task", {}, task,
                CLOCK_SECONDS_PER_SECOND * seconds, bounds=bounds, variables=variables,
            )  # fmt: skip
        except (OutOfTimeError, NoResultError):  # a bound, or a crash of a compiled parser
            raise source.error(
                f"trimesh can't read it as {kind.upper()} within {seconds:.0f} s and {size / 1e9:.2g} GB: "
                "it is broken, or unfolds to far more than its size; export a .glb or .obj from the program "
                "that made it"
            ) from None
        except OSError as error:
            raise source.error(
                f"the process that reads {kind.upper()} cannot be started ({error.strerror})"
            ) from None
    if (wrong := done.info.get("error", f" ({done.error})")) is not None:
        raise source.error(f"trimesh can't read it as {kind.upper()}{wrong}")
    return done.arrays, done.info["names"]


def read_task(arrays: Arrays, settings: dict[str, Any]) -> tuple[Arrays, dict[str, Any]]:
    """``triangles_of`` as a task for ``circparam.core.own_process``: arrays, names, an error or None."""
    try:
        found, names = triangles_of(settings["data"], settings["kind"], settings["folder"])
    except MemoryError:
        return {}, {"error": " (it asks for more memory than it may have)"}
    except BaseException as problem:  # trimesh raises whatever its parsers meet
        # a file that is missing inside the parser, or no message
        mute = (isinstance(problem, OSError) and problem.errno) or not str(problem).strip()
        said = f" ({' '.join(str(problem).split())[:120]})"
        return {}, {"error": ": it is damaged, or holds no shape" if mute else said}
    return found, {"names": names, "error": None}


def triangles_of(data: bytes, kind: str, folder: Path | None) -> tuple[Arrays, list[str]]:
    """The scene of a file as trimesh reads it, its node transforms applied, in the order of the scene.

    Returns arrays and the name of each geometry. points: (n, 3); faces: (m, 3); group: (m,) geometry of each
    face; uv: (n, 2), NaN for geometries without, left out if none has any. No arrays where there are no
    triangles. Only regular files inside the folder are opened.
    """
    import trimesh

    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = trimesh.load_scene(
            io.BytesIO(data),
            file_type=kind,
            resolver=Beside(folder),
            process=False,
            maintain_order=True,
        )
    points: list[FloatArray] = []
    faces: list[IntArray] = []
    tables: list[FloatArray] = []
    names: list[str] = []
    any_uv = False
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        if not len(getattr(part, "faces", ())):
            continue
        p = np.asarray(part.vertices, np.float64)
        f = np.asarray(part.faces, np.int64)
        if not np.array_equal(transform, np.eye(4)):
            p = p @ transform[:3, :3].T + transform[:3, 3]
        points.append(p)
        # a mirroring node turns faces over: they are wound as they are seen
        faces.append(f[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else f)
        uv = getattr(getattr(part, "visual", None), "uv", None)
        fits = uv is not None and np.shape(uv) == (len(p), 2)
        tables.append(np.asarray(uv, np.float64) if fits else np.full((len(p), 2), np.nan))
        any_uv |= fits
        names.append(str(name))
    if not faces:
        return {}, []
    first = np.cumsum([0, *map(len, points)])
    arrays: Arrays = {
        "points": np.concatenate(points),
        "faces": np.concatenate([f + k for f, k in zip(faces, first, strict=False)]),
        "group": np.repeat(np.arange(len(faces)), [len(f) for f in faces]),
    }
    if any_uv:
        arrays["uv"] = np.concatenate(tables)
    return arrays, names


class Beside(Mapping[Any, bytes]):
    """Where trimesh looks for further files: regular ones inside a folder. OSError for any others."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder

    def __getitem__(self, key: Any) -> bytes:
        return bytes_beside(self.folder, key if isinstance(key, str) else os.fsdecode(key))

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0
