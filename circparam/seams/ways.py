"""The two ways to charts, of hard surfaces and of grown ones, made beside each other."""

from __future__ import annotations

from collections.abc import Mapping

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.grown import grown_atlas
from circparam.seams.hard.charts import hard_atlas, with_seams
from circparam.seams.options import SeamOptions
from circparam.seams.reached import in_time

SPARE = ("doubtful",)  # ways that are left out where time is up


def made_ways(
    surface: Surface,
    ways: Mapping[str, BoolArray],
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
) -> dict[str, Atlas]:
    """The atlas of some faces for each way, by its name; by several processes.

    ways: (m,) bool, the faces of each: "grown", or else hard. Ways without faces, and those left out for want
    of time, are missing in the result. notes: get those of the ways.
    """
    parts = {name: surface.part(faces) for name, faces in ways.items() if faces.any()}
    # the caller makes the largest, whose parts other processes share as they become idle
    order = sorted(parts, key=lambda name: -len(parts[name].faces))
    tasks = [(name, parts[name], bound, options) for name in order]
    made = zip(order, Worker(monitor.jobs).map(one_way, tasks, monitor), strict=True)
    found = {name: way for name, way in made if way is not None}
    out = {}
    for name in (name for name in ways if name in found):
        cut, corners, own = found[name]
        out[name] = Atlas(parts[name], cut, corners)
        monitor.keep(out[name])  # processes keep none
        notes += own
    return out


def left_by(other: Atlas | None, doubtful: BoolArray, rest: BoolArray) -> BoolArray:
    """Of the faces ``rest`` those of components that need seams on the hard way, or never went it.

    other: the atlas of the doubtful faces on the hard way, None where there was no time for it. All (m,) bool.
    """
    out = rest.copy()
    if other is not None:
        out[doubtful] &= with_seams(other)
    return out


def one_way(
    name: str,
    surface: Surface,
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
) -> tuple[BoolArray, FloatArray, list[str]] | None:
    """(cut, corners, notes) of an atlas; None where it can be done without and time is up."""
    if name in SPARE and monitor.expired:
        return None
    notes: list[str] = []

    def search() -> Atlas:
        if name == "grown":
            return grown_atlas(surface, bound, options, monitor, notes)
        worker = Worker(monitor.jobs if len(surface.faces) > PARTED else 1)
        return hard_atlas(surface, bound, options, worker, monitor, notes)

    atlas = in_time(surface, search, monitor)
    return atlas.cut, atlas.corners, notes
