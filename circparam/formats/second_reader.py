"""trimesh in a process of its own, with bounds on its time and memory: files that nobody has checked go in.

``python -m circparam.formats.second_reader KIND FOLDER SECONDS BYTES`` reads the file from standard input. The
output is arrays, or one line about an error, on standard output. The parsers behind trimesh may unpack a small
file to a huge one, and compiled parsers may crash. A process of their own protects the caller.
"""

import contextlib
import io
import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.memory import bound_process
from circparam.core.messages import message, send
from circparam.core.types import FloatArray, IntArray
from circparam.core.workers import environment
from circparam.formats.source import Source, bytes_beside

# Processor seconds and bytes of address space for any file, and more for each byte of the file: STEP takes most
# time, text most memory. The libraries alone take 370 MB.
PROCESSOR_SECONDS, SECONDS_PER_BYTE = 12.0, 30e-6
ADDRESS_BYTES, ADDRESS_BYTES_PER_BYTE = 750_000_000, 60
# seconds on the clock for each processor second: the machine may be busy
CLOCK_SECONDS_PER_SECOND = 5.0

Arrays = dict[str, Any]


def read_apart(data: bytes, source: Source, kind: str) -> tuple[Arrays, list[str]]:
    """As ``triangles_of``, by another process. Raises InputError with the cause."""
    seconds = PROCESSOR_SECONDS + SECONDS_PER_BYTE * len(data)
    bound = ADDRESS_BYTES + ADDRESS_BYTES_PER_BYTE * len(data)
    command = [sys.executable, "-P", "-m", "circparam.formats.second_reader", kind]
    command += [str(source.folder or ""), str(int(seconds)), str(bound)]
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    # the reader of STEP wants a file
    with tempfile.TemporaryDirectory(prefix="circparam-") as scratch:
        places = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), scratch)
        try:
            done = subprocess.run(
                command, env={**environment(), **one, **places}, input=data, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, timeout=CLOCK_SECONDS_PER_SECOND * seconds, check=False,
            )  # fmt: skip
            answer = io.BytesIO(done.stdout)
            said = json.loads(message(answer))
            packed = io.BytesIO(message(answer))
        except (subprocess.TimeoutExpired, EOFError):  # a bound, or a crash of a compiled parser
            raise source.error(
                f"trimesh can't read it as {kind.upper()} within {seconds:.0f} s and {bound / 1e9:.2g} GB: "
                "it is broken, or unfolds to far more than its size; export a .glb or .obj from the program "
                "that made it"
            ) from None
        except OSError as error:
            raise source.error(
                f"the process that reads {kind.upper()} cannot be started ({error.strerror})"
            ) from None
    if said["error"] is not None:
        raise source.error(f"trimesh can't read it as {kind.upper()}{said['error']}")
    with np.load(packed, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}, said["names"]


def triangles_of(data: bytes, kind: str, folder: Path | None) -> tuple[Arrays, list[str]]:
    """The scene of a file as trimesh reads it, its node transforms applied, in the order of the scene.

    Returns arrays and the name of each geometry. points: (n, 3); faces: (m, 3); group: (m,) geometry of each
    face; uv: (n, 2), where all geometries have one. No arrays where there are no triangles. Only regular files
    inside the folder are opened.
    """
    import trimesh

    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = trimesh.load_scene(
            io.BytesIO(data),
            file_type=kind,
            resolver=_resolver(folder),
            process=False,
            maintain_order=True,
        )
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
        return {}, []
    first = np.cumsum([0, *map(len, points)])
    arrays: Arrays = {
        "points": np.concatenate(points),
        "faces": np.concatenate([f + k for f, k in zip(faces, first, strict=False)]),
        "group": np.repeat(np.arange(len(faces)), [len(f) for f in faces]),
    }
    if all(t is not None for t in tables):
        arrays["uv"] = np.concatenate([t for t in tables if t is not None])
    return arrays, names


def _resolver(folder: Path | None) -> Any:
    """Resolver for trimesh: regular files inside the folder of the file, nothing else."""
    from trimesh.resolvers import Resolver

    class Beside(Resolver):
        def __init__(self) -> None:
            pass

        def get(self, key: Any) -> bytes:
            return bytes_beside(folder, key if isinstance(key, str) else os.fsdecode(key))

        def write(self, name: str, data: Any) -> None:
            raise OSError("nothing is written")

        def namespaced(self, namespace: str) -> Any:
            return self

        def keys(self) -> list[str]:
            return []

    return Beside()


def main() -> None:
    """In the process: a file on stdin; its arrays, or an error, on stdout."""
    kind, folder, seconds, size = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asks hears it too, and ends this process
    target = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the reader of STEP prints from compiled code
    with contextlib.suppress(ImportError, OSError, ValueError):
        for bound, most in (("CPU", seconds), ("AS", size), ("CORE", "0")):
            bound_process(bound, int(most))
    packed = io.BytesIO()
    names: list[str] = []
    error = None
    try:
        arrays, names = triangles_of(
            sys.stdin.buffer.read(), kind, Path(folder) if folder else None
        )
        np.savez(packed, allow_pickle=False, **arrays)
    except MemoryError:
        error = " (it asks for more memory than it may have)"
    except BaseException as problem:  # trimesh raises whatever its parsers meet
        # a file that is missing inside the parser, or no message
        mute = (isinstance(problem, OSError) and problem.errno) or not str(problem).strip()
        said = f" ({' '.join(str(problem).split())[:120]})"
        error = ": it is damaged, or holds no shape" if mute else said
    send(target, json.dumps({"error": error, "names": names}).encode())
    send(target, packed.getvalue())


if __name__ == "__main__":
    main()
