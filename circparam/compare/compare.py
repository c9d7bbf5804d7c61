"""Methods side by side: every one on the identical cut, each in a process of its own.

One cut is made; each method gets the same cut mesh, packs with the same settings, and is judged by the same
code that judges a written file. Rows that have seams of their own (the file's own uv, ``input``, and the
baselines of ``circparam.compare.xatlas``) are judged as they are.
"""

from __future__ import annotations

import dataclasses
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from circparam.compare import process, xatlas
from circparam.core.arrays import FloatArray
from circparam.core.monitor import Listener, Monitor
from circparam.core.registry import unknown_name
from circparam.errors import NoResultError, OptionError, OutOfTimeError
from circparam.formats.document import Document
from circparam.geometry.distortion import best_chart_scales
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import RepairOptions, RepairReport, repair
from circparam.mesh.restore import complete
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.pipeline.configure import check_names, method_options, open_source, seam_options
from circparam.pipeline.options import FREE, Options
from circparam.pipeline.place import Placed, chart_signs, place
from circparam.pipeline.verify import verify
from circparam.seams import SEAMS

INPUT = "input"
REPEATS, ENOUGH = 7, 0.5  # runs of a method, and seconds after which there is no further one
RASTER = (
    512  # texels a side: charts are packed for, and the packed share is read at, this resolution
)
CUTS = ("auto", *SEAMS.names())

# names of ``Verification.numbers`` in the order of a report
FIGURES = (
    "charts", "seam_length", "flips", "mirrored", "overlap", "missing", "distortion", "distortion_max_chart",
    "stretch_l2", "stretch_linf", "angle", "area", "pack",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Entry:
    """One row. status: ok, invalid (flips, overlaps, missing or mirrored faces) or failed, with ``error``.

    stages: seconds of each stage; seconds: of the whole method, from the cut mesh to uv (for a baseline, of
    all it does); medians over ``runs``. peak_bytes: see ``circparam.compare.process``. figures: by the names of
    FIGURES. iterations: the most that a chart took. notes: of the method.
    """

    method: str
    status: str
    stages: dict[str, float] = field(default_factory=dict)
    seconds: float | None = None
    peak_bytes: int | None = None
    figures: dict[str, float | int | None] = field(default_factory=dict)
    iterations: int | None = None
    runs: int = 1
    notes: list[str] = field(default_factory=list)
    error: str | None = None
    uvmap: UVMap | None = field(default=None, repr=False)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON and CSV."""
        whole = dataclasses.asdict(replace(self, uvmap=None))
        figures = whole.pop("figures")
        del whole["uvmap"]
        return {**whole, **{name: _plain(figures.get(name)) for name in FIGURES}}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every row of one mesh. cut: how it was cut, in cut_seconds, the same for all methods."""

    mesh: str
    vertices: int
    faces: int
    cut: str
    cut_seconds: float
    rows: list[Entry]
    notes: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        plain = {k: v for k, v in vars(self).items() if k != "rows"}
        return {**plain, "rows": [row.as_dict() for row in self.rows]}


def method_names(text: str | Sequence[str]) -> list[str]:
    """Names as a list: ``"circle,floater"``, ``"all"`` (every method of METHODS), or the names themselves.

    Raises OptionError for an unknown name (with the nearest ones), a name given twice, or a baseline that is
    not installed.
    """
    parts = text.split(",") if isinstance(text, str) else list(text)
    names: list[str] = []
    known = [*METHODS.names(), *xatlas.NAMES]
    for name in filter(None, (part.strip() for part in parts)):
        if name not in known and name != "all":
            raise OptionError(unknown_name("method", name, [*known, "all"]))
        names += METHODS.names() if name == "all" else [name]
    if not names:
        raise OptionError(f"--methods names no method: choose from {', '.join(known)}, all")
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    if twice:
        raise OptionError(f"--methods names {twice[0]} twice: name each method once")
    if any(name in xatlas.NAMES for name in names):
        xatlas.require()
    return names


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

    source: what ``circparam.unwrap`` takes. methods: see ``method_names``. cut: a row of SEAMS, or ``auto``:
    a mesh whose components are disks already (holes allowed) stays whole (the cut ``disk`` makes no seam
    there), any other is cut into charts.
    timeout: seconds for each method. isolate: False runs the methods in this process: quicker for small
    meshes, but no peak memory is known. keywords: other fields of ``Options``; those of convex maps (boundary,
    spacing, clamp) go to the convex methods. Row ``input`` is the uv that the file has, where it has one.

    Returns a Comparison; a method that fails is a row with status ``failed``. Raises OptionError for an
    unknown name, InputError where the source cannot be read, TopologyError where the cut does not suit it.
    """
    names = method_names(methods)
    if cut not in CUTS:
        raise OptionError(unknown_name("cut", cut, list(CUTS)))
    monitor = Monitor(listener)
    choices = _options(names, cut, keywords)
    document = open_source(source, next(iter(choices.values())))
    surface, repair_report = repair(document.mesh, RepairOptions(keywords.get("weld") or 0.0))
    if cut == "auto":
        cut = "disk" if _disks(surface) else "charts"
        useless = {"max_distortion", "max_charts", "min_chart_faces"} if cut == "disk" else set()
        keywords = {k: v for k, v in keywords.items() if k not in useless}
    choices = _options(names, cut, keywords)
    wanted = seam_options(document, surface, repair_report, next(iter(choices.values())))
    start = time.perf_counter()
    seams = SEAMS[cut].function(surface, wanted, monitor)
    cut_seconds = time.perf_counter() - start
    scene = _Scene(document, surface, repair_report, surface.cut_mesh(seams.cut), timeout, isolate)
    rows = [*_input_row(scene)]
    for k, name in enumerate(names):
        monitor.update(k / len(names), name)
        rows.append(_row(scene, name, choices[name], monitor))
    mesh = document.mesh
    notes = [*document.notes, *repair_report.messages, *seams.notes]
    return Comparison(
        document.source.name, len(mesh.points), len(mesh.faces), cut, cut_seconds, rows, notes
    )


@dataclass(frozen=True, eq=False)
class _Scene:
    """What all rows share."""

    document: Document
    surface: Surface
    repair_report: RepairReport
    cut_mesh: CutMesh
    timeout: float | None
    isolate: bool

    def run(self, task: str, arrays: dict[str, Any], settings: dict[str, Any]) -> process.Outcome:
        """A task, in a process of its own unless that is not wanted. It stops by itself at the timeout where
        it can; a process is ended some time after that."""
        if self.isolate:
            bound = None if self.timeout is None else 2 * self.timeout + 10
            return process.run(task, arrays, settings, bound)
        return process.here(task, arrays, settings)


def _options(names: list[str], cut: str, keywords: dict[str, Any]) -> dict[str, Options]:
    """Options of each method, those of convex maps for convex methods; OptionError where none takes one."""
    convex = ("boundary", "spacing", "clamp", "polygon")
    takers = [n for n in names if n not in FREE and n not in xatlas.NAMES]
    given = {k: v for k, v in keywords.items() if v is not None}
    if not takers and any(k in given for k in convex):
        Options(method=next(n for n in FREE), **given)  # says why there is no use for it
    out = {}
    for name in names:
        mine = {k: v for k, v in given.items() if k not in convex or name in takers}
        iterative = {"tolerance", "start", "blend"}
        if name != "isometric":
            mine = {k: v for k, v in mine.items() if k not in iterative}
        method = name if name in METHODS else "isometric"
        out[name] = Options(method=method, cut="charts" if cut == "auto" else cut, **mine)
        check_names(out[name])
    return out


def _disks(surface: Surface) -> bool:
    """Whether every component is a disk, holes allowed."""
    whole = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    loops = np.bincount(whole.loops.chart, minlength=whole.n_charts)
    return bool(((loops > 0) & (whole.euler() == 2 - loops)).all())


def _input_row(scene: _Scene) -> list[Entry]:
    """The row of the uv that the file has; none where it has none."""
    uvmap = scene.document.uv() if scene.document.uv_sets else None
    if uvmap is None or not (uvmap.uv_faces >= 0).any():
        return []
    status, figures = _judge(scene, uvmap)
    return [Entry(INPUT, status, figures=figures, uvmap=uvmap)]


def _row(scene: _Scene, name: str, options: Options, monitor: Monitor) -> Entry:
    """Run one method in its own process, and judge what it made."""
    try:
        if name in xatlas.NAMES:
            return _baseline_row(scene, name)
        return _method_row(scene, name, options, monitor)
    except (NoResultError, OutOfTimeError) as error:
        return Entry(name, "failed", error=str(error))


def _method_row(scene: _Scene, name: str, options: Options, monitor: Monitor) -> Entry:
    p = scene.cut_mesh
    arrays = {
        "faces": p.faces,
        "rest_triangles": p.rest_triangles,
        "chart": p.chart,
        "edges": p.edges,
    }
    chosen = method_options(options)
    values = {f.name: getattr(chosen, f.name) for f in dataclasses.fields(chosen)}
    polygon = values.pop("polygon")
    if polygon is not None:
        arrays["polygon"] = polygon
    plain = {k: v for k, v in values.items() if isinstance(v, (str, int, float)) or v is None}
    settings = {"method": name, "options": plain, "timeout": scene.timeout}
    done = scene.run("circparam.compare.compare:flatten_task", arrays, settings)
    if done.error is not None:
        return Entry(name, "failed", peak_bytes=done.peak_bytes, error=done.error)
    uv = done.arrays["uv"].copy()
    uv[:, 0] *= chart_signs(scene.surface, p, options)[p.vertex_chart]
    placed, resolution = _placed(p, uv, options, monitor)
    uvmap = complete(scene.document.mesh, scene.surface, scene.repair_report, placed.uv, p.faces)
    status, figures = _judge(scene, uvmap, resolution)
    return Entry(
        name, status, done.info["stages"], done.info["seconds"], done.peak_bytes, figures,
        done.info["iterations"], done.info["runs"], [*done.info["notes"], *placed.notes], uvmap=uvmap,
    )  # fmt: skip


def _placed(
    cut_mesh: CutMesh, uv: FloatArray, options: Options, monitor: Monitor
) -> tuple[Placed, int | None]:
    """uv packed on a coarse page, and the resolution to read it at; side by side and None where packing
    refuses: charts that overlap themselves may be more than it can take."""
    uv = uv * best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]
    coarse = replace(options, resolution=options.resolution or RASTER, padding=options.padding or 1)
    try:
        return place(cut_mesh, uv, coarse, monitor), RASTER
    except (NoResultError, OptionError) as error:
        loose = place(cut_mesh, uv, replace(options, normalize=False), monitor)
        return replace(loose, notes=[f"not packed: {error}", *loose.notes]), None


def _baseline_row(scene: _Scene, name: str) -> Entry:
    surface = scene.surface
    used, faces = np.unique(surface.faces, return_inverse=True)
    arrays = {"points": _moderate(surface.points[used]), "faces": faces.reshape(-1, 3)}
    done = scene.run("circparam.compare.xatlas:task", arrays, {"method": name})
    if done.error is not None:
        return Entry(name, "failed", peak_bytes=done.peak_bytes, error=done.error)
    uv_faces = np.full((len(scene.document.mesh.faces), 3), -1, np.int64)
    own = done.arrays["uv_faces"]
    uv_faces[surface.source] = np.where(surface.reversed_faces[:, None], own[:, [0, 2, 1]], own)
    uvmap = UVMap(done.arrays["uv"], uv_faces)
    status, figures = _judge(scene, uvmap)
    stages, seconds = done.info["stages"], sum(done.info["stages"].values())
    return Entry(name, status, stages, seconds, done.peak_bytes, figures, uvmap=uvmap)


def _moderate(points: FloatArray) -> FloatArray:
    """Points moved and scaled into the range of float32."""
    low, high = points.min(0), points.max(0)
    moved: FloatArray = (points - low) / max(float((high - low).max()), 1e-300)
    return moved


def _judge(
    scene: _Scene, uvmap: UVMap, resolution: int | None = RASTER
) -> tuple[str, dict[str, float | int | None]]:
    """Status and figures of a layout; without a resolution nothing is known of its packing."""
    found = verify(scene.surface, uvmap, resolution=resolution)
    return "ok" if found.valid else "invalid", found.numbers()


def flatten_task(
    arrays: dict[str, Any], settings: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """One method on cut mesh, as a task for ``circparam.compare.process``.

    Short work is done several times, and the medians are told: the first run also pays for cold caches.
    """
    options = MethodOptions(**settings["options"], polygon=arrays.get("polygon"))
    runs: list[tuple[float, dict[str, float]]] = []
    while len(runs) < REPEATS and sum(seconds for seconds, _ in runs) < ENOUGH:
        cut_mesh = CutMesh(
            arrays["faces"], arrays["rest_triangles"], arrays["chart"], arrays["edges"]
        )
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


def _plain(value: float | int | None) -> float | int | None:
    """A number that JSON holds."""
    return None if value is None or not np.isfinite(value) else value
