"""A packed layout whose numbers, as the format stores them, have no flip and no overlap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError
from circparam.formats.document import Document
from circparam.formats.io import stored
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import RepairReport
from circparam.mesh.restore import complete
from circparam.methods.base import MethodOptions
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade
from circparam.pipeline.configure import method_options, tiles_of
from circparam.pipeline.options import Options
from circparam.pipeline.place import chart_tiles, place, sides, sized
from circparam.pipeline.verify import corners_of

RETRIED = (
    0.1  # share of the packing's work that is done again for a layout that stored numbers spoilt
)
ROUNDS = 24  # of pack, store and check, before a layout that stored numbers spoil is given up


def lay_out(
    atlas: Cascade,
    document: Document,
    repair_report: RepairReport,
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
        fallback.settle(atlas, may_split, convex, monitor)
        cut_mesh, uv = atlas.open()
        with monitor.stage("pack"):
            group = None if tiles is None else chart_tiles(cut_mesh, tiles[atlas.surface.source])
            keep = np.zeros(cut_mesh.n_charts, bool)
            keep[cut_mesh.chart[atlas.laid >= 2]] = True
            side = sides(atlas.surface, cut_mesh, options)
            uv[:, 0] *= side[cut_mesh.vertex_chart]
            placed = place(cut_mesh, uv, options, atlas.notes, monitor, group, keep)
        uvmap = complete(document.mesh, atlas.surface, repair_report, placed, cut_mesh.faces)
        uvmap = stored(uvmap, target, document)
        with monitor.stage("check"):
            fault = _stored_faults(atlas, uvmap, cut_mesh, side)
        if not (fault > 0).any():
            break
        if not fallback.advance(atlas, fault, may_split, convex, monitor):
            break
        if options.packed and may_split:
            size = _length(cut_mesh, placed) / _length(cut_mesh, sized(cut_mesh, uv, keep))
            _hold_stored(atlas, size, document, target, convex, monitor)
    if uvmap is None or not np.isfinite(uvmap.uv).all():
        raise NoResultError("no finite layout was found")
    return uvmap


def _hold_stored(
    atlas: Cascade,
    size: float,
    document: Document,
    target: str,
    convex: MethodOptions,
    monitor: Monitor,
) -> None:
    """Send charts down the chain that stored numbers would spoil somewhere on a page, at a given size."""
    for _ in range(ROUNDS):
        fallback.settle(atlas, True, convex, monitor)
        cut_mesh, uv = atlas.open()
        keep = np.zeros(cut_mesh.n_charts, bool)
        keep[cut_mesh.chart[atlas.laid >= 2]] = True
        with monitor.stage("check"):
            uv = sized(cut_mesh, uv, keep) * size
            turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
            uv = uv @ turn  # as packing may: needles along an axis would be stored too well
            hi = np.full((cut_mesh.n_charts, 2), -np.inf)
            np.maximum.at(hi, cut_mesh.vertex_chart, uv)
            # to the far corner of the page, where stored numbers are coarsest
            uv += (1.0 - hi)[cut_mesh.vertex_chart]
            trial = stored(UVMap(uv, cut_mesh.faces), target, document)
            fault, _ = fallback.faults(cut_mesh, trial.uv)
        if not (fault > 0).any() or not fallback.advance(atlas, fault, True, convex, monitor):
            return


def _length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    """Length of all edges of all faces."""
    p = uv[cut_mesh.faces]
    return max(float(np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2).sum()), 1e-300)


def _stored_faults(atlas: Cascade, uvmap: UVMap, cut_mesh: CutMesh, side: FloatArray) -> IntArray:
    """Faults of the charts in the numbers as the file will hold them; side: see ``sides``."""
    corners, _ = corners_of(atlas.surface, uvmap)
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = corners.reshape(-1, 2)
    uv[:, 0] *= side[cut_mesh.vertex_chart]
    fault, _ = fallback.faults(cut_mesh, uv)
    return fault
