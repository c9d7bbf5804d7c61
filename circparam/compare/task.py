"""One method as a task for ``circparam.core.own_process``."""

import statistics
import time
from typing import Any

from circparam.core.monitor import Monitor
from circparam.core.own_process import Arrays
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods import METHODS

FLATTEN = "circparam.compare.task:flatten_task"
# runs of a method, and seconds after which there is no further one
MOST_RUNS, ENOUGH_SECONDS = 7, 0.5


def flatten_task(arrays: Arrays, settings: dict[str, Any]) -> tuple[Arrays, dict[str, Any]]:
    """One method on a cut mesh.

    arrays: those that make a CutMesh, by name. settings: method, options (MethodOptions) and timeout. Short
    work is done several times, and the medians count: the first run also pays for cold caches.
    """
    runs: list[tuple[float, dict[str, float]]] = []
    while len(runs) < MOST_RUNS and sum(seconds for seconds, _ in runs) < ENOUGH_SECONDS:
        cut_mesh = CutMesh(
            arrays["faces"], arrays["rest_triangles"], arrays["chart"], arrays["edges"]
        )
        monitor = Monitor(timeout=settings["timeout"])
        start = time.perf_counter()
        layout = METHODS[settings["method"]].function(cut_mesh, settings["options"], monitor)
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
