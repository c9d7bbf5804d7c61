"""The two ways to charts, of hard surfaces and of grown ones, made beside each other."""

from __future__ import annotations

from collections.abc import Mapping

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, Worker
from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.mesh.surface import Surface
from circparam.seams.grown import grown_atlas
from circparam.seams.hard.charts import hard_atlas
from circparam.seams.options import SeamOptions

ORDER = ("hard", "doubtful", "grown")  # of what is said of them
SPARE = ("doubtful",)  # ways that are left out where time is up


def made_ways(
    surface: Surface,
    ways: Mapping[str, BoolArray],
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
) -> dict[str, Atlas]:
    """The atlas of some faces for each way, by its name, on as many processes as there are jobs.

    ways: (m,) bool, the faces of each: "grown", or else hard; what is empty, or left out for want of time, is
    missing in the result. The first is made in this process. notes: get what is said of them.
    """
    ways = {name: faces for name, faces in ways.items() if faces.any()}
    parts = [surface.part(faces) for faces in ways.values()]
    tasks = [(name, part, bound, options) for name, part in zip(ways, parts, strict=True)]
    done = Worker(monitor.jobs).map(one_way, tasks, monitor)
    found = {k: (p, way) for k, p, way in zip(ways, parts, done, strict=True) if way is not None}
    for name in ORDER:
        notes += found[name][1][-1] if name in found else []
    return {name: Atlas(part, *way[:-1]) for name, (part, way) in found.items()}


def one_way(
    name: str, surface: Surface, bound: float, options: SeamOptions, monitor: Monitor
) -> tuple[BoolArray, FloatArray, SeamPrices | None, list[str]] | None:
    """(cut, corners, prices, notes) of an atlas; None where it can be done without and time is up."""
    if name in SPARE and monitor.expired:
        return None
    notes: list[str] = []
    if name == "grown":
        atlas = grown_atlas(surface, bound, options, monitor, notes)
    else:
        worker = Worker(monitor.jobs if len(surface.faces) > PARTED else 1)
        atlas = hard_atlas(surface, bound, options, worker, monitor, notes)
    return atlas.cut, atlas.corners, atlas.prices, notes
