"""One atlas for all levels of detail: the layout of the first mesh on coarser or finer ones of its shape."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import interpolated
from circparam.core.fields import Range
from circparam.core.monitor import Listener, Monitor
from circparam.core.plural import counted, percent
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import NoResultError, OptionError
from circparam.formats.document import Document, y_up, z_up
from circparam.formats.table import axis_up
from circparam.geometry.closest import samples_of
from circparam.geometry.distortion import Tail
from circparam.geometry.overlap import overlaps
from circparam.maps.carried_charts import (
    CHART_SAMPLE_BOUNDS,
    CarriedLayout,
    SourceCharts,
    carry_charts,
)
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.surface import Surface
from circparam.pipeline.configure import open_source, open_sources
from circparam.pipeline.fallback import Cascade
from circparam.pipeline.job import Job, given_atlas, prepare
from circparam.pipeline.options import from_keywords
from circparam.pipeline.result import Result
from circparam.pipeline.stored_fit import Fitted
from circparam.pipeline.unwrap import verify_and_save
from circparam.pipeline.verify import flipped_faces

SHAPE_DIAGONALS = 0.05  # between both surfaces: decimation to a tenth of the faces moves less
SHAPE_SAMPLES = 5_000  # places of each mesh that are sought on the other
LOOSE_AREA_SHARE = 0.01  # of the surface: more faces without texture would show
DRIFT_TEXELS = Range(0.0, 1e6, "a distance in texels, at least 0; 8 is the default")
SIDE_TEXELS = Range(16, 65536, "a page of 16 to 65536 texels a side")

_DRIFTS = ("drift", "drift_mean", "inside_p95", "inside_max", "apart", "anew", "anew_share")


@dataclass(frozen=True, eq=False)
class Transferred:
    """A layout that one mesh took over from another. All drifts are texels.

    result: the verified result, as of ``unwrap``. drift: largest distance of a corner from the closest point of
    its chart; drift_mean: the mean. inside_p95, inside_max: the same at the middle of faces, where a flat face
    cuts through a curved surface. apart: largest distance of both surfaces, in diagonals. place: (3,) of the
    vertex with the largest drift. least: lower bound on the drift of any layout without flips, because the
    target folds over. anew: number of faces in free room, anew_share: their share of the surface.
    """

    result: Result
    drift: float
    drift_mean: float
    inside_p95: float
    inside_max: float
    apart: float
    place: FloatArray
    least: float
    anew: int
    anew_share: float

    def as_dict(self) -> dict[str, Any]:
        """The figures for JSON."""
        v = self.result.verification
        return {
            "output": self.result.path,
            "status": self.result.status,
            "faces": len(self.result.mesh.faces),
            "charts": v.charts,
            "flips": v.flips,
            **{name: getattr(v, name) for name in ("overlap", "missing", "seam_length")},
            "mirrored": len(v.mirrored),
            **{name: getattr(self, name) for name in _DRIFTS},
            "drift_least": self.least,
            "drift_place": self.place.tolist(),
            "warnings": self.result.warnings,
            "notes": self.result.notes,
        }


def transfer(
    source: Any,
    targets: Sequence[Any],
    outputs: Sequence[str | os.PathLike[str] | None] | None = None,
    *,
    resolution: int = 2048,
    max_drift: float = 8.0,
    listener: Listener | None = None,
    **keywords: Any,
) -> list[Transferred]:
    """The layout of a mesh on coarser or finer meshes of the same shape; nothing flips or overlaps.

    source, targets: as for ``unwrap``; the source has uv. outputs: a file for each target, None keeps its
    layout in memory. resolution: side of the page in texels, the unit of all drifts. max_drift: upper bound on
    the drift, in texels. keywords: fields of ``Options`` for files, such as reader, overwrite and uv_set (read
    and written). All layouts are made before the first file is written.

    Returns one ``Transferred`` per target. Raises InputError if the source has no uv. Raises NoResultError if a
    target has another shape, drifts further than max_drift, or has too many overlapping faces.
    """
    DRIFT_TEXELS.check("--max-drift", max_drift)
    SIDE_TEXELS.check("--resolution", resolution)
    # nothing is cut, flattened or packed here
    if keywords.get("uv_set") is not None:
        keywords = {**keywords, "overwrite_uv": True}
    options = from_keywords({**keywords, "cut": "none", "normalize": False})
    monitor = Monitor(listener, None, 1)
    with monitor.stage("read"):
        document = open_source(source, options)
        uvmap = document.require_uv(options.uv_set or 0)
        charts = _source_charts(document, document.mesh, uvmap)
        documents = open_sources(targets, "targets", options)
    outputs = [None] * len(documents) if outputs is None else list(outputs)
    if (n := len(outputs)) != len(documents):
        raise OptionError(f"{len(documents)} targets have {n} outputs: give one for each")
    jobs = [prepare(d, o, options, monitor) for d, o in zip(documents, outputs, strict=True)]
    carried = []
    with monitor.stage("transfer"):
        for job in jobs:
            placed, apart, notes = _placed(charts, document, uvmap, job)
            try:
                layout = carry_charts(placed, job.surface)
                carried.append((layout, apart, _fitted(job, layout, resolution, max_drift), notes))
            except NoResultError:
                _refuse_overlaps(charts, document)  # the target has those of the first mesh
                raise
    out = []
    for job, output, (layout, apart, fitted, notes) in zip(jobs, outputs, carried, strict=True):
        result = verify_and_save(job, fitted, output, monitor, "transfer")
        result.notes.extend(notes)
        out.append(_transferred(result, layout, apart, resolution))
    return out


def _source_charts(document: Document, mesh: Mesh, uvmap: UVMap) -> SourceCharts:
    """The charts of the first mesh, whose points may be turned."""
    surface, _ = repair(mesh, RepairOptions(0.0, True, by_position=True), uvmap)
    return SourceCharts(given_atlas(surface, uvmap, document.source.name))


def _placed(
    charts: SourceCharts, document: Document, uvmap: UVMap, job: Job
) -> tuple[SourceCharts, float, list[str]]:
    """The charts of the first mesh as a target lies, and a note where they were turned.

    Returns (charts, largest distance of both surfaces in diagonals of the first, notes). A glTF made of a file
    with z up has y up, and its other levels may still be files with z up. Raises NoResultError if the distance
    is large, or if the fronts of the target face the other way.
    """
    target, name, notes = job.surface, job.document.source.name, list[str]()
    far, place = _distance(charts, target)
    upright = [axis_up(d) == "y" for d in (document, job.document)]
    if far > SHAPE_DIAGONALS and upright[0] != upright[1]:
        turn = z_up if upright[0] else y_up
        mesh = replace(document.mesh, points=turn(document.mesh.points))
        turned = _source_charts(document, mesh, uvmap)
        nearer, there = _distance(turned, target)
        if nearer <= SHAPE_DIAGONALS:
            charts, far, place = turned, nearer, there
            axes = "y up to z up" if upright[0] else "z up to y up"
            notes = [f"{document.source.name} was turned from {axes}, as {name} lies"]
    if far > SHAPE_DIAGONALS:
        raise NoResultError(
            f"{name}: at ({_point(place)}) it lies {100 * far:.0f} % of the size away from the "
            f"first mesh: give one of the same shape, place and size (within {100 * SHAPE_DIAGONALS:.0f} %)"
        )
    face, places = map(_thinned, _samples(target))
    near = charts.sample[charts.free.query(places)[1]]
    if (target.normals[face] * charts.atlas.surface.normals[near]).sum(1).mean() < -0.5:
        raise NoResultError(f"{name}: it is inside out beside the first mesh: turn its faces round")
    return charts, far, notes


def _distance(charts: SourceCharts, target: Surface) -> tuple[float, FloatArray]:
    """The largest distance of both surfaces, in diagonals of the first, and its (3,) place."""
    there, (_, places) = _thinned(charts.places), _samples(target)
    back = np.asarray(cKDTree(places).query(there)[0])
    some = _thinned(places)
    gone = np.asarray(charts.free.query(some)[0])
    place = some[gone.argmax()] if gone.max() >= back.max() else there[back.argmax()]
    return float(max(back.max(), gone.max()) / charts.diagonal), place


def _samples(target: Surface) -> tuple[IntArray, FloatArray]:
    """The face of each of many places all over a surface, and (k, 3) the places."""
    face, bary = samples_of(target.areas, CHART_SAMPLE_BOUNDS)
    return face, interpolated(bary, target.points[target.faces[face]])


def _thinned(rows: np.ndarray) -> np.ndarray:
    """About ``SHAPE_SAMPLES`` of the rows."""
    return rows[:: max(1, len(rows) // SHAPE_SAMPLES)]


def _refuse_overlaps(charts: SourceCharts, document: Document) -> None:
    """Raise NoResultError if charts of the first mesh lie on each other or on themselves."""
    cut_mesh, uv = charts.atlas.open()
    found = overlaps(cut_mesh, uv)
    if len(found.pairs) or found.self_overlapping.any():
        raise NoResultError(
            f"{document.source.name}: its charts overlap in uv, and a layout is carried only without overlaps: "
            "lay its charts apart with circparam pack, or make new ones with circparam unwrap"
        )


def _fitted(job: Job, layout: CarriedLayout, resolution: int, most: float) -> Fitted:
    """The layout as stored.

    Raises NoResultError if faces are flipped or overlap, or too many lie in free room. So does a corner too far
    from its place in the first layout.
    """
    surface, name = job.surface, job.document.source.name
    bad = layout.faulty if layout.faulty.any() else layout.loose
    if layout.faulty.any() or layout.loose_share > LOOSE_AREA_SHARE:
        places = surface.corners.mean(1)
        middle = places[bad][surface.areas[bad].argmax()]
        raise NoResultError(
            f"{name}: {counted(int(bad.sum()), 'face')} would overlap others, the largest at "
            f"({_point(middle)}): give a finer mesh, or one that has the seams of the first mesh as edges"
        )
    drift = resolution * float(layout.drift.max())
    if drift > most:
        raise NoResultError(
            f"{name}: the layout drifts by {drift:.1f} texels of {resolution} at "
            f"({_point(layout.farthest)}), more than --max-drift {most:g}: give a finer mesh or a "
            "larger --max-drift"
        )
    cut_mesh, uv = layout.atlas.open()
    uvmap = job.stored(cut_mesh, uv)
    turned = int(flipped_faces(surface, uvmap).sum())
    if turned:
        raise NoResultError(
            f"{name}: {counted(turned, 'face')} would be flipped: give a finer mesh"
        )
    return Fitted(Cascade(layout.atlas), uvmap)


def _transferred(
    result: Result, layout: CarriedLayout, apart: float, resolution: int
) -> Transferred:
    """The result with its drifts in texels, and a warning where faces went to free room."""
    anew = int(layout.loose.sum())
    if anew:
        result.warnings.append(
            f"{counted(anew, 'face')} ({percent(layout.loose_share)} of the surface) overlapped others and "
            "were laid in free room: the texture of the first mesh does not cover that room"
        )
    p95 = Tail.of(layout.inside, layout.atlas.surface.areas).percentile(95)
    largest, mean = float(layout.drift.max()), float(layout.drift.mean())
    return Transferred(
        result, resolution * largest, resolution * mean, resolution * p95,
        resolution * float(layout.inside.max()), apart, layout.farthest, resolution * layout.least,
        anew, layout.loose_share,
    )  # fmt: skip


def _point(place: FloatArray) -> str:
    return " ".join(f"{x:.4g}" for x in place)
