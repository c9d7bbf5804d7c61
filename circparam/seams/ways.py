"""The two ways to charts, of hard surfaces and of grown ones, made beside each other."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, Later, Worker
from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.mesh.surface import Surface
from circparam.seams.grown import grown_atlas
from circparam.seams.hard.charts import hard_atlas
from circparam.seams.hard.rival import Outdone, Rival
from circparam.seams.options import SeamOptions

ORDER = ("hard", "doubtful", "grown")  # of what is said of them
SPARE = ("doubtful",)  # ways that are left out where time is up
SENT = 50_000  # faces: of more, each way has work enough in parts for all processes


def made_ways(
    surface: Surface,
    ways: Mapping[str, BoolArray],
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
    rival: Callable[[Atlas], Rival] | None = None,
) -> dict[str, Atlas]:
    """The atlas of some faces for each way, by its name; all but the largest made by processes that are idle.

    ways: (m,) bool, the faces of each: "grown", or else hard; what is empty, or left out for want of time, is
    missing in the result. notes: get what is said of them. rival: made of "doubtful", what "grown" has to
    beat to be gone on with: else that is missing too.
    """
    parts = {name: surface.part(faces) for name, faces in ways.items() if faces.any()}
    later: dict[str, Later] = {}

    def check(merged: list[Atlas]) -> None:
        way = later["doubtful"].result()
        if way is not None and rival is not None:
            rival(Atlas(parts["doubtful"], *way[:-1])).face(merged)

    for name, part in parts.items():
        facing = check if name == "grown" and rival is not None else None
        later[name] = Later(monitor.jobs, one_way, (name, part, bound, options, facing), monitor)
    order = sorted(parts, key=lambda name: len(parts[name].faces))
    for name in reversed(order[:-1]):
        if len(parts[name].faces) <= SENT and (name != "grown" or rival is None):
            later[name].begin()
    found = {}
    for name in sorted(parts, key=lambda name: later[name].begun):
        with contextlib.suppress(Outdone):
            way = later[name].result()
            if way is not None:
                found[name] = way
    for name in ORDER:
        notes += found[name][-1] if name in found else []
    return {name: Atlas(parts[name], *way[:-1]) for name, way in found.items()}


def one_way(
    name: str,
    surface: Surface,
    bound: float,
    options: SeamOptions,
    check: Callable[[list[Atlas]], None] | None,
    monitor: Monitor,
) -> tuple[BoolArray, FloatArray, SeamPrices | None, list[str]] | None:
    """(cut, corners, prices, notes) of an atlas; None where it can be done without and time is up.

    check: as ``grown_atlas`` has it; what it raises comes out here.
    """
    if name in SPARE and monitor.expired:
        return None
    notes: list[str] = []
    if name == "grown":
        atlas = grown_atlas(surface, bound, options, monitor, notes, check=check)
    else:
        worker = Worker(monitor.jobs if len(surface.faces) > PARTED else 1)
        atlas = hard_atlas(surface, bound, options, worker, monitor, notes)
    return atlas.cut, atlas.corners, atlas.prices, notes
