"""The two ways to charts, of hard surfaces and of grown ones, made beside each other."""

from __future__ import annotations

from collections.abc import Mapping

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED, DeferredTask, Worker
from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.mesh.surface import Surface
from circparam.seams.grown import grown_atlas
from circparam.seams.hard.charts import hard_atlas, with_seams
from circparam.seams.options import SeamOptions
from circparam.seams.reached import in_time

ORDER = ("hard", "doubtful", "grown")  # of what is said of them
LEFT = "left"
SPARE = ("doubtful",)  # ways that are left out where time is up
SENT = 50_000  # faces: of more, each way has work enough in parts for all processes


def made_ways(
    surface: Surface,
    ways: Mapping[str, BoolArray],
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
) -> dict[str, Atlas]:
    """The atlas of some faces for each way, by its name; all but one made by processes that are idle.

    ways: (m,) bool, the faces of each: "grown", or else hard; what is empty, or left out for want of time, is
    missing in the result. In place of "grown" may stand LEFT, of which that is what "doubtful" leaves
    (``left_by``): it is known and made next, beside what is hard. notes: get what is said of them.
    """
    parts = {n: surface.part(faces) for n, faces in ways.items() if faces.any() and n != LEFT}
    later: dict[str, DeferredTask] = {}

    def put_off(name: str) -> None:
        task = name, parts[name], bound, options
        later[name] = DeferredTask(monitor.jobs, one_way, task, monitor)

    for name in parts:
        put_off(name)
    order = sorted(parts, key=lambda name: len(parts[name].faces))
    here = "doubtful" if LEFT in ways else order[-1]
    for name in reversed(order):
        if name != here and len(parts[name].faces) <= SENT:
            later[name].begin()
    if LEFT in ways:
        way = later[here].result()
        other = None if way is None else Atlas(parts[here], *way[:-1])
        faces = left_by(other, ways[here], ways[LEFT])
        if faces.any():
            parts["grown"] = surface.part(faces)
            put_off("grown")
    found = {}
    for name in sorted(parts, key=lambda name: (later[name].begun, name == "hard")):
        way = later[name].result()
        if way is not None:
            found[name] = way
            monitor.keep(Atlas(parts[name], *way[:-1]))  # as processes do not
    for name in ORDER:
        notes += found[name][-1] if name in found else []
    return {name: Atlas(parts[name], *way[:-1]) for name, way in found.items()}


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
) -> tuple[BoolArray, FloatArray, SeamPrices | None, list[str]] | None:
    """(cut, corners, prices, notes) of an atlas; None where it can be done without and time is up."""
    if name in SPARE and monitor.expired:
        return None
    notes: list[str] = []

    def search() -> Atlas:
        if name == "grown":
            return grown_atlas(surface, bound, options, monitor, notes)
        worker = Worker(monitor.jobs if len(surface.faces) > PARTED else 1)
        return hard_atlas(surface, bound, options, worker, monitor, notes)

    atlas = in_time(surface, search, monitor)
    return atlas.cut, atlas.corners, atlas.prices, notes
