"""Edges collapsed by quadric error (Garland and Heckbert 1997); large meshes have a process of their own.

fast-simplification keeps the memory of its largest mesh as long as its process lives, some 600 bytes a face.
That is a quarter of the memory of all later stages. The process is started as ``python -m
circparam.geometry.collapse``; nothing else uses that door.
"""

import contextlib
import struct
import subprocess
import sys
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.types import FloatArray, IntArray
from circparam.core.workers import environment

SingleArray: TypeAlias = npt.NDArray[np.float32]

APART_FACES = 150_000  # a process takes 0.2 s to start
SIZES_HEADER = struct.Struct("<3q")  # points, faces, faces that are left


def collapsed(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[SingleArray, IntArray]:
    """Collapse edges until about ``target`` faces are left.

    points: (n, 3), about the origin and of the size of one. faces: (m, 3) int32, every point in one. Returns
    ((k, 3) coarse points as float32, (n,) the one that each point went into). The same in whichever process.
    """
    if len(faces) > APART_FACES:
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            return _apart(points, faces, target)
    return _here(points, faces, target)


def _apart(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[SingleArray, IntArray]:
    """As ``collapsed``, by a process. Raises SubprocessError or OSError without an answer."""
    message = SIZES_HEADER.pack(len(points), len(faces), target)
    message += np.ascontiguousarray(points).tobytes() + np.ascontiguousarray(faces).tobytes()
    command = [sys.executable, "-P", "-m", "circparam.geometry.collapse"]
    done = subprocess.run(
        command,
        env=environment(),
        input=message,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        check=True,
    )
    n = len(points)
    into = np.frombuffer(done.stdout[: 8 * n], np.int64)
    moved = np.frombuffer(done.stdout[8 * n :], np.float32)
    if len(into) < n or len(moved) % 3:
        raise subprocess.SubprocessError("an answer of another length")
    return moved.reshape(-1, 3), into


def _here(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[SingleArray, IntArray]:
    import fast_simplification

    _, _, collapses = fast_simplification.simplify(
        points, faces, target_count=target, return_collapses=True
    )
    moved, _, into = fast_simplification.replay_simplification(points, faces, collapses)
    return np.asarray(moved, np.float32), np.asarray(into, np.int64)


def main() -> None:
    """In the process: sizes, points and faces on stdin; then where each point went and the coarse points."""
    read = sys.stdin.buffer.read
    n, m, target = SIZES_HEADER.unpack(read(SIZES_HEADER.size))
    # the library wants arrays that it could write to
    points = np.frombuffer(bytearray(read(24 * n))).reshape(-1, 3)
    faces = np.frombuffer(bytearray(read(12 * m)), np.int32).reshape(-1, 3)
    moved, into = _here(points, faces, target)
    sys.stdout.buffer.write(into.tobytes() + moved.tobytes())


if __name__ == "__main__":
    main()
