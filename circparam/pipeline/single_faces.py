"""The end of the cascade: faces laid down one by one."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, group_max, group_sum, ranges
from circparam.mesh.atlas import Atlas
from circparam.pipeline.cascade import Cascade

STAND_IN = 1e-3  # least side of a triangle that stands in: of √(surface area) or the longest edge
LARGEST = 8  # Cascade.singles at which no polygon that stands in grows any more
GROW = 16.0  # by which such a side grows where even that is not held


def take_to_pieces(cascade: Cascade, faces: BoolArray) -> Cascade:
    """Cut round every polygon among some faces, and project each onto its own plane.

    A triangle stays. The triangles of a polygon all agree with its normal (that is how polygons are
    triangulated), so none of them is flipped.
    """
    again = faces & (cascade.singles > 0)
    if again.any():
        cascade = _stand_in(cascade, again)
    faces = faces & ~again
    if not faces.any():
        return cascade
    surface = cascade.atlas.surface
    inside = faces[surface.edges // 3].any(1)
    cut = cascade.atlas.cut | (inside & ~surface.locked)
    _, polygon = surface.charts(~(inside & surface.locked & ~cut))
    fid = np.flatnonzero(faces)
    _, first, label = np.unique(polygon[fid], return_index=True, return_inverse=True)
    p = surface.points[surface.faces[fid]]
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal = np.stack([group_sum(area[:, k], label, len(first)) for k in range(3)], 1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    origin = p[first, 0]
    x = p[first, 1] - origin
    x -= (x * normal).sum(1)[:, None] * normal
    x /= np.maximum(np.linalg.norm(x, axis=1), 1e-300)[:, None]
    basis = np.stack([x, np.cross(normal, x)], 1)[label]
    atlas = Atlas(surface, cut, cascade.atlas.corners)
    atlas.corners[fid] = np.einsum("mkc,mdc->mkd", p - origin[label][:, None], basis)
    return replace(cascade, atlas=atlas, singles=np.where(faces, 1, cascade.singles)).repaired(
        f"{len(fid)} face(s) placed one by one: no larger chart was valid"
    )


def _stand_in(cascade: Cascade, faces: BoolArray) -> Cascade:
    """Regular polygons for polygons so thin or small that stored numbers cannot hold their shape."""
    atlas = Atlas(cascade.atlas.surface, cascade.atlas.cut, cascade.atlas.corners)
    surface, singles = atlas.surface, cascade.singles.copy()
    _, chart = atlas.charts()
    _, label = np.unique(chart[faces], return_inverse=True)
    local = np.zeros(len(chart), np.int64)
    local[faces] = label
    cut_mesh, fid = surface.part_cut_mesh(atlas.cut, faces, local)
    n = cut_mesh.n_charts
    longest = group_max(cut_mesh.edge_lengths.max(1), cut_mesh.chart, n)
    side = np.maximum(longest, STAND_IN * cascade.extent)
    old = np.linalg.norm(atlas.corners[fid, 1] - atlas.corners[fid, 0], axis=1)
    grown = group_max(np.where(singles[fid] >= 2, GROW * old, 0.0), cut_mesh.chart, n)
    side = np.maximum(side, grown)
    # a polygon's triangles have all their corners on its boundary
    loops = cut_mesh.loops
    turn = ranges(np.diff(loops.start)) / np.diff(loops.start)[loops.loop_of]
    radius = side[loops.chart[loops.loop_of]] / np.sqrt(3)
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()[loops.half_edges]] = radius[:, None] * np.stack(
        [np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)], 1
    )
    atlas.corners[fid] = uv[cut_mesh.faces]
    singles[fid] = np.maximum(singles[fid] + 1, 2)
    return replace(cascade, atlas=atlas, singles=singles).repaired(
        f"{len(fid)} face(s) too thin or small to be stored got a regular polygon instead"
    )
