"""Straight charts: developable charts are unrolled exactly, grids of quads become rectangles."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_count, next_half_edge, norms2
from circparam.geometry.distortion import at_best_scales, best_chart_scales, face_stretch
from circparam.geometry.quad_grid import diagonals, faces_pair_up, grid_layout
from circparam.geometry.straight import directions
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing.straight import STRAIGHT_SHARE
from circparam.pipeline import fallback
from circparam.seams.hard.unroll import unroll
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH
from circparam.solvers.objective import chart_energies

NEARLY_FLAT_ENERGY = 1e-4  # of the symmetric Dirichlet energy / 4 over 1: the solvers stop below it
# of √area, by which edges of an exact layout may be off: 2.5e-11 is what the solve rounds at 500,000 faces
EXACT_EDGE_ERROR = 1e-10


def unrolled(atlas: Atlas) -> Atlas:
    """The atlas with all nearly isometric charts unrolled that become exact; the others unchanged."""
    cut_mesh, uv = atlas.open()
    if not np.isfinite(uv).all():
        return atlas
    over = chart_energies(cut_mesh, at_best_scales(cut_mesh, uv)) - 1.0
    faces = np.bincount(cut_mesh.chart, minlength=cut_mesh.n_charts)
    near = (over < NEARLY_FLAT_ENERGY) & (faces > 1)
    if not near.any():
        return atlas
    part, _, _ = cut_mesh.subset(near)
    flat = unroll(part)
    exact = _isometric(part, flat)
    exact &= fallback.faults(part, flat) <= 0
    return _with_layout(atlas, near, flat, exact)


def gridded(atlas: Atlas, bound: float, most_stretch: float | None, always: bool) -> Atlas:
    """The atlas with grids of quads as rectangles, where their distortion stays below ``bound``.

    most_stretch: limit for all but a thousandth of the surface, None for the usual limit. A rectangle never
    stretches more of the surface than its chart did. always: take rectangles up to the bound, also for
    developable charts with curved borders. Otherwise take rectangles where the distortion hardly rises, and
    unroll developable charts.
    """
    cut_mesh, uv = atlas.open()
    if not np.isfinite(uv).all():
        return atlas
    diagonal = diagonals(cut_mesh, atlas.surface.locked[~atlas.cut])
    paired = faces_pair_up(cut_mesh, diagonal)
    if not paired.any():
        return atlas
    part, vertices, faces = cut_mesh.subset(paired)
    given = at_best_scales(part, uv[vertices])
    bent = ~_isometric(part, given)
    if always:
        h = part.boundary
        border = given[part.faces.ravel()[next_half_edge(h)]] - given[part.faces.ravel()[h]]
        bent |= directions(border, part.chart[h // 3], part.n_charts).share < STRAIGHT_SHARE
    if not bent.any():
        return atlas
    flat, grid = grid_layout(part, diagonal[faces])
    grid &= bent
    if not grid.any():
        return atlas
    charts = paired.copy()
    charts[paired] = grid
    part, vertices, _ = part.subset(grid)
    flat, given = at_best_scales(part, flat[vertices]), given[vertices]
    most = bound if always else np.minimum(bound, chart_energies(part, given) + NEARLY_FLAT_ENERGY)
    good = (chart_energies(part, flat) <= most) & (fallback.faults(part, flat) <= 0)
    limit = most_stretch or STRETCH
    old, new = (share_over(part, face_stretch(part, uv), limit) for uv in (given, flat))
    return _with_layout(atlas, charts, flat, good & (new <= old))


def _with_layout(atlas: Atlas, charts: BoolArray, flat: FloatArray, good: BoolArray) -> Atlas:
    """The atlas with a layout of some charts ((n,) bool), those of them that are ``good``, as large as before.

    flat: (nv, 2) of the vertices of these charts, in units of the mesh.
    """
    if not good.any():
        return atlas
    cut_mesh, uv = atlas.open()
    part, vertices, faces = cut_mesh.subset(charts)
    scale = best_chart_scales(part, uv[vertices])[part.vertex_chart][:, None]
    corners, mine = atlas.corners.copy(), good[part.chart]
    corners[faces[mine]] = (flat / scale)[part.faces][mine]
    return Atlas(atlas.surface, atlas.cut, corners, atlas.prices)


def _isometric(cut_mesh: CutMesh, uv: FloatArray) -> BoolArray:
    """(n_charts,) bool: every edge is as long as in space, up to rounding."""
    p = uv[cut_mesh.faces]
    length = norms2((p[:, [1, 2, 0]] - p).reshape(-1, 2)).reshape(-1, 3)
    size = np.sqrt(cut_mesh.chart_areas)[cut_mesh.chart]
    off = np.abs(length - cut_mesh.edge_lengths).max(1) > EXACT_EDGE_ERROR * size
    return group_count(cut_mesh.chart[off], cut_mesh.n_charts) == 0
