"""One atlas for all levels of detail: the layout of the first mesh on coarser or finer ones of its shape."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import FloatArray
from circparam.core.fields import Range
from circparam.core.monitor import Listener, Monitor
from circparam.core.plural import counted, percent
from circparam.core.records import dataclass
from circparam.errors import NoResultError, OptionError
from circparam.formats.document import Document
from circparam.maps.carried_charts import CarriedLayout, SourceCharts, carry_charts, samples_of
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.surface import Surface
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.configure import open_source
from circparam.pipeline.job import Job, given_atlas, prepare
from circparam.pipeline.options import Options, from_keywords
from circparam.pipeline.result import Result
from circparam.pipeline.stored_fit import Fitted
from circparam.pipeline.unwrap import finish
from circparam.pipeline.verify import flipped_faces

SHAPE = (
    0.05  # of the diagonal: no quadric decimation to a tenth of the faces moves a surface so far
)
LOOKED = 5_000  # places of the first mesh that are sought on the others
LOOSE = (
    0.01  # of the surface: more faces in free room would show, as the texture does not cover them
)
DRIFT = Range(0.0, 1e6, "a distance in texels, at least 0; 8 is the default")
SIDE = Range(16, 65536, "a page of 16 to 65536 texels a side")


@dataclass(frozen=True, eq=False)
class Transferred:
    """A layout that one mesh took over from another.

    result: as of an unwrap, verified. drift: texels of the corner that lies furthest from the closest point of
    its chart. drift_mean: over all corners. inside_p95, inside_max: texels in the middle of faces, where a
    coarser face cuts through what is curved. apart: largest distance of both surfaces, in diagonals.
    place: (3,) of the vertex with the largest drift. least: texels that any layout without flips drifts at
    least, as the target folds over there. anew: faces that lie in free room, anew_share: of the surface.
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
            "overlap": v.overlap,
            "mirrored": len(v.mirrored),
            "missing": v.missing,
            "seam_length": v.seam_length,
            "drift": self.drift,
            "drift_mean": self.drift_mean,
            "drift_least": self.least,
            "drift_place": [float(x) for x in self.place],
            "inside_p95": self.inside_p95,
            "inside_max": self.inside_max,
            "apart": self.apart,
            "anew": self.anew,
            "anew_share": self.anew_share,
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

    source, targets: as ``unwrap`` takes them; the source has uv. outputs: a file for each target, None keeps
    its layout in memory. resolution: texels a side of the page that drifts are told in. max_drift: largest
    drift that is written, in texels. keywords: the fields of ``Options`` for files: reader, overwrite, uv_set
    (the set that is read and written) ... All layouts are made before the first file is written.

    Returns one ``Transferred`` a target. Raises InputError where the source has no uv, NoResultError where a
    target has another shape, where a drift is larger than max_drift, and where too many faces would overlap.
    """
    DRIFT.check("--max-drift", max_drift)
    SIDE.check("--resolution", resolution)
    options = _options(keywords)
    outputs = [None] * len(targets) if outputs is None else list(outputs)
    if len(outputs) != len(targets):
        raise OptionError(f"{len(targets)} targets have {len(outputs)} outputs: give one for each")
    monitor = Monitor(listener, None, 1)
    with monitor.stage("read"):
        charts = _source_charts(open_source(source, options), options)
        documents = [open_source(target, options) for target in targets]
    jobs = [prepare(d, o, options, monitor) for d, o in zip(documents, outputs, strict=True)]
    carried = []
    with monitor.stage("transfer"):
        for job in jobs:
            apart = _check_shape(charts, job.surface, job.document)
            carried.append((carry_charts(charts, job.surface), apart))
            _check_layout(carried[-1][0], job)
            _check_drift(carried[-1][0], job, resolution, max_drift)
    made = [_fitted(job, layout) for job, (layout, _) in zip(jobs, carried, strict=True)]
    out = []
    for job, fitted, output, (layout, apart) in zip(jobs, made, outputs, carried, strict=True):
        result = finish(job, fitted, output, monitor, "transfer")
        result.warnings.extend(_loose_lines(layout, job.surface))
        out.append(_transferred(result, layout, apart, job.surface, resolution))
    return out


def _options(keywords: dict[str, Any]) -> Options:
    """Options of files; those of seams, methods and packing have no use here."""
    if keywords.get("uv_set") is not None:
        keywords = {**keywords, "overwrite_uv": True}
    return from_keywords({**keywords, "cut": "none", "normalize": False})


def _source_charts(document: Document, options: Options) -> SourceCharts:
    """The charts of a document's own uv. Raises InputError if a face has none."""
    uvmap = document.require_uv(options.uv_set or 0)
    surface, _ = repair(document.mesh, RepairOptions(0.0, True, by_position=True), uvmap)
    return SourceCharts(given_atlas(surface, uvmap, document.source.name))


def _check_shape(charts: SourceCharts, target: Surface, document: Document) -> float:
    """The largest distance of both surfaces, in diagonals of the first. Raises NoResultError beyond SHAPE."""
    there = charts.places[:: max(1, len(charts.places) // LOOKED)]
    face, bary = samples_of(target.areas)
    places = np.einsum("pk,pkc->pc", bary, target.points[target.faces[face]])
    back = np.asarray(cKDTree(places).query(there)[0])
    some = places[:: max(1, len(places) // LOOKED)]
    gone = np.asarray(charts.free.query(some)[0])
    far = float(max(back.max(), gone.max()) / charts.diagonal)
    if far > SHAPE:
        place = some[gone.argmax()] if gone.max() >= back.max() else there[back.argmax()]
        raise NoResultError(
            f"{document.source.name}: at ({_point(place)}) it lies {100 * far:.0f} % of the size away from the "
            f"first mesh: give one of the same shape, place and size (within {100 * SHAPE:.0f} %)"
        )
    return far


def _check_layout(layout: CarriedLayout, job: Job) -> None:
    """Raise NoResultError where faces stay turned or overlap, or where many lie elsewhere than before."""
    surface, name = job.surface, job.document.source.name
    share = _loose_share(layout, surface)
    bad = layout.faulty if layout.faulty.any() else layout.loose
    if layout.faulty.any() or share > LOOSE:
        places = surface.points[surface.faces].mean(1)
        middle = places[bad][surface.areas[bad].argmax()]
        raise NoResultError(
            f"{name}: {counted(int(bad.sum()), 'face')} would overlap others, the largest at "
            f"({_point(middle)}): give a finer mesh, or one that has the seams of the first mesh as edges"
        )


def _loose_lines(layout: CarriedLayout, surface: Surface) -> list[str]:
    count = int(layout.loose.sum())
    if not count:
        return []
    share = percent(_loose_share(layout, surface))
    return [
        f"{counted(count, 'face')} ({share} of the surface) overlapped others and were laid in free room: the "
        "texture of the first mesh does not cover that room"
    ]


def _loose_share(layout: CarriedLayout, surface: Surface) -> float:
    return float(surface.areas[layout.loose].sum() / surface.areas.sum())


def _check_drift(layout: CarriedLayout, job: Job, resolution: int, most: float) -> None:
    """Raise NoResultError if a corner lies too far from where the first mesh has it."""
    drift = resolution * float(layout.drift.max())
    if drift > most:
        raise NoResultError(
            f"{job.document.source.name}: the layout drifts by {drift:.1f} texels of {resolution} at "
            f"({_point(_place(layout, job.surface))}), more than --max-drift {most:g}: give a finer mesh or a "
            "larger --max-drift"
        )


def _fitted(job: Job, layout: CarriedLayout) -> Fitted:
    """The layout as stored. Raises NoResultError if faces stay turned over."""
    cut_mesh, uv = layout.atlas.open()
    uvmap = job.stored(cut_mesh, uv)
    turned = int(flipped_faces(job.surface, uvmap).sum())
    if turned:
        raise NoResultError(
            f"{job.document.source.name}: {counted(turned, 'face')} would be flipped: give a finer mesh"
        )
    return Fitted(Cascade(layout.atlas), uvmap)


def _place(layout: CarriedLayout, surface: Surface) -> FloatArray:
    face, corner = np.unravel_index(int(layout.drift.argmax()), layout.drift.shape)
    result: FloatArray = surface.points[surface.faces[face, corner]]
    return result


def _transferred(
    result: Result, layout: CarriedLayout, apart: float, surface: Surface, resolution: int
) -> Transferred:
    order = np.argsort(layout.inside)
    whole = np.cumsum(surface.areas[order])
    p95 = layout.inside[order][np.searchsorted(whole, 0.95 * whole[-1])]
    return Transferred(
        result,
        resolution * float(layout.drift.max()),
        resolution * float(layout.drift.mean()),
        resolution * float(p95),
        resolution * float(layout.inside.max()),
        apart,
        _place(layout, surface),
        resolution * layout.least,
        int(layout.loose.sum()),
        _loose_share(layout, surface),
    )


def _point(place: FloatArray) -> str:
    return " ".join(f"{x:.4g}" for x in place)
