"""The way through: the stages of an unwrap in order.

read → repair → seams → flatten (with a fallback cascade) → pack → store → verify → write, read back and verify
again. Nothing is printed; notes and warnings are in the ``Result``.
"""

import time
from contextlib import nullcontext
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from circparam.core import workers
from circparam.core.arrays import BoolArray, group_sum
from circparam.core.memory import keeping_freed
from circparam.core.monitor import Listener, Monitor
from circparam.core.plural import counted
from circparam.core.workers import DeferredTask
from circparam.errors import OptionError
from circparam.formats.document import Document
from circparam.geometry.overlap import signs
from circparam.geometry.visibility import visible_share
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface
from circparam.pipeline import applies, checkpoint
from circparam.pipeline.configure import open_source, padding_note
from circparam.pipeline.density import at_densities, check_whole
from circparam.pipeline.fallback import Cascade, faults, settle
from circparam.pipeline.flatten import find_seams, first_layout
from circparam.pipeline.job import Job, Output, given_atlas, prepare
from circparam.pipeline.jobs import fit_memory, memory_limit, monitor_of, start_for
from circparam.pipeline.keywords import Keywords
from circparam.pipeline.options import AUTO, Options, from_keywords
from circparam.pipeline.orient import orient_cost
from circparam.pipeline.pinned import check_pins, check_storable
from circparam.pipeline.result import Effort, Result, verify_layout, with_status
from circparam.pipeline.save import save
from circparam.pipeline.searches import (
    OUT_OF_TIME,
    Drafted,
    begun_beside,
    best_layout,
    fuller_page,
    on_page,
)
from circparam.pipeline.stacks import copies_hold
from circparam.pipeline.stored_fit import Fitted, arrange, fit_stored, stored_layout
from circparam.pipeline.verify import uv_seams

# Time after a stage as a multiple of the seconds of the repair, which visits the same mesh on the same
# machine: for projected charts with all later stages; for packing in rows, writing and verifying; for all but
# packing.
LEAST_COST, PACK_COST, WRITE_COST = 7.0, 16.0, 5.0
SEARCH_COST = 600.0  # a long full search, as the same multiple
RESERVE_SECONDS = 0.05  # seconds added to the reserve
# seconds of a look at the seams over those of the repair: 2 to 6 on twelve meshes of 30,000 faces and more
VISIBILITY_COST = 6.0
# covered share of a page below which cuts are tried that only the user can allow
HALF_EMPTY_SHARE = 0.5
GAIN_PAGE_SHARE = 0.05  # share of the page that they must cover more
CUT_TRIALS = 10  # that are tried
# faces: a smaller surface is unwrapped in less time than cuts take to try
LEAST_ADVISED_FACES = 500
KEEPING_FACES = 100_000  # faces from which on freed memory is kept for the next arrays


def unwrap(
    source: Any,
    output: Output = None,
    *,
    listener: Listener | None = None,
    options: Options | None = None,
    **keywords: Unpack[Keywords],
) -> Result:
    """Give a mesh a uv layout.

    source: a path, a ``Document``, a ``Mesh``, a pair (points (n, 3), faces (m, 3)) of arrays, or a
    trimesh.Trimesh or Scene; never changed. output: file to write (read back and verified); None keeps the
    layout in memory. listener: called with (stage, fraction, note). keywords: the fields of ``Options``, or
    changes to ``options``.

    Returns a Result. Raises OptionError, InputError, TopologyError, NoResultError, OutOfTimeError, OutputError:
    see ``circparam.errors``.
    """
    options = from_keywords(keywords, options)
    monitor = monitor_of(options, listener)
    with monitor.stage("read"):
        document = open_source(source, options)
    return unwrap_document(document, output, options, monitor)


def unwrap_document(
    document: Document, output: Output, options: Options, monitor: Monitor
) -> Result:
    """All stages after reading."""
    count = len(document.mesh.faces)
    fit_memory(document.source.name, count, options, monitor)
    if monitor.jobs > 1:
        start_for(options, count)
    with keeping_freed(count >= KEEPING_FACES and memory_limit() is None):
        try:
            return _unwrapped(document, output, options, monitor)
        except MemoryError:
            if not workers.stop():  # the workers' memory was not the cause
                raise
        monitor.jobs = 1
        return _unwrapped(document, output, options, monitor)


def _unwrapped(document: Document, output: Output, options: Options, monitor: Monitor) -> Result:
    job = prepare(document, output, options, monitor)
    if options.pins is not None:
        check_storable(options.pins, document, job.format)
    fitted, effort = _searched(job, monitor)
    result = replace(verify_and_save(job, fitted, output, monitor), effort=effort)
    checkpoint.forget(job)
    return result


def _searched(job: Job, monitor: Monitor) -> tuple[Fitted, Effort]:
    """The layout as it will be stored, and the searches.

    Two outcomes call for another search. The charts of a draft may not fit on pages of a fixed size, where
    those of a full search may. Copies drawn with other diagonals may exceed the bound; an original at half the
    excess leaves room for them.
    """
    asked, options = job.options, job.options
    while True:
        trial = job if options is asked else replace(job, options=options)
        try:
            with nullcontext() if trial is job else monitor.shown_as("again"):
                fitted, effort = _search(trial, monitor)
        except OptionError:
            if not options.draft or options.texel_density is None:
                raise
            checkpoint.forget(trial)
            options = replace(options, effort=1.0)
            continue
        if options.draft != asked.draft:
            note = (
                f"the charts of a draft do not fit at --texel-density {options.texel_density:g}: "
                "a full search was made (--effort normal)"
            )
            fitted = replace(fitted, cascade=fitted.cascade.noted(note))
        if trial is not job:
            checkpoint.forget(trial)
        bound, stacks = options.bound, job.stacks
        if bound is None or bound != asked.bound or stacks is None or monitor.expired:
            return fitted, effort
        if copies_hold(stacks, fitted.uvmap, bound):
            return fitted, effort
        options = replace(options, max_distortion=(1 + bound) / 2)


def _search(job: Job, monitor: Monitor) -> tuple[Fitted, Effort]:
    """One search. Raises OptionError if charts fit on no page of the size asked for."""
    options = job.options
    pace = monitor.seconds.get("repair", 0.0)  # how fast this machine goes through this mesh
    monitor.check(LEAST_COST * pace)
    with monitor.holding(PACK_COST * pace + RESERVE_SECONDS), monitor.stage("seams"):
        begun = begun_beside(job, monitor)
        draft = Drafted.of(job, monitor, SEARCH_COST * pace)
        seams = checkpoint.seams_of(job, monitor, find_seams)
        with monitor.stage("flatten"):
            cascade = first_layout(job, seams, monitor)
    with monitor.holding(WRITE_COST * pace + RESERVE_SECONDS):
        with monitor.stage("pack"):
            filled, cascade = on_page(cascade, draft, options, monitor)
        best, effort = best_layout(filled, begun, job, monitor)
        if best is filled and options.fills_one_page and not options.draft:
            with monitor.stage("pack"):
                best = advised(filled, cascade, options, monitor)
        fitted = fit_stored(job, best, monitor)
    if OUT_OF_TIME in best.notes:
        return fitted, replace(effort, made=0.0)
    several = applies.searches(options) and not options.draft
    return fitted, replace(effort, made=float(effort.searches) if several else options.work)


def advised(filled: Cascade, start: Cascade, options: Options, monitor: Monitor) -> Cascade:
    """The layout ``filled`` that ``fill_page`` made of ``start``, with advice where its page is half empty.

    The advice names the share that further cuts cover. The cuts were made and packed. There is no advice if the
    user has set the number.
    """
    small = len(start.atlas.surface.faces) < LEAST_ADVISED_FACES
    if options.cuts_asked is not None or options.max_charts is not None or small or monitor.expired:
        return filled
    share = fuller_page.covered_share
    found = filled.packing or fuller_page.packing(filled, options, monitor)
    filled = replace(filled, packing=found)
    if found is None or share(found) >= HALF_EMPTY_SHARE:
        return filled
    start = settle(start, monitor)
    more = fuller_page.fill_page(start, replace(options, pack_splits=CUT_TRIALS), monitor)
    if more.packing is None or share(more.packing) < share(found) + GAIN_PAGE_SHARE:
        return filled
    cuts = more.atlas.charts()[0] - start.atlas.charts()[0]
    gain = f"would cover {100 * share(more.packing):.0f} % (--pack-splits {CUT_TRIALS})"
    return replace(filled, advice=f"{counted(cuts, 'cut')} across charts {gain}")


def repack(
    source: Any,
    output: Output = None,
    *,
    listener: Listener | None = None,
    **keywords: Unpack[Keywords],
) -> Result:
    """Pack the charts that a file's uv has already; their shapes and relative sizes stay as they are.

    source, output, listener: as for ``unwrap``. keywords: the fields of ``Options`` for packing and writing.
    uv_set: the set that is read and replaced. Groups with an atlas each, as the file says, keep one. Raises
    OptionError for options that keep charts where the solver left them, InputError if a face has no uv.
    """
    options = from_keywords({**keywords, "cut": "none"})
    if not options.packed:
        raise OptionError("repack places charts: leave normalize and pins out")
    if options.uv_set is not None:
        options = replace(options, overwrite_uv=True)
    monitor = monitor_of(options, listener)
    with monitor.stage("read"):
        document = open_source(source, options)
        uvmap = document.require_uv(options.uv_set or 0)
    return repack_document(document, uvmap, output, options, monitor)


def repack_document(
    document: Document, uvmap: UVMap, output: Output, options: Options, monitor: Monitor
) -> Result:
    """Pack the charts of a layout over the faces of a document; see ``repack``. options: of ``--cut none``."""
    job = prepare(document, output, options, monitor, uvmap)
    atlas = given_atlas(job.surface, uvmap, document.source.name)
    if job.tiles is not None:
        tile = job.tiles[job.surface.source][job.surface.edges // 3]
        atlas.cut |= tile[:, 0] != tile[:, 1]
    cascade = Cascade(atlas)
    cut_mesh, uv = cascade.open()
    if options.density is not None:
        check_whole(cut_mesh, job.surface, document.source.name)
        uv = at_densities(cut_mesh, job.surface, uv)
    with monitor.stage("pack"):
        as_given = np.ones(cut_mesh.n_charts, bool)
        placed = arrange(job, cut_mesh, uv, options, monitor, as_given)
    cascade, uv = cascade.noted(*placed.notes), placed.uv
    n, sign = cut_mesh.n_charts, signs(uv, cut_mesh.faces)
    mirrored = group_sum(sign.astype(np.float64), cut_mesh.chart, n) < 0
    flip = np.where(mirrored[cut_mesh.vertex_chart], -1.0, 1.0)
    fault = faults(cut_mesh, np.stack([uv[:, 0] * flip, uv[:, 1]], 1))
    if (fault > 0).any():  # flips and overlaps that the charts had before stay as they are
        fitted = Fitted(cascade, job.stored(cut_mesh, uv))
    else:
        turn = options.turns != "none" and job.kept is None
        stored = stored_layout(job, cut_mesh, uv, mirrored, turn)
        uvmap = job.completed(cut_mesh, stored.uv, stored.double)
        fitted = Fitted(cascade.noted(*stored.notes), uvmap, stored.double)
    return verify_and_save(job, fitted, output, monitor, "pack")


def seen_share(surface: Surface, cut: BoolArray, monitor: Monitor) -> float | None:
    """As ``visible_share``. monitor: not asked, the caller knows whether there is time."""
    return visible_share(surface, cut)


def _too_late_to_look(monitor: Monitor) -> bool:
    """Whether the visibility of seams would be found after the moment at which all work has to end."""
    cost = VISIBILITY_COST * monitor.seconds.get("repair", 0.0)
    return monitor.last is not None and time.monotonic() + cost > monitor.last


def _verified(job: Job, fitted: Fitted, monitor: Monitor, work: str) -> Result:
    cascade, uvmap, options, document = fitted.cascade, fitted.uvmap, job.options, job.document
    whole = replace(job, surface=job.whole.at_density())
    with monitor.stage("verify"):
        verification = verify_layout(whole, uvmap)
    if options.pins is not None:
        check_pins(document.mesh, uvmap, options.pins, [*cascade.notes, *cascade.repairs])
    orient = None
    if job.kept is None and job.tiles is None:
        with monitor.stage("pack"):
            orient = orient_cost(verification, options, monitor)
    notes = list(document.notes)
    if options.padding == AUTO and options.packed:
        notes.append(padding_note(options.padding_texels))
    notes += [] if job.floaters is None else [job.floaters.note]
    notes += [] if job.stacks is None else job.stacks.notes()
    notes += [] if job.groups is None else [job.groups.note]
    notes += [] if job.kept is None else job.kept.notes(uvmap)
    notes += [] if orient is None else [orient.note]
    result = Result(
        **vars(whole), uv=uvmap.uv, uv_faces=uvmap.uv_faces, verification=verification,
        notes=[*notes, *cascade.notes], repairs=[*job.repair_report.messages, *cascade.repairs],
        seconds=dict(monitor.seconds), iterations=cascade.iterations, stopped=cascade.stopped,
        work=work, uv_double=fitted.double, orient=orient, advice=cascade.advice,
    )  # fmt: skip
    result = with_status(result, monitor.hurried)
    return replace(result, warnings=[*document.warnings, *result.warnings])


def verify_and_save(
    job: Job, fitted: Fitted, output: Output, monitor: Monitor, work: str = "unwrap"
) -> Result:
    """The result, verified, and written where an output is named.

    An idle process looks at the seams meanwhile. Else they are looked at when a caller asks for the figure;
    a caller of the library may never do so. Where time is up they are not looked at.
    """
    surface, look = job.surface if job.kept is None else job.whole, None
    if not _too_late_to_look(monitor):
        cut = uv_seams(surface, fitted.uvmap)
        # caches of a surface need not be sent
        look = DeferredTask(seen_share, (replace(surface), cut), monitor)
        if cut.any():
            look.begin()
    verified = _verified(job, fitted, monitor, work)
    result = verified if output is None else save(verified, output, monitor)
    found = result.verification
    if found is verified.verification:  # otherwise the file has another layout
        if look is None or (not look.begun and _too_late_to_look(monitor)):
            found = replace(found, seen=lambda: None)
        elif look.begun or surface is not found.surface:
            found = replace(found, seen=look.result)
    return replace(result, verification=found, seconds=dict(monitor.seconds))
