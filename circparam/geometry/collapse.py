"""Edges collapsed by quadric error (Garland and Heckbert 1997); large meshes have a process of their own.

fast-simplification keeps what it has needed for the largest mesh so far as long as its process lives, some 600
bytes a face, which is a quarter of what all that follows takes. The process is started as
``python -m circparam.geometry.collapse``; nothing else uses that door.
"""

from __future__ import annotations

import contextlib
import struct
import subprocess
import sys

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.workers import environment

APART_FACES = 150_000  # a process takes 0.2 s to start
SIZES = struct.Struct("<3q")  # points, faces, faces that are left


def collapsed(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[FloatArray, IntArray]:
    """Collapse edges until about ``target`` faces are left.

    points: (n, 3), about the origin and of the size of one. faces: (m, 3) int32, every point in one. Returns
    ((k, 3) coarse points, (n,) the one that each point went into). The same in whichever process.
    """
    if len(faces) > APART_FACES:
        answer = _apart(points, faces, target)
        if answer is not None:
            return answer
    return _here(points, faces, target)


def _here(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[FloatArray, IntArray]:
    import fast_simplification

    _, _, collapses = fast_simplification.simplify(
        points, faces, target_count=target, return_collapses=True
    )
    moved, _, into = fast_simplification.replay_simplification(points, faces, collapses)
    return np.asarray(moved, np.float64), np.asarray(into, np.int64)


def _apart(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[FloatArray, IntArray] | None:
    """As ``_here``, by a process of its own; None where there is none, or it has failed."""
    message = b"".join(
        [
            SIZES.pack(len(points), len(faces), target),
            np.ascontiguousarray(points).tobytes(),
            np.ascontiguousarray(faces).tobytes(),
        ]
    )
    command = [sys.executable, "-P", "-m", "circparam.geometry.collapse"]
    with contextlib.suppress(OSError):
        done = subprocess.run(
            command,
            input=message,
            env=environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        into = np.frombuffer(done.stdout[: 8 * len(points)], np.int64)
        rest = done.stdout[8 * len(points) :]
        if done.returncode == 0 and len(into) == len(points) and len(rest) % 24 == 0:
            return np.frombuffer(rest).reshape(-1, 3), into
    return None


def main() -> None:
    """In the process: sizes, points and faces on stdin; then where each point went and the coarse points."""
    read = sys.stdin.buffer.read
    n, m, target = SIZES.unpack(read(SIZES.size))
    # the library wants arrays that it could write to
    points = np.frombuffer(bytearray(read(24 * n))).reshape(-1, 3)
    faces = np.frombuffer(bytearray(read(12 * m)), np.int32).reshape(-1, 3)
    moved, into = _here(points, faces, target)
    sys.stdout.buffer.write(into.tobytes() + moved.tobytes())


if __name__ == "__main__":
    main()
