"""The way through: the one place that knows the order of the stages.

read → repair → seams → flatten (a chain that always ends) → pack → complete → store → write → read back and
verify. Nothing is printed; what was found and done is in the ``Result``.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from circparam import chain
from circparam.arrays import BoolArray, FloatArray, IntArray
from circparam.distortion import best_chart_scales
from circparam.errors import InputError, NoResultError, TopologyError
from circparam.formats import Document, stored
from circparam.hubs import split_hubs
from circparam.mesh import Patches, UVMap
from circparam.methods import METHODS, MethodOptions
from circparam.options import Options, from_keywords
from circparam.output import save
from circparam.packing import pack
from circparam.progress import Listener, Monitor
from circparam.repair import RepairOptions, Repairs, complete, repair
from circparam.result import Result, judge, verify_layout
from circparam.seams import SEAMS, SeamOptions, Seams
from circparam.seams.options import constrain
from circparam.stages import (
    check_names,
    method_options,
    open_source,
    pack_options,
    seam_options,
    target_format,
    tiles_of,
)
from circparam.topology import Surface
from circparam.verify import corners_of, uv_seams, wound_against

RETRIED = (
    0.1  # share of the packing's work that is done again for a layout that stored numbers spoilt
)
ROUNDS = 24  # of pack, store and check, before a layout that stored numbers spoil is given up


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
    check_names(options)
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
        surface, mended = repair(document.mesh, RepairOptions(options.weld or 0.0, options.repair))
    monitor.check()
    with monitor.stage("seams"):
        wanted = seam_options(document, surface, mended, options)
        seams = find_seams(surface, wanted, options, monitor)
    with monitor.stage("flatten"):
        atlas = first_layout(surface, seams, options, monitor)
    atlas.again = options.cut == "charts" or "convex-border" not in METHODS[options.method].tags
    if options.bound is not None and _reachable(options):
        atlas.bound = options.bound
    if options.pack_splits:
        with monitor.stage("pack"):
            chain.settle(atlas, True, method_options(options), monitor)
            split_hubs(atlas, options.pack_splits, pack_options(options), atlas.bound, monitor)
    atlas.notes = [*document.notes, *seams.notes, *atlas.notes]
    uvmap = lay_out(atlas, document, mended, target, options, monitor)
    result = _result(document, surface, mended, atlas, uvmap, target, options, monitor)
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
        surface, mended = repair(document.mesh, RepairOptions())
        corners, ok = corners_of(surface, uvmap)
        if not ok.all():
            raise InputError(
                f"{document.source.name}: {int((~ok).sum())} faces have no uv: circparam unwrap makes some"
            )
        atlas = chain.Atlas(surface, uv_seams(surface, uvmap), corners, np.zeros(len(ok), np.int64))
    patches, uv = atlas.open()
    with monitor.stage("pack"):
        packed = pack(patches.faces, uv, patches.chart, pack_options(options), monitor)
    atlas.notes += [*document.notes, *packed.notes]
    whole = stored(
        complete(document.mesh, surface, mended, packed.uv, patches.faces), target, document
    )
    result = _result(document, surface, mended, atlas, whole, target, options, monitor)
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


def first_layout(surface: Surface, seams: Seams, options: Options, monitor: Monitor) -> chain.Atlas:
    """The layout of the method, or the one that the seams come with where that is the same thing."""
    plain = options.method == "isometric" and not (options.blend or options.pins is not None)
    start = seams.uv if plain else None
    told = method_options(options)
    try:
        return chain.flatten(surface, seams.cut, start, options.method, told, options.pins, monitor)
    except (*NUMERICAL, TopologyError) as error:
        if options.cut != "charts":
            raise
        nothing = np.full((len(surface.faces), 3, 2), np.nan)
        atlas = chain.flatten(surface, seams.cut, nothing, options.method, told, None, monitor)
        atlas.repairs.append(f"--method {options.method} failed at first ({error})")
        return atlas


def lay_out(
    atlas: chain.Atlas,
    document: Document,
    mended: Repairs,
    target: str,
    options: Options,
    monitor: Monitor,
) -> UVMap:
    """Mend, scale and pack until the numbers as stored have no flip and no overlap; uv for every face.

    Packing takes longest, and faces that stored numbers cannot hold may need many links of the chain: once a
    packed layout was spoilt, the next ones are tried at its size before they are packed.
    """
    may_split = options.cut == "charts"
    tiles = tiles_of(document, options)
    convex = method_options(options)
    uvmap: UVMap | None = None
    for turn in range(ROUNDS):
        if turn == 1:  # what stored numbers spoil is spoilt in a loose layout too
            options = replace(options, effort=min(RETRIED * (options.effort or 1.0), 1.0))
        chain.settle(atlas, may_split, convex, monitor)
        patches, uv = atlas.open()
        with monitor.stage("pack"):
            group = None if tiles is None else _chart_tiles(patches, tiles[atlas.surface.source])
            keep = np.zeros(patches.n_charts, bool)
            keep[patches.chart[atlas.laid >= 2]] = True
            side = sides(atlas.surface, patches, options)
            uv[:, 0] *= side[patches.vertex_chart]
            placed = place(patches, uv, options, atlas.notes, monitor, group, keep)
        uvmap = complete(document.mesh, atlas.surface, mended, placed, patches.faces)
        uvmap = stored(uvmap, target, document)
        with monitor.stage("check"):
            fault = _stored_faults(atlas, uvmap, patches, side)
        if not (fault > 0).any():
            break
        if not chain.advance(atlas, fault, may_split, convex, monitor):
            break
        if options.packed and may_split:
            size = _length(patches, placed) / _length(patches, sized(patches, uv, keep))
            _hold_stored(atlas, size, document, target, convex, monitor)
    if uvmap is None or not np.isfinite(uvmap.uv).all():
        raise NoResultError("no finite layout was found")
    return uvmap


def _hold_stored(
    atlas: chain.Atlas,
    size: float,
    document: Document,
    target: str,
    convex: MethodOptions,
    monitor: Monitor,
) -> None:
    """Send charts down the chain that stored numbers would spoil somewhere on a page, at a given size."""
    for _ in range(ROUNDS):
        chain.settle(atlas, True, convex, monitor)
        patches, uv = atlas.open()
        keep = np.zeros(patches.n_charts, bool)
        keep[patches.chart[atlas.laid >= 2]] = True
        with monitor.stage("check"):
            uv = sized(patches, uv, keep) * size
            turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
            uv = uv @ turn  # as packing may: needles along an axis would be stored too well
            hi = np.full((patches.n_charts, 2), -np.inf)
            np.maximum.at(hi, patches.vertex_chart, uv)
            # to the far corner of the page, where stored numbers are coarsest
            uv += (1.0 - hi)[patches.vertex_chart]
            trial = stored(UVMap(uv, patches.faces), target, document)
            fault, _ = chain.faults(patches, trial.uv)
        if not (fault > 0).any() or not chain.advance(atlas, fault, True, convex, monitor):
            return


def _length(patches: Patches, uv: FloatArray) -> float:
    """Length of all edges of all faces."""
    p = uv[patches.faces]
    return max(float(np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2).sum()), 1e-300)


def sides(surface: Surface, patches: Patches, options: Options) -> FloatArray:
    """(n_charts,) −1 for charts to be mirrored, so that most of each lies as the file winds it; else 1.

    Nothing is mirrored where pins say where vertices lie.
    """
    if options.pins is not None:
        return np.ones(patches.n_charts)
    return np.where(wound_against(surface, patches), -1.0, 1.0)


def _stored_faults(
    atlas: chain.Atlas, uvmap: UVMap, patches: Patches, side: FloatArray
) -> IntArray:
    """Faults of the charts in the numbers as the file will hold them; side: see ``sides``."""
    corners, _ = corners_of(atlas.surface, uvmap)
    uv = np.zeros((patches.n_vertices, 2))
    uv[patches.faces.ravel()] = corners.reshape(-1, 2)
    uv[:, 0] *= side[patches.vertex_chart]
    fault, _ = chain.faults(patches, uv)
    return fault


def place(
    patches: Patches,
    uv: FloatArray,
    options: Options,
    notes: list[str],
    monitor: Monitor,
    group: IntArray | None = None,
    keep: BoolArray | None = None,
) -> FloatArray:
    """Charts at their best scales, packed into pages; or side by side as the solver left them.

    group: (n_charts,) charts of different groups get pages of their own, one atlas each.
    keep: (n_charts,) charts that keep the size they have.
    """
    if not options.packed:
        return _side_by_side(patches, np.where(np.isfinite(uv), uv, 0.0))
    uv = sized(patches, uv, keep)
    wanted = pack_options(options)
    for label in np.unique(group if group is not None else 0):
        mine = np.full(patches.n_charts, True) if group is None else group == label
        part, vertices, _ = patches.subset(mine)
        packed = pack(part.faces, uv[vertices], part.chart, wanted, monitor)
        uv[vertices] = packed.uv
        notes += [note for note in packed.notes if note not in notes]
    return uv


def sized(patches: Patches, uv: FloatArray, keep: BoolArray | None) -> FloatArray:
    """uv with charts at their best scales, but for those ((n_charts,) bool) that keep the size they have."""
    uv = np.where(np.isfinite(uv), uv, 0.0)
    scale = best_chart_scales(patches, uv)
    if keep is not None:
        scale[keep] = 1.0
    result: FloatArray = uv * scale[patches.vertex_chart][:, None]
    return result


def _chart_tiles(patches: Patches, tile: IntArray) -> IntArray:
    """(n_charts,) tile of each chart, from that of each face."""
    out = np.zeros(patches.n_charts, np.int64)
    out[patches.chart] = tile
    return out


def _side_by_side(patches: Patches, uv: FloatArray) -> FloatArray:
    """The solver's coordinates; the first chart stays where it is, the others stand to its right."""
    n = patches.n_charts
    lo, hi = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(lo, patches.vertex_chart, uv[:, 0])
    np.maximum.at(hi, patches.vertex_chart, uv[:, 0])
    room = 0.02 * float((hi - lo).max(initial=0.0))
    shift = np.zeros(n)
    shift[1:] = np.cumsum(hi[:-1] - lo[:-1] + room) - lo[1:] + lo[0]
    return uv + np.stack([shift, np.zeros(n)], 1)[patches.vertex_chart]


def _result(
    document: Document,
    surface: Surface,
    mended: Repairs,
    atlas: chain.Atlas,
    uvmap: UVMap,
    target: str,
    options: Options,
    monitor: Monitor,
) -> Result:
    with monitor.stage("verify"):
        tiles = tiles_of(document, options)
        verification = verify_layout(surface, uvmap, options, tiles)
    charts = np.full(len(document.mesh.faces), -1)
    charts[surface.source] = verification.patches.chart
    result = Result(
        options=options,
        document=document,
        surface=surface,
        mended=mended,
        uv=uvmap.uv,
        uv_faces=uvmap.uv_faces,
        charts=charts,
        verification=verification,
        status="ok",
        reasons=[],
        warnings=[],
        notes=list(atlas.notes),
        repairs=[*mended.messages, *atlas.repairs],
        seconds=dict(monitor.seconds),
        iterations=atlas.iterations,
        stopped=atlas.stopped,
        format=target,
        tiles=tiles,
    )
    judge(result, monitor.expired)
    return result


__all__ = ["Options", "Result", "repack", "save", "unwrap", "unwrap_document"]
