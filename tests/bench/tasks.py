"""What the benchmarks run in processes of their own: functions (arrays, settings) → (arrays, info)."""

import importlib
import time
from typing import Any

import numpy as np

from circparam.core.monitor import Monitor
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions

Arrays = dict[str, Any]
Answer = tuple[Arrays, dict[str, Any]]


# what an unwrap imports on its way
USED = (
    "circparam.seams.charts", "circparam.pipeline.fuller_page", "circparam.packing.nest.strategy",
    "scipy.fft", "scipy.spatial", "scipy.optimize",
)  # fmt: skip


def arrays_of(cut_mesh: CutMesh) -> Arrays:
    """A cut mesh as arrays, to hand over."""
    return {k: getattr(cut_mesh, k) for k in ("faces", "rest_triangles", "chart", "edges")}


def patches_of(arrays: Arrays) -> CutMesh:
    """A cut mesh as it was handed over, remembering nothing that was computed."""
    return CutMesh(arrays["faces"], arrays["rest_triangles"], arrays["chart"], arrays["edges"])


def flatten(arrays: Arrays, settings: dict[str, Any]) -> Answer:
    """One method, ``repeats`` times: seconds of every run, stages of the last, the layout of the last."""
    options = MethodOptions(**settings.get("options", {}))
    seconds, weights, solve = [], [], []
    for _ in range(settings.get("repeats", 1)):
        cut_mesh, monitor = patches_of(arrays), Monitor()
        start = time.perf_counter()
        layout = METHODS[settings["method"]].function(cut_mesh, options, monitor)
        seconds.append(time.perf_counter() - start)
        weights.append(monitor.seconds.get("weights", 0.0))
        solve.append(monitor.seconds.get("solve", 0.0))
    info = {
        "seconds": seconds, "weights": weights, "solve": solve, "stages": monitor.seconds,
        "iterations": layout.iterations.tolist(), "notes": layout.notes,
    }  # fmt: skip
    return {"uv": layout.uv}, info


def harmonic_by_igl(arrays: Arrays, settings: dict[str, Any]) -> Answer:
    """libigl's harmonic map alone (assembly and solve), the border being given."""
    import igl

    points, faces = arrays["points"], arrays["faces"]
    border = igl.boundary_loop(faces)
    border = border[0] if isinstance(border, tuple) else border
    circle = igl.map_vertices_to_circle(points, border)
    seconds = []
    for _ in range(settings["repeats"]):
        start = time.perf_counter()
        igl.harmonic(points, faces, border, circle, 1)
        seconds.append(time.perf_counter() - start)
    return {}, {"seconds": seconds}


def slim_by_igl(arrays: Arrays, settings: dict[str, Any]) -> Answer:
    """libigl's SLIM from a given start: seconds and energy (SD/4) after every iteration.

    Measuring the energy does not count; neither does the start.
    """
    import igl

    cut_mesh = patches_of(arrays)
    points = np.asfortranarray(arrays["points"])
    faces = np.asfortranarray(cut_mesh.faces.astype(np.int32))
    start = time.perf_counter()
    data = igl.slim_precompute(
        points, faces, np.asfortranarray(arrays["uv"]), igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        np.zeros(0, np.int32), np.asfortranarray(np.zeros((0, 2))), 0.0,
    )  # fmt: skip
    seconds, spent, energies = [], time.perf_counter() - start, []
    while len(energies) < settings["iterations"] and spent < settings["bound"]:
        start = time.perf_counter()
        uv = np.asarray(igl.slim_solve(data, 1))
        spent += time.perf_counter() - start
        seconds.append(spent)
        energies.append(energy(cut_mesh, uv[:, :2]))
        if energies[-1] <= settings["enough"]:
            break
    return {}, {"seconds": seconds, "energies": energies}


def energy(cut_mesh: CutMesh, uv: np.ndarray) -> float:
    """SD/4 of the layout of one chart as it is, without rescaling."""
    from circparam.solvers.objective import chart_energies

    return float(chart_energies(cut_mesh, uv)[0])


def unwrap(arrays: Arrays, settings: dict[str, Any]) -> Answer:
    """A whole unwrap from file to file, with the options that are not None: status, and seconds of stages."""
    for module in USED:  # what stages import at their first use is no part of their time
        importlib.import_module(module)
    from circparam.pipeline.unwrap import unwrap as run

    given = {k: v for k, v in settings.get("options", {}).items() if v is not None}
    result = run(settings["path"], settings["out"], overwrite=True, **given)
    return {}, {"status": result.status, "stages": result.seconds}


def profile(arrays: Arrays, settings: dict[str, Any]) -> Answer:
    """The same in one process under the profiler: [[function, share of the time]], highest first.

    What a function calls outside the package counts as its own.
    """
    import cProfile
    import os
    import pstats
    from pathlib import Path

    import circparam

    os.environ["OMP_NUM_THREADS"] = "1"  # one process does all the work
    profiler = cProfile.Profile()
    profiler.enable()
    unwrap(arrays, settings)
    profiler.disable()
    package = str(Path(circparam.__file__).parent)
    own: dict[str, float] = {}
    for (file, _, function), row in pstats.Stats(profiler).stats.items():
        seconds, callers = row[2], row[4]
        if file.startswith(package):
            name = f"{Path(file).stem}.{function}"
            own[name] = own.get(name, 0.0) + seconds
            continue
        for (caller, _, called_by), part in callers.items():
            if caller.startswith(package):
                # all below: calls from outside to outside are in this total
                name = f"{Path(caller).stem}.{called_by}"
                own[name] = own.get(name, 0.0) + part[3]
    total = sum(own.values())
    shares = sorted(((k, v / total) for k, v in own.items()), key=lambda kv: -kv[1])
    return {}, {"shares": shares[:40]}
