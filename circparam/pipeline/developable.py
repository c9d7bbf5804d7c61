"""Charts that unroll without distortion, laid out so to the last digits: belts and tubes become rectangles."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_count, norms2
from circparam.geometry.distortion import best_chart_scales
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.pipeline import fallback
from circparam.seams.hard.unroll import unroll
from circparam.solvers.objective import chart_energies

NEARLY = 1e-4  # of the symmetric Dirichlet energy / 4 over 1: the solvers stop below it
EXACT = 1e-10  # relative: rounding of the lengths of edges
LARGEST = 200_000  # faces of such charts together: beyond, factors take seconds


def unrolled(atlas: Atlas) -> Atlas:
    """The atlas with all charts unrolled that are nearly isometric and become exactly so; else as they are."""
    cut_mesh, uv = atlas.open()
    if not np.isfinite(uv).all():
        return atlas
    scale = best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]
    over = chart_energies(cut_mesh, uv * scale) - 1.0
    faces = np.bincount(cut_mesh.chart, minlength=cut_mesh.n_charts)
    near = (over < NEARLY) & (faces > 1)
    if not near.any() or faces[near].sum() > LARGEST:
        return atlas
    part, vertices, fid = cut_mesh.subset(near)
    flat = unroll(part)
    exact = _isometric(part, flat)
    exact &= fallback.faults(part, flat)[0] <= 0
    if not exact.any():
        return atlas
    corners = atlas.corners.copy()
    mine = exact[part.chart]
    whole = (flat / scale[vertices])[part.faces]
    corners[fid[mine]] = whole[mine]
    return Atlas(atlas.surface, atlas.cut, corners, atlas.prices)


def _isometric(cut_mesh: CutMesh, uv: FloatArray) -> BoolArray:
    """(n_charts,) bool: every edge is as long as in space, up to rounding of the longest one of its chart."""
    p = uv[cut_mesh.faces]
    length = norms2((p[:, [1, 2, 0]] - p).reshape(-1, 2)).reshape(-1, 3)
    longest = np.zeros(cut_mesh.n_charts)
    np.maximum.at(longest, cut_mesh.chart, cut_mesh.edge_lengths.max(1))
    off = np.abs(length - cut_mesh.edge_lengths).max(1) > EXACT * longest[cut_mesh.chart]
    result: BoolArray = group_count(cut_mesh.chart[off], cut_mesh.n_charts) == 0
    return result
