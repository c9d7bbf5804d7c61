"""Edges collapsed by quadric error (Garland and Heckbert 1997); large meshes have a process of their own.

fast-simplification keeps the memory of its largest mesh as long as its process lives, some 600 bytes a face.
That is a quarter of the memory of all later stages.
"""

import contextlib
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.own_process import Arrays, run
from circparam.core.types import FloatArray, IntArray
from circparam.errors import NoResultError

SingleArray: TypeAlias = npt.NDArray[np.float32]

APART_FACES = 150_000  # a process takes 0.2 s to start


def collapsed(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[SingleArray, IntArray]:
    """Collapse edges until about ``target`` faces are left.

    points: (n, 3), about the origin and of the size of one. faces: (m, 3) int32, every point in one. Returns
    ((k, 3) coarse points as float32, (n,) the one that each point went into). The same in whichever process.
    """
    if len(faces) > APART_FACES:
        with contextlib.suppress(OSError, NoResultError):
            given: Arrays = {"points": points, "faces": faces}
            done = run("circparam.geometry.collapse:task", given, {"target": target})
            if done.error is None:
                return done.arrays["moved"], done.arrays["into"]
    return _here(points, faces, target)


def _here(
    points: FloatArray, faces: npt.NDArray[np.int32], target: int
) -> tuple[SingleArray, IntArray]:
    import fast_simplification

    _, _, collapses = fast_simplification.simplify(
        points, faces, target_count=target, return_collapses=True
    )
    moved, _, into = fast_simplification.replay_simplification(points, faces, collapses)
    return np.asarray(moved, np.float32), np.asarray(into, np.int64)


def task(arrays: Arrays, settings: dict[str, int]) -> tuple[Arrays, dict[str, int]]:
    """``collapsed`` as a task for ``circparam.core.own_process``."""
    moved, into = _here(arrays["points"], arrays["faces"], settings["target"])
    return {"moved": moved, "into": into}, {}
