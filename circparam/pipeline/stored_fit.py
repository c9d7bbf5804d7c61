"""A packed layout whose numbers, as the format stores them, have no flip and no overlap."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.errors import NoResultError
from circparam.formats.io import has_doubles
from circparam.geometry.coverage import pages_of
from circparam.geometry.overlap import signs
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import UVMap
from circparam.pipeline import fallback
from circparam.pipeline.align import align
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.configure import pack_options
from circparam.pipeline.job import Job
from circparam.pipeline.kept import put_into_room
from circparam.pipeline.options import Options
from circparam.pipeline.orient import up_axis, upright
from circparam.pipeline.pinned import place_pinned
from circparam.pipeline.place import Placed, chart_signs, chart_tiles, pack_sorted, place, sized
from circparam.pipeline.representable_uv import Rounding
from circparam.pipeline.stored_repair import Stored, store

# share of the packing's work that is done again for a layout that stored numbers spoilt
RETRIED = 0.1
FILLED = 0.4  # share of a page that charts in rows cover
COARSER = 4.0  # factor by which numbers are taken coarser if there is no time for a second packing
ROUNDS = 24  # of pack, store and check, before a layout that stored numbers spoil is given up


@dataclass(frozen=True, eq=False)
class Fitted:
    """The layout of every face of the file, as stored, and the cascade that led to it; double: stored as
    doubles (see ``WriteOptions.uv_double``)."""

    cascade: Cascade
    uvmap: UVMap
    double: bool = False


@dataclass(frozen=True, eq=False)
class _Trial:
    """One layout, packed and stored. fault: (n_charts,) as ``fallback.faults``; size: length of its edges over
    that before packing."""

    cascade: Cascade
    uvmap: UVMap
    fault: IntArray
    size: float
    double: bool


def fit_stored(job: Job, cascade: Cascade, monitor: Monitor) -> Fitted:
    """Mend, scale and pack until the numbers as stored have no flip and no overlap; uv for every face.

    Packing takes longest, and faces that stored numbers cannot hold may need many steps of the cascade. After a
    spoilt layout, the next ones are tried at its size before they are packed. Raises NoResultError if no
    finite layout is found.
    """
    options, settled = job.options, False
    if monitor.hurried and options.packed and cascade.rules.may_split:
        # with time up, no packing is tried that stored numbers are likely to spoil
        cascade, settled = _hold_stored(job, cascade, _likely_size(cascade), monitor), True
    for turn in range(ROUNDS):
        if turn == 1:  # faces that stored numbers spoil are spoilt in a loose layout too
            options = replace(options, effort=min(RETRIED * options.work, 1.0))
        if not settled:
            cascade = fallback.settle(cascade, monitor)
        trial = _packed(job, cascade, options, monitor)
        cascade = trial.cascade
        if not (trial.fault > 0).any():
            break
        after = fallback.advance(cascade, trial.fault, monitor)
        if after is None:
            break
        cascade = replace(after, packing=None)
        settled = options.packed and cascade.rules.may_split and not monitor.hurried
        if settled:
            cascade = _hold_stored(job, cascade, trial.size, monitor)
    if not np.isfinite(trial.uvmap.uv).all():
        raise NoResultError("no finite layout was found: try another --method, or --cut charts")
    return Fitted(cascade, trial.uvmap, trial.double)


def _packed(job: Job, cascade: Cascade, options: Options, monitor: Monitor) -> _Trial:
    """Pack a layout, complete it, round it as the format does, and look for faults."""
    cut_mesh, uv = cascade.open()
    keep = cascade.kept_sizes(cut_mesh)
    with monitor.stage("pack"):
        tiles = None if job.tiles is None else job.tiles[job.surface.source]
        group = None if tiles is None else chart_tiles(cut_mesh, tiles)
        sign = chart_signs(job.surface, cut_mesh, options)
        uv[:, 0] *= sign[cut_mesh.vertex_chart]
        if options.pins is not None:
            placed = place_pinned(job, cut_mesh, uv, options.pins)
        elif job.kept is not None:
            at_size, asked = sized(cut_mesh, uv, keep), pack_options(options)
            placed = Placed(*put_into_room(job.kept, cut_mesh, at_size, options, asked))
        else:
            if options.orient == "up" and options.packed:
                turned = upright(cut_mesh, job.surface, uv, up_axis(job.document, options))
                uv, cascade = turned.uv, cascade.noted(turned.note)
            sorting = job.sorting(cut_mesh)
            if sorting is None:
                placed = place(cut_mesh, uv, options, monitor, group, keep, cascade.packing)
            else:
                at_size = sized(cut_mesh, uv, keep)
                placed = pack_sorted(cut_mesh, at_size, options, monitor, sorting)
    with monitor.stage("check"):
        uv = align(cut_mesh, placed.uv, options, group)
        turn = options.packed and options.turns != "none" and job.kept is None
        held = hold(job, cut_mesh, uv, sign < 0, turn)
    uvmap = job.completed(cut_mesh, held.stored.uv, held.double)
    size = _length(cut_mesh, placed.uv) / _length(cut_mesh, sized(cut_mesh, uv, keep))
    return _Trial(
        cascade.noted(*placed.notes, *held.notes), uvmap, held.stored.fault, size, held.double
    )


@dataclass(frozen=True, eq=False)
class StoredLayout:
    """A packed layout in numbers that its format stores, as doubles or not, with notes."""

    stored: Stored
    double: bool
    notes: list[str]


def hold(
    job: Job, cut_mesh: CutMesh, uv: FloatArray, mirrored: BoolArray, turn: bool = False
) -> StoredLayout:
    """Round a packed layout (nv, 2) as the target stores it and mend spoilt faces; see ``store``.

    For charts that stay faulty, pages are turned by quarters (if ``turn``), because numbers are finest near
    zero. Next, uv become doubles where the format has them. The result has the fewest faulty charts.
    """
    tried: list[StoredLayout] = []
    for double in (False, True) if has_doubles(job.target) else (False,):
        number = job.rounding(double)
        for exact in _placements(cut_mesh, uv, number, mirrored, turn and not double):
            found = store(cut_mesh, exact, mirrored, number)
            tried.append(StoredLayout(found, double, _notes(found, double)))
            if found.sound:
                return tried[-1]
    return min(tried, key=lambda one: int((one.stored.fault > 0).sum()))


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


def _notes(stored: Stored, double: bool) -> list[str]:
    """One line for each thing that was done for stored numbers."""
    out = []
    if stored.moved:
        out.append(
            f"{stored.moved} uv vertices moved to nearby storable numbers, because rounding "
            "spoilt their faces"
        )
    if double:
        out.append("uv are stored as doubles: single precision cannot represent some faces")
    return out


def _turned(cut_mesh: CutMesh, uv: FloatArray, quarters: int) -> FloatArray:
    """uv (nv, 2) with every page turned by quarters, counter-clockwise."""
    page = pages_of(cut_mesh, uv)[cut_mesh.vertex_chart]
    x, y = uv[:, 0] - page, uv[:, 1]
    for _ in range(quarters):
        x, y = 1.0 - y, x
    return np.stack([x + page, y], 1)


def _hold_stored(job: Job, cascade: Cascade, size: float, monitor: Monitor) -> Cascade:
    """Send charts on that stored numbers would spoil somewhere on a page, at a given size."""
    cascade = fallback.settle(cascade, monitor)
    cut_mesh, uv = cascade.open()
    with monitor.stage("check"):
        uv = _at_far_corner(cut_mesh, uv, cascade.kept_sizes(cut_mesh), size)
        fault = hold(job, cut_mesh, uv, np.zeros(cut_mesh.n_charts, bool)).stored.fault
    return fallback.sent_on(
        cascade, fault, monitor, lambda part, to: _hold_stored(job, part, size, to)
    )


def _likely_size(cascade: Cascade) -> float:
    """About the size of charts in rows on a full page, made coarser. Charts that are sound at this size are
    hardly ever spoilt."""
    return float(np.sqrt(FILLED / cascade.atlas.surface.areas.sum())) / COARSER


def _at_far_corner(cut_mesh: CutMesh, uv: FloatArray, keep: BoolArray, size: float) -> FloatArray:
    """Charts at a size, turned, each at the far corner of the page, where stored numbers are coarsest."""
    uv = sized(cut_mesh, uv, keep) * size
    # turned as packing may: needles along an axis would be stored too well
    uv = uv @ np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
    hi = np.full((cut_mesh.n_charts, 2), -np.inf)
    np.maximum.at(hi, cut_mesh.vertex_chart, uv)
    result: FloatArray = uv + (1.0 - hi)[cut_mesh.vertex_chart]
    return result


def _length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    """Length of all edges of all faces."""
    p = uv[cut_mesh.faces]
    return max(float(np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2).sum()), 1e-300)
