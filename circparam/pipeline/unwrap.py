"""The way through: the one place that knows the order of the stages.

read → repair → seams → flatten (a chain that always ends) → pack → complete → store → write → read back and
verify. Nothing is printed; what was found and done is in the ``Result``.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from circparam.core.monitor import Listener, Monitor
from circparam.errors import InputError, NoResultError, TopologyError
from circparam.formats.document import Document
from circparam.formats.io import stored
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import RepairOptions, RepairReport, repair
from circparam.mesh.restore import complete
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.packing import pack
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.configure import (
    method_options,
    open_source,
    pack_options,
    seam_options,
    target_format,
    tiles_of,
)
from circparam.pipeline.options import Options, from_keywords
from circparam.pipeline.pack_splits import split_for_packing
from circparam.pipeline.result import Result, judge, verify_layout
from circparam.pipeline.save import save
from circparam.pipeline.stored_fit import lay_out
from circparam.pipeline.verify import corners_of, uv_seams
from circparam.seams import SEAMS
from circparam.seams.constraints import constrain
from circparam.seams.options import SeamOptions, Seams


def unwrap(
    source: Any,
    output: str | os.PathLike[str] | None = None,
    *,
    listener: Listener | None = None,
    options: Options | None = None,
    **keywords: Any,
) -> Result:
    """Give a mesh a uv layout.

    source: a path, a ``Document``, a ``Mesh``, a pair (points (n, 3), faces (m, 3)) of arrays, or a
    trimesh.Trimesh; never changed. output: file to write (read back and verified); None keeps the layout in
    memory. listener: called with (stage, fraction, note). keywords: the fields of ``Options``.

    Returns a Result. Raises OptionError, InputError, TopologyError, NoResultError, OutOfTimeError, OutputError:
    see ``circparam.errors``.
    """
    if options is None:
        options = from_keywords(keywords)
    elif keywords:
        options = replace(options, **keywords)
    monitor = Monitor(listener, options.timeout)
    with monitor.stage("read"):
        document = open_source(source, options)
    return unwrap_document(document, output, options, monitor)


def unwrap_document(
    document: Document,
    output: str | os.PathLike[str] | None,
    options: Options,
    monitor: Monitor,
) -> Result:
    """All stages after reading."""
    target = target_format(document, output, options)
    with monitor.stage("repair"):
        surface, repair_report = repair(
            document.mesh, RepairOptions(options.weld or 0.0, options.repair)
        )
    monitor.check()
    with monitor.stage("seams"):
        wanted = seam_options(document, surface, repair_report, options)
        seams = find_seams(surface, wanted, options, monitor)
    with monitor.stage("flatten"):
        atlas = first_layout(surface, seams, options, monitor)
    atlas.again = options.cut == "charts" or "convex-boundary" not in METHODS[options.method].tags
    if options.bound is not None and _reachable(options):
        atlas.bound = options.bound
    if options.pack_splits:
        with monitor.stage("pack"):
            fallback.settle(atlas, True, method_options(options), monitor)
            split_for_packing(
                atlas, options.pack_splits, pack_options(options), atlas.bound, monitor
            )
    atlas.notes = [*document.notes, *seams.notes, *atlas.notes]
    uvmap = lay_out(atlas, document, repair_report, target, options, monitor)
    result = _result(document, surface, repair_report, atlas, uvmap, target, options, monitor)
    if output is not None:
        save(result, output, monitor)
    result.seconds = dict(monitor.seconds)
    return result


def _reachable(options: Options) -> bool:
    """Whether every chart can be brought below the bound by splitting it, and nothing asks for otherwise."""
    free = options.max_charts is None and options.no_seams is None and options.pins is None
    return free and options.method == "isometric" and not options.blend


def repack(
    source: Any,
    output: str | os.PathLike[str] | None = None,
    *,
    listener: Listener | None = None,
    **keywords: Any,
) -> Result:
    """Pack the charts that a file's uv has already; their shapes and relative sizes stay as they are.

    source, output, listener: as for ``unwrap``. keywords: the fields of ``Options`` for packing and writing;
    uv_set is the set that is read and replaced. Raises InputError where a face has no uv.
    """
    options = from_keywords({**keywords, "cut": "none"})
    monitor = Monitor(listener, options.timeout)
    with monitor.stage("read"):
        document = open_source(source, options)
        uvmap = document.uv(options.uv_set or 0) if document.uv_sets else None
    if uvmap is None:
        raise InputError(
            f"{document.source.name}: it has no uv to pack: circparam unwrap makes some"
        )
    target = target_format(document, output, options)
    with monitor.stage("repair"):
        surface, repair_report = repair(document.mesh, RepairOptions())
        corners, ok = corners_of(surface, uvmap)
        if not ok.all():
            raise InputError(
                f"{document.source.name}: {int((~ok).sum())} faces have no uv: circparam unwrap makes some"
            )
        atlas = Cascade(surface, uv_seams(surface, uvmap), corners, np.zeros(len(ok), np.int64))
    cut_mesh, uv = atlas.open()
    with monitor.stage("pack"):
        packed = pack(cut_mesh.faces, uv, cut_mesh.chart, pack_options(options), monitor)
    atlas.notes += [*document.notes, *packed.notes]
    whole = stored(
        complete(document.mesh, surface, repair_report, packed.uv, cut_mesh.faces), target, document
    )
    result = _result(document, surface, repair_report, atlas, whole, target, options, monitor)
    result.work = "pack"
    if output is not None:
        save(result, output, monitor)
    result.seconds = dict(monitor.seconds)
    return result


# What a numerical method raises where the numbers of a mesh are beyond it
NUMERICAL = (NoResultError, np.linalg.LinAlgError, ArithmeticError)


def find_seams(surface: Surface, wanted: SeamOptions, options: Options, monitor: Monitor) -> Seams:
    """The seams; where finding charts fails on numbers, only those demanded: the chain splits further."""
    try:
        return SEAMS[options.cut].function(surface, wanted, monitor)
    except NUMERICAL as error:
        if options.cut != "charts":
            raise
        _, forced, notes = constrain(surface, wanted)
        nothing = np.full((len(surface.faces), 3, 2), np.nan)
        return Seams(forced, nothing, [*notes, f"charts were made by halving ({error})"])


def first_layout(surface: Surface, seams: Seams, options: Options, monitor: Monitor) -> Cascade:
    """The layout of the method, or the one that the seams come with where that is the same thing."""
    plain = options.method == "isometric" and not (options.blend or options.pins is not None)
    start = seams.uv if plain else None
    told = method_options(options)
    try:
        return fallback.flatten(
            surface, seams.cut, start, options.method, told, options.pins, monitor
        )
    except (*NUMERICAL, TopologyError) as error:
        if options.cut != "charts":
            raise
        nothing = np.full((len(surface.faces), 3, 2), np.nan)
        atlas = fallback.flatten(surface, seams.cut, nothing, options.method, told, None, monitor)
        atlas.repairs.append(f"--method {options.method} failed at first ({error})")
        return atlas


def _result(
    document: Document,
    surface: Surface,
    repair_report: RepairReport,
    atlas: Cascade,
    uvmap: UVMap,
    target: str,
    options: Options,
    monitor: Monitor,
) -> Result:
    with monitor.stage("verify"):
        tiles = tiles_of(document, options)
        verification = verify_layout(surface, uvmap, options, tiles)
    charts = np.full(len(document.mesh.faces), -1)
    charts[surface.source] = verification.cut_mesh.chart
    result = Result(
        options=options,
        document=document,
        surface=surface,
        repair_report=repair_report,
        uv=uvmap.uv,
        uv_faces=uvmap.uv_faces,
        charts=charts,
        verification=verification,
        status="ok",
        reasons=[],
        warnings=[],
        notes=list(atlas.notes),
        repairs=[*repair_report.messages, *atlas.repairs],
        seconds=dict(monitor.seconds),
        iterations=atlas.iterations,
        stopped=atlas.stopped,
        format=target,
        tiles=tiles,
    )
    judge(result, monitor.expired)
    return result


__all__ = ["Options", "Result", "repack", "save", "unwrap", "unwrap_document"]
