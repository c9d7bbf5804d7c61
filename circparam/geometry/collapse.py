"""Edges collapsed by quadric error (Garland and Heckbert 1997); large meshes have a process of their own.

fast-simplification keeps the memory of its largest mesh as long as its process lives, some 600 bytes a face.
That is a quarter of the memory of all later stages. The process is started as ``python -m
circparam.geometry.collapse``; nothing else uses that door.
"""

from __future__ import annotations

import contextlib
import struct
import subprocess
import sys
import threading
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.workers import environment

SingleArray: TypeAlias = npt.NDArray[np.float32]

APART_FACES = 150_000  # a process takes 0.2 s to start
SIZES = struct.Struct("<3q")  # points, faces, faces that are left


def collapsed(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[SingleArray, IntArray]:
    """Collapse edges until about ``target`` faces are left.

    points: (n, 3), about the origin and of the size of one. faces: (m, 3) int32, every point in one. Returns
    ((k, 3) coarse points as float32, (n,) the one that each point went into). The same in whichever process.
    """
    return Collapse(points, faces, target).result()


class Collapse:
    """As ``collapsed``: a process of its own may do it while the caller does something else."""

    def __init__(self, points: FloatArray, faces: npt.NDArray[np.int32], target: int) -> None:
        self._asked = points, faces, target
        self._process: subprocess.Popen[bytes] | None = None
        self._reader: threading.Thread | None = None
        self._answer = b""

    def begin(self) -> None:
        """Start the process, where the mesh is large enough and there can be one."""
        if len(self._asked[1]) <= APART_FACES or self._reader is not None:
            return
        command = [sys.executable, "-P", "-m", "circparam.geometry.collapse"]
        pipe = subprocess.PIPE
        with contextlib.suppress(OSError):
            process = subprocess.Popen(
                command, env=environment(), stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL
            )
            reader = threading.Thread(target=self._talk, args=(process,), daemon=True)
            try:
                reader.start()
            except RuntimeError:  # no thread to be had
                process.kill()
                process.communicate()
            else:
                self._process, self._reader = process, reader

    def result(self) -> tuple[SingleArray, IntArray]:
        """The result of the process; without one, or after a failure, the same result computed here."""
        self.begin()
        if self._reader is not None and self._process is not None:
            try:
                self._reader.join()
            except BaseException:
                self.stop()
                raise
            n = len(self._asked[0])
            into = np.frombuffer(self._answer[: 8 * n], np.int64)
            rest = self._answer[8 * n :]
            self._answer = b""
            if self._process.returncode == 0 and len(into) == n and len(rest) % 12 == 0:
                return np.frombuffer(rest, np.float32).reshape(-1, 3), into
        return _here(*self._asked)

    def stop(self) -> None:
        """End the process, if there is one: nobody wants its answer any more."""
        if self._process is not None and self._reader is not None:
            self._process.kill()
            self._reader.join()

    def _talk(self, process: subprocess.Popen[bytes]) -> None:
        """In a thread: hand the mesh over and take the answer; a process that cannot be talked to ends."""
        points, faces, target = self._asked
        try:
            message = b"".join(
                [
                    SIZES.pack(len(points), len(faces), target),
                    np.ascontiguousarray(points).tobytes(),
                    np.ascontiguousarray(faces).tobytes(),
                ]
            )
            self._answer = process.communicate(message)[0]
        except (OSError, ValueError, MemoryError):
            process.kill()
            process.wait()


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
    n, m, target = SIZES.unpack(read(SIZES.size))
    # the library wants arrays that it could write to
    points = np.frombuffer(bytearray(read(24 * n))).reshape(-1, 3)
    faces = np.frombuffer(bytearray(read(12 * m)), np.int32).reshape(-1, 3)
    moved, into = _here(points, faces, target)
    sys.stdout.buffer.write(into.tobytes() + moved.tobytes())


if __name__ == "__main__":
    main()
