"""Methods side by side: every one on the identical cut, each in a process of its own.

One cut is made. Each method gets the same cut mesh and packs with the same settings, and the verifier of
written files measures all. Rows that have seams of their own (the file's own uv, ``input``, and the BASELINES
of ``circparam.compare.baselines``) are judged as they are.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from circparam.compare.baselines import BASELINES, require
from circparam.compare.rows import INPUT_ROW, Comparison, Entry
from circparam.compare.task import FLATTEN
from circparam.core import own_process
from circparam.core.monitor import Listener, Monitor
from circparam.core.records import dataclass
from circparam.core.registry import unknown_name
from circparam.core.types import FloatArray
from circparam.errors import NoResultError, OptionError, OutOfTimeError
from circparam.geometry.distortion import at_best_scales
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.mesh.mesh import UVMap
from circparam.methods import METHODS
from circparam.pipeline.configure import method_options, open_source
from circparam.pipeline.flatten import find_seams
from circparam.pipeline.job import Job, prepare
from circparam.pipeline.jobs import start_for
from circparam.pipeline.options import DEFAULT_METHOD, Options, from_keywords
from circparam.pipeline.place import Placed, chart_signs, place
from circparam.pipeline.verify import verify
from circparam.seams import SEAMS

# texels a side: charts are packed for, and the packed share is read at, this resolution
RASTER_TEXELS = 512
COMPARED_CUTS = ("auto", *SEAMS.names())


def compare(
    source: Any,
    methods: str | Sequence[str],
    *,
    cut: str = "auto",
    listener: Listener | None = None,
    timeout: float | None = None,
    isolate: bool = True,
    **keywords: Any,
) -> Comparison:
    """Run methods on the identical cut of one mesh.

    source: as for ``circparam.unwrap``. methods: see ``method_names``. cut: a row of SEAMS, or ``auto``. A mesh
    of disks (holes allowed) then stays whole, because the cut ``disk`` makes no seam there. Any other mesh is
    cut into charts. timeout: seconds for each method. isolate: False runs the methods in this process: quicker
    for small meshes, but no peak memory is known. keywords: other fields of ``Options``; those of methods go to
    the methods that accept them. Row ``input`` is the uv that the file has, where it has one.

    Returns a Comparison; a method that fails is a row with status ``failed``. Raises OptionError for an
    unknown name, InputError if the source cannot be read, TopologyError if the cut does not suit it.
    """
    names = method_names(methods)
    if cut not in COMPARED_CUTS:
        raise OptionError(unknown_name("cut", cut, list(COMPARED_CUTS)))
    Options(timeout=timeout)  # raises where it is no time
    choices = _options(names, cut, keywords)
    first = next(iter(choices.values()))
    monitor = Monitor(listener, jobs=first.processes)
    job = prepare(open_source(source, first), None, first, monitor)
    if cut == "auto":
        whole = job.surface.cut_mesh(np.zeros(len(job.surface.edges), bool))
        cut = "charts" if not_disks(whole).any() else "disk"
        useless = {"max_distortion", "max_charts", "min_chart_faces"} if cut == "disk" else set()
        keywords = {k: v for k, v in keywords.items() if k not in useless}
    choices = _options(names, cut, keywords)
    job = replace(job, options=next(iter(choices.values())))
    start = time.perf_counter()
    start_for(job.options, len(job.surface.faces))
    seams = find_seams(job, monitor)
    cut_seconds = time.perf_counter() - start
    scene = _Scene(job, job.surface.cut_mesh(seams.cut), timeout, isolate)
    rows = []
    own = job.document.uv() if job.document.uv_sets else None
    if own is not None and (own.uv_faces >= 0).any():
        status, figures = _figures(scene, own)
        rows.append(Entry(INPUT_ROW, status, figures=figures, uvmap=own))
    for k, name in enumerate(names):
        monitor.update(k / len(names), name)
        try:
            row = _baseline_row if name in BASELINES else _method_row
            rows.append(row(scene, name, choices[name], monitor))
        except (NoResultError, OutOfTimeError) as error:
            rows.append(Entry(name, "failed", error=str(error)))
    notes = [*job.document.notes, *job.repair_report.messages, *seams.notes]
    source = job.document.source.name
    return Comparison(source, cut, cut_seconds, rows, job.document.mesh, notes)


def method_names(text: str | Sequence[str]) -> list[str]:
    """Names as a list: ``"circle,floater"``, ``"all"`` (every method of METHODS), or the names themselves.

    Raises OptionError for an unknown name (with the nearest ones), a name given twice, or a baseline that is
    not installed.
    """
    parts = text.split(",") if isinstance(text, str) else list(text)
    names: list[str] = []
    known = [*METHODS.names(), *BASELINES]
    for name in filter(None, (part.strip() for part in parts)):
        if name not in known and name != "all":
            raise OptionError(unknown_name("method", name, [*known, "all"]))
        names += METHODS.names() if name == "all" else [name]
    if not names:
        raise OptionError(f"--methods names no method: choose from {', '.join(known)}, all")
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    if twice:
        raise OptionError(f"--methods names {twice[0]} twice: name each method once")
    for name in names:
        if name in BASELINES:
            require(name)
    return names


@dataclass(frozen=True, eq=False)
class _Scene:
    """Data that all rows share."""

    job: Job
    cut_mesh: CutMesh
    timeout: float | None
    isolate: bool

    def run(
        self, task: str, arrays: dict[str, Any], settings: dict[str, Any]
    ) -> own_process.Outcome:
        """A task, in a process of its own where rows are isolated. It stops by itself at the timeout where
        it can; a process is ended some time after that."""
        if self.isolate:
            bound = None if self.timeout is None else 2 * self.timeout + 10
            return own_process.run(task, arrays, settings, bound)
        return own_process.here(task, arrays, settings)


def _options(names: list[str], cut: str, keywords: dict[str, Any]) -> dict[str, Options]:
    """Options of each method: those of methods go to the rows that accept them; OptionError if none does."""
    given = {k: v for k, v in keywords.items() if v is not None}
    if "pins" in given:
        raise OptionError("--pin has no effect here: methods are compared freely; leave it out")
    rows = [METHODS[name] for name in names if name in METHODS]
    for_methods = [k for k in given if any(k in row.accepts for row in METHODS)]
    for name in for_methods:
        if not any(name in row.accepts for row in rows):
            refuses = next(row for row in (*rows, *METHODS) if name not in row.accepts)
            Options(method=refuses.name, **{name: given[name]})  # says why it has no effect
    out = {}
    for name in names:
        method = name if name in METHODS else DEFAULT_METHOD
        accepted = METHODS[name].accepts if name in METHODS else ()
        mine = {k: v for k, v in given.items() if k not in for_methods or k in accepted}
        mine |= {"method": method, "cut": "charts" if cut == "auto" else cut}
        out[name] = from_keywords(mine)
    return out


def _method_row(scene: _Scene, name: str, options: Options, monitor: Monitor) -> Entry:
    """Run one method in its own process, and verify its layout."""
    p = scene.cut_mesh
    arrays = {k: getattr(p, k) for k in ("faces", "rest_triangles", "chart", "edges")}
    settings = {"method": name, "options": method_options(options), "timeout": scene.timeout}
    done = scene.run(FLATTEN, arrays, settings)
    if done.error is not None:
        return Entry(name, "failed", peak_bytes=done.peak_bytes, error=done.error)
    uv = done.arrays["uv"].copy()
    uv[:, 0] *= chart_signs(scene.job.surface, p, options)[p.vertex_chart]
    placed, resolution = _placed(p, uv, options, monitor)
    uvmap = scene.job.completed(p, placed.uv)
    status, figures = _figures(scene, uvmap, resolution)
    return Entry(
        name, status, done.info["stages"], done.info["seconds"], done.peak_bytes, figures,
        done.info["iterations"], done.info["runs"], [*done.info["notes"], *placed.notes], uvmap=uvmap,
    )  # fmt: skip


def _placed(
    cut_mesh: CutMesh, uv: FloatArray, options: Options, monitor: Monitor
) -> tuple[Placed, int | None]:
    """uv packed on a coarse page, and the resolution to read it at. Side by side and None if packing refuses,
    as for charts that overlap themselves."""
    uv = at_best_scales(cut_mesh, uv)
    padding = options.padding_texels if options.padding else 1
    coarse = replace(options, resolution=options.resolution or RASTER_TEXELS, padding=padding)
    try:
        return place(cut_mesh, uv, coarse, monitor), RASTER_TEXELS
    except (NoResultError, OptionError) as error:
        loose = place(cut_mesh, uv, replace(options, normalize=False), monitor)
        return replace(loose, notes=[f"not packed: {error}", *loose.notes]), None


def _baseline_row(scene: _Scene, name: str, *_: Any) -> Entry:
    """Run one baseline in its own process, and judge its atlas as it is."""
    surface = scene.job.surface
    used, faces = np.unique(surface.faces, return_inverse=True)
    points = surface.points[used] - surface.points[used].min(0)
    points /= max(float(points.max()), 1e-300)  # into the range of float32
    arrays = {"points": points, "faces": faces.reshape(-1, 3)}
    done = scene.run("circparam.compare.baselines:task", arrays, {"method": name})
    if done.error is not None:
        return Entry(name, "failed", peak_bytes=done.peak_bytes, error=done.error)
    uv_faces = np.full((len(scene.job.document.mesh.faces), 3), -1, np.int64)
    uv_faces[surface.source] = surface.to_file(done.arrays["uv_faces"])
    uvmap = UVMap(done.arrays["uv"], uv_faces)
    status, figures = _figures(scene, uvmap)
    stages, seconds = done.info["stages"], sum(done.info["stages"].values())
    return Entry(name, status, stages, seconds, done.peak_bytes, figures, uvmap=uvmap)


def _figures(
    scene: _Scene, uvmap: UVMap, resolution: int | None = RASTER_TEXELS
) -> tuple[str, dict[str, float | int | None]]:
    """Status and figures of a layout; without a resolution nothing is known of its packing."""
    found = verify(scene.job.surface, uvmap, resolution=resolution)
    return "ok" if found.valid else "invalid", found.numbers()
