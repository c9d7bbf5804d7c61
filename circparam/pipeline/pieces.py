"""Charts without a map: faces laid down one by one, and pieces that are projected along an axis."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_max, group_sum, ranges
from circparam.core.graph import components
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.pipeline.cascade import Cascade

STAND_IN = 1e-3  # least side of a triangle that stands in: of √(surface area) or the longest edge
MOST_SINGLES = 8  # Cascade.singles at which no polygon that stands in grows any more
GROW = 16.0  # by which such a side grows where even that is not held
# least share of its area with which a face may be seen along the axis of its neighbours
STEEP = 0.35
VOTES = 12  # rounds in which faces follow most of their neighbours
OWN = 0.5  # weight of the own axis in a vote, in boundary lengths


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
    normal = _normals(p, label, len(first))
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


def project_charts(cascade: Cascade, faces: BoolArray) -> Cascade:
    """Cut charts with those faces ((m,) bool) where the axis that faces look along most changes.

    Every face lies as seen along that axis from outside, so no face is flipped. Costs no solve; but parts of a
    chart may lie behind each other.
    """
    surface = cascade.atlas.surface
    look = _axes(surface)
    inside = faces[surface.edges // 3].any(1) & ~surface.locked
    differ = look[surface.edges[:, 0] // 3] != look[surface.edges[:, 1] // 3]
    atlas = Atlas(surface, cascade.atlas.cut | (inside & differ), cascade.atlas.corners)
    fid = np.flatnonzero(faces)
    p = surface.points[surface.faces[fid]]
    axis, back = look[fid] % 3, look[fid] >= 3
    u, v = (axis + 1) % 3, (axis + 2) % 3
    u, v = np.where(back, v, u), np.where(back, u, v)
    row = np.arange(len(fid))
    atlas.corners[fid] = np.stack([p[row, :, u], p[row, :, v]], 2)
    return replace(cascade, atlas=atlas).repaired(
        f"{len(fid)} face(s) projected along the axes: out of time for a map"
    )


def _axes(surface: Surface) -> IntArray:
    """(m,) the axis that each face is seen along: x, y, z, then the other way; alike in a polygon. The axis
    nearest to the normal comes first. Neighbours then vote among axes that are nearly as good."""
    p = surface.points[surface.faces]
    pairs = surface.edges // 3
    glue = pairs[surface.locked]
    n, polygon = components(len(p), glue[:, 0], glue[:, 1])
    normal = _normals(p, polygon, n)
    seen = np.concatenate([normal, -normal], 1)
    look = seen.argmax(1)
    i, j = polygon[pairs[~surface.locked]].T
    weight = surface.edge_lengths[~surface.locked]
    own = OWN * (np.bincount(i, weight, n) + np.bincount(j, weight, n))
    each = np.arange(n)
    for _ in range(VOTES):
        votes = np.bincount(6 * i + look[j], weight, 6 * n) + np.bincount(
            6 * j + look[i], weight, 6 * n
        )
        votes[6 * each + look] += own
        look = np.where(seen > STEEP, votes.reshape(n, 6), seen - 2).argmax(1)
    result: IntArray = look[polygon]
    return result


def _normals(p: FloatArray, label: IntArray, n: int) -> FloatArray:
    """(n, 3) unit normal of each polygon, from its triangles p (m, 3, 3) with that label (m,)."""
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal = np.stack([group_sum(area[:, k], label, n) for k in range(3)], 1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    return normal
