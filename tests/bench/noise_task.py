"""Unwrap one mesh several times, each time moved so that nothing should change; one JSON line a turn.

    python noise_task.py MESH KIND SETTINGS TURN...

A script of its own, because it runs against any build of the package that PYTHONPATH names. KIND: see
``moved``. SETTINGS: JSON, {"constants": {"package.module.NAME": value}, "options": {"name": value}}; null in
place of a function is one that does nothing.
"""

from __future__ import annotations

import json
import pkgutil
import resource
import sys
import zlib
from typing import Any

import numpy as np

FIGURES = (
    "charts", "seam_length", "seam_visible", "distortion", "pack", "flips", "overlap", "share_over_2"
)  # fmt: skip
JITTER_EDGES = 1e-6  # of the mean edge: far below what a scanner or float32 gives


def moved(
    points: np.ndarray, faces: np.ndarray, kind: str, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """The same surface: turned in space, in another order, or each point a millionth of an edge away.

    points (n, 3), faces (m, 3); kind: rotation, shuffle or jitter. Points at one position stay together.
    """
    rng = np.random.default_rng(seed)
    if kind == "rotation":
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn[:, 0] *= np.linalg.det(turn)
        return points @ turn.T, faces
    if kind == "shuffle":
        order, new = rng.permutation(len(faces)), rng.permutation(len(points))
        place = np.argsort(new)
        return points[new], place[faces[order]]
    edge = float(np.linalg.norm(points[faces[:, 0]] - points[faces[:, 1]], axis=1).mean())
    places, place = np.unique(points, axis=0, return_inverse=True)
    away = JITTER_EDGES * edge * rng.standard_normal(places.shape)
    return points + away[place.reshape(-1)], faces


def seconds() -> float:
    """Processor seconds of this process and its children."""
    used = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def turn(
    points: np.ndarray, faces: np.ndarray, kind: str, number: int, options: dict[str, Any]
) -> dict[str, Any]:
    """The figures of one unwrap."""
    from circparam import unwrap

    seed = zlib.crc32(f"{len(points)} {len(faces)} {number}".encode())
    source = moved(points, faces, kind, seed)
    start = seconds()
    result = unwrap(source, jobs=1, **options)
    spent = seconds() - start
    row = {k: v for k, v in result.measures.items() if k in FIGURES}
    return {"turn": number, **row, "seconds": spent, "status": result.status}


def owner_of(name: str) -> tuple[Any, str]:
    """(module or class, attribute) of a dotted name."""
    path, _, attribute = name.rpartition(".")
    try:
        owner = pkgutil.resolve_name(path)
        getattr(owner, attribute)
    except (ValueError, ImportError, AttributeError):
        raise SystemExit(f"there is no {name}") from None
    return owner, attribute


def main() -> None:
    """Set the constants, then unwrap once a turn."""
    path, kind, text, *turns = sys.argv[1:]
    settings = json.loads(text)
    for name, value in settings["constants"].items():
        owner, attribute = owner_of(name)
        off = value is None and callable(getattr(owner, attribute))
        setattr(owner, attribute, (lambda *_, **__: None) if off else value)
    data = np.load(path)
    for number in map(int, turns):
        row = turn(data["points"], data["faces"], kind, number, settings["options"])
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
