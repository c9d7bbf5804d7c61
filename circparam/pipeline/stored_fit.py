"""A packed layout whose numbers, as the format stores them, have no flip and no overlap."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray
from circparam.errors import NoResultError
from circparam.formats.io import has_doubles
from circparam.geometry.coverage import pages_of
from circparam.geometry.overlap import signs
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import UVMap
from circparam.pipeline import fallback
from circparam.pipeline.align import align
from circparam.pipeline.cascade import Cascade, KnownPacking
from circparam.pipeline.density import of_charts
from circparam.pipeline.job import Job
from circparam.pipeline.kept import put_into_room
from circparam.pipeline.options import Options
from circparam.pipeline.orient import up_axis, upright
from circparam.pipeline.pinned import place_pinned
from circparam.pipeline.place import Placed, chart_signs, pack_sorted, place, sized
from circparam.pipeline.representable_uv import Rounding
from circparam.pipeline.stored_repair import Stored, store

# share of the packing's work that is done again for a layout that stored numbers spoilt
RETRIED_EFFORT_SHARE = 0.1
ROWS_PAGE_SHARE = 0.4  # share of a page that charts in rows cover
# factor by which numbers are taken coarser if there is no time for a second packing
COARSER_FACTOR = 4.0
PACK_ROUNDS = 24  # of pack, store and check, before a layout that stored numbers spoil is given up


@dataclass(frozen=True, eq=False)
class Fitted:
    """The layout of every face of the file, as stored, and the cascade that led to it; double: stored as
    doubles (see ``WriteOptions.uv_double``)."""

    cascade: Cascade
    uvmap: UVMap
    double: bool = False


def fit_stored(job: Job, cascade: Cascade, monitor: Monitor) -> Fitted:
    """Mend, scale and pack until the numbers as stored have no flip and no overlap; uv for every face.

    Packing takes longest, and faces that stored numbers cannot hold may need many steps of the cascade. After a
    spoilt layout, the next ones are tried at its size before they are packed. Raises NoResultError if no
    finite layout is found.
    """
    options, settled = job.options, False
    if monitor.hurried and options.packed and cascade.rules.may_split:
        # with time up, no packing is tried that stored numbers are likely to spoil: charts that are sound at
        # about the size of charts in rows on a full page, made coarser, are hardly ever spoilt
        size = float(np.sqrt(ROWS_PAGE_SHARE / cascade.atlas.surface.areas.sum())) / COARSER_FACTOR
        cascade, settled = _settle_stored(job, cascade, size, monitor), True
    for turn in range(PACK_ROUNDS):
        if turn == 1:  # faces that stored numbers spoil are spoilt in a loose layout too
            options = replace(options, effort=min(RETRIED_EFFORT_SHARE * options.work, 1.0))
        if not settled and cascade.packing is None:  # no layout is packed before it is settled
            cascade = fallback.settle(cascade, monitor)
        cut_mesh, uv = cascade.open()
        keep = cascade.kept_sizes(cut_mesh)
        with monitor.stage("pack"):
            sign = chart_signs(job.surface, cut_mesh, options)
            uv[:, 0] *= sign[cut_mesh.vertex_chart]
            placed = arrange(job, cut_mesh, uv, options, monitor, keep, cascade.packing)
        with monitor.stage("check"):
            turn = options.packed and options.turns != "none" and job.kept is None
            stored = stored_layout(job, cut_mesh, placed.uv, sign < 0, turn)
        uvmap = job.completed(cut_mesh, stored.uv, stored.double)
        cascade = cascade.noted(*placed.notes, *stored.notes)
        fitted = Fitted(cascade, uvmap, stored.double)
        if not (stored.fault > 0).any():
            break
        after = fallback.advance(cascade, stored.fault, monitor)
        if after is None:
            break
        cascade = replace(after, packing=None)
        settled = options.packed and cascade.rules.may_split and not monitor.hurried
        if settled:
            at_size = sized(cut_mesh, placed.uv, keep)
            size = _length(cut_mesh, placed.uv) / _length(cut_mesh, at_size)
            cascade = _settle_stored(job, cascade, size, monitor)
    if not np.isfinite(fitted.uvmap.uv).all():
        raise NoResultError("no finite layout was found: try another --method, or --cut charts")
    return replace(fitted, cascade=cascade)


def arrange(
    job: Job,
    cut_mesh: CutMesh,
    uv: FloatArray,
    options: Options,
    monitor: Monitor,
    keep: BoolArray,
    known: KnownPacking | None = None,
) -> Placed:
    """Charts (nv, 2) where they lie: at their pins, in the room of a page in use, or packed.

    keep: (n_charts,) bool, charts that keep the size they have. known: see ``place``.
    """
    group, notes = None, []
    if job.tiles is not None:
        group = of_charts(job.tiles[job.surface.source], cut_mesh)[0].astype(np.int64)
    if options.pins is not None:
        placed = place_pinned(job, cut_mesh, uv, options.pins)
    else:
        if options.orient == "up":
            turned = upright(cut_mesh, job.surface, uv, up_axis(job.document, options))
            uv, notes = turned.uv, [turned.note]
        label = job.sorting(cut_mesh)
        if job.kept is not None:
            placed = put_into_room(job.kept, cut_mesh, sized(cut_mesh, uv, keep), options)
        elif label is None or job.groups is None:
            placed = place(cut_mesh, uv, options, monitor, group, keep, known)
        else:
            at_size, pages = sized(cut_mesh, uv, keep), job.groups.pages
            placed = pack_sorted(cut_mesh, at_size, options, monitor, label, pages)
    return Placed(align(cut_mesh, placed.uv, options, group), [*notes, *placed.notes])


def stored_layout(
    job: Job, cut_mesh: CutMesh, uv: FloatArray, mirrored: BoolArray, turn: bool = False
) -> Stored:
    """Round a packed layout (nv, 2) as the target stores it and mend spoilt faces; see ``store``.

    For charts that stay faulty, pages are turned by quarters (if ``turn``), because numbers are finest near
    zero. Next, uv become doubles where the format has them. The result has the fewest faulty charts.
    """
    tried: list[Stored] = []
    for double in (False, True) if has_doubles(job.target) else (False,):
        number = job.rounding(double)
        for exact in _placements(cut_mesh, uv, number, mirrored, turn and not double):
            tried.append(store(cut_mesh, exact, mirrored, number, double))
            if tried[-1].sound:
                return tried[-1]
    return min(tried, key=lambda one: int((one.fault > 0).sum()))


def _placements(
    cut_mesh: CutMesh, uv: FloatArray, number: Rounding, mirrored: BoolArray, turn: bool
) -> Iterator[FloatArray]:
    """The layout itself, then the turn for which rounding spoils the fewest faces."""
    yield uv
    if turn:
        side = np.where(mirrored, -1, 1)[cut_mesh.chart]
        turns = [_turned(cut_mesh, uv, quarters) for quarters in range(4)]
        spoilt = [(side * signs(number(t), cut_mesh.faces) <= 0).sum() for t in turns]
        best = int(np.argmin(spoilt))
        if best:
            yield turns[best]


def _turned(cut_mesh: CutMesh, uv: FloatArray, quarters: int) -> FloatArray:
    """uv (nv, 2) with every page turned by quarters, counter-clockwise."""
    page = pages_of(cut_mesh, uv)[cut_mesh.vertex_chart]
    x, y = uv[:, 0] - page, uv[:, 1]
    for _ in range(quarters):
        x, y = 1.0 - y, x
    return np.stack([x + page, y], 1)


def _settle_stored(job: Job, cascade: Cascade, size: float, monitor: Monitor) -> Cascade:
    """Send charts on that stored numbers would spoil somewhere on a page, at a given size. Each lies
    turned, as packing may turn it, because needles along an axis would be stored too well; and at the far
    corner of the page, where stored numbers are coarsest."""
    cascade = fallback.settle(cascade, monitor)
    cut_mesh, uv = cascade.open()
    with monitor.stage("check"):
        uv = sized(cut_mesh, uv, cascade.kept_sizes(cut_mesh)) * size
        uv = uv @ np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
        high = np.full((cut_mesh.n_charts, 2), -np.inf)
        np.maximum.at(high, cut_mesh.vertex_chart, uv)
        uv = uv + (1.0 - high)[cut_mesh.vertex_chart]
        fault = stored_layout(job, cut_mesh, uv, np.zeros(cut_mesh.n_charts, bool)).fault
    return fallback.settle_faulty(
        cascade, fault, monitor, lambda part, to: _settle_stored(job, part, size, to)
    )


def _length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    """Length of all edges of all faces."""
    p = uv[cut_mesh.faces]
    return max(float(np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2).sum()), 1e-300)
