"""One method in a process of its own: input and output are plain arrays and values."""

import dataclasses
import statistics
import time
from typing import Any

from circparam.compare.process import Arrays
from circparam.core.monitor import Monitor
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions

FLATTEN = "circparam.compare.task:flatten_task"
REPEATS, ENOUGH = 7, 0.5  # runs of a method, and seconds after which there is no further one
_CUT_MESH = ("faces", "rest_triangles", "chart", "edges")  # the arrays that make a cut mesh


def flatten_input(
    method: str, cut_mesh: CutMesh, options: MethodOptions, timeout: float | None
) -> tuple[Arrays, dict[str, Any]]:
    """Arrays and settings of ``flatten_task``: everything of the options that has no default."""
    arrays = {name: getattr(cut_mesh, name) for name in _CUT_MESH}
    values = {f.name: getattr(options, f.name) for f in dataclasses.fields(options)}
    if values["polygon"] is not None:
        arrays["polygon"] = values["polygon"]
    plain = {k: v for k, v in values.items() if isinstance(v, (str, int, float))}
    return arrays, {"method": method, "options": plain, "timeout": timeout}


def flatten_task(
    arrays: dict[str, Any], settings: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """One method on a cut mesh, as a task for ``circparam.compare.process``.

    Short work is done several times, and the medians count: the first run also pays for cold caches.
    """
    options = MethodOptions(**settings["options"], polygon=arrays.get("polygon"))
    runs: list[tuple[float, dict[str, float]]] = []
    while len(runs) < REPEATS and sum(seconds for seconds, _ in runs) < ENOUGH:
        cut_mesh = CutMesh(*(arrays[name] for name in _CUT_MESH))
        monitor = Monitor(timeout=settings["timeout"])
        start = time.perf_counter()
        layout = METHODS[settings["method"]].function(cut_mesh, options, monitor)
        runs.append((time.perf_counter() - start, monitor.seconds))
    info = {
        "stages": {
            k: statistics.median(stages.get(k, 0.0) for _, stages in runs) for k in runs[0][1]
        },
        "seconds": statistics.median(seconds for seconds, _ in runs),
        "runs": len(runs),
        "iterations": int(layout.iterations.max(initial=0)),
        "notes": layout.notes,
    }
    return {"uv": layout.uv}, info
