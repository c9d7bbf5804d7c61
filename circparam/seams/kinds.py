"""Atlases of hard and of organic components, made beside each other; of those in doubt both are made."""

from collections.abc import Mapping

from circparam.core.arrays import BoolArray, FloatArray
from circparam.core.monitor import Monitor
from circparam.core.workers import PARTED_FACES, Worker
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.grown import grown_atlas
from circparam.seams.hard.charts import hard_atlas, with_seams
from circparam.seams.options import SeamOptions
from circparam.seams.reached import in_time

SPARE = ("doubtful",)  # kinds that are left out where time is up


def atlases_of_kinds(
    surface: Surface,
    kinds: Mapping[str, BoolArray],
    bound: float,
    options: SeamOptions,
    monitor: Monitor,
    notes: list[str],
) -> dict[str, Atlas]:
    """The atlas of the faces of each kind, by its name; by several processes.

    kinds: (m,) bool, the faces of each: "organic", or else cut as hard. Kinds without faces, and those left out
    for want of time, are missing in the result. notes: the notes of all are added.
    """
    parts = {name: surface.part(faces) for name, faces in kinds.items() if faces.any()}
    # the caller makes the largest, whose parts other processes share as they become idle
    order = sorted(parts, key=lambda name: -len(parts[name].faces))
    tasks = [(name, parts[name], bound, options) for name in order]
    made = zip(order, Worker(monitor.jobs).map(atlas_of_kind, tasks, monitor), strict=True)
    found = {name: one for name, one in made if one is not None}
    out = {}
    for name in (name for name in kinds if name in found):
        cut, corners, own = found[name]
        out[name] = Atlas(parts[name], cut, corners)
        monitor.keep(out[name])  # processes keep none
        notes += own
    return out


def left_for_organic(other: Atlas | None, doubtful: BoolArray, rest: BoolArray) -> BoolArray:
    """Of the faces ``rest`` those of components that need seams as hard ones, or were never cut so.

    other: the atlas of the doubtful faces cut as hard, None without time for it. doubtful, rest: (m,) bool.
    """
    out = rest.copy()
    if other is not None:
        out[doubtful] &= with_seams(other)
    return out


def atlas_of_kind(
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
        if name == "organic":
            return grown_atlas(surface, bound, options, monitor, notes)
        worker = Worker(monitor.jobs if len(surface.faces) > PARTED_FACES else 1)
        return hard_atlas(surface, bound, options, worker, monitor, notes)

    atlas = in_time(surface, search, monitor)
    return atlas.cut, atlas.corners, notes
